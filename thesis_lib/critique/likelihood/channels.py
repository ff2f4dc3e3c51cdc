"""The channels of the evidence: what a model may err in, one registry.

| channel | of each              | compared                               | error                                   |
|---------|----------------------|----------------------------------------|-----------------------------------------|
| impact  | impact               | velocity after it, with the prediction | mean kinetic norm in m/s                |
| flight  | flight               | acceleration, with the prediction      | root mean square of the worst component |
| meet    | impact               | pose after it, with that before        | the same                                |
| touch   | single hit           | gap, given the poses                   | the same, or what the upper tenth shows |
| rest    | rest on the surface  | gap and angle, with those of lying     | root mean square of the worst component |
| slide   | slide on the surface | acceleration, with that by friction    | the same                                |

All but the first count in units of noise.  In the plane rests and slides are in the data only where the settings ask
for them (`CritiqueSettings.channels`), in space always; flights in space have how their acceleration changes, too.  A
fault of the touch may concern few impacts, as of one corner.  An error is material where it differs by what the
settings say (`SearchSettings.matters`), over the floor that noise alone leaves: 1 sigma.  In space a flight has twelve
components: what noise makes of the worst of so many is taken out (`worst_of_noise`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.whitening import given_the_others
from thesis_lib.effects.effect import Effect
from thesis_lib.mechanics.space import Space
from thesis_lib.statistics.spread import OF_MEDIAN, quantile_std, robust_std

UPPER = 0.9  # quantile of the touch that a fault of a tenth of the impacts moves
MISSED = 3.0  # sigma by which poses at a hit differ that is not alone; of noise 2 % of hits have one of six


@dataclass(frozen=True)
class Misfits:
    """What a model leaves of n impacts: R (n, m), its covariance S (n, m, m) for an unknown instant and `sharp` at the
    estimated one; by channel, whitened residuals (k, c) of what is measured beside impacts."""

    observations: Observations
    R: np.ndarray
    S: np.ndarray
    sharp: np.ndarray
    beside: Mapping[str, np.ndarray]


def worst_of_noise(size: int, components: int) -> float:
    """Mean of the largest robust mean square that noise alone leaves in `components` of `size` values each.

    Of twelve components with ten values each it is 2.7.  Spreads are taken as normal, the largest one by Blom's scores
    (Statistical Estimates and Transformed Beta-Variables, 1958).
    """
    spread = OF_MEDIAN / np.sqrt(size)
    return float((1.0 + spread * norm.ppf((components - 0.375) / (components + 0.25))) ** 2 + spread**2)


@dataclass(frozen=True)
class Channel:
    """A channel that is measured beside impacts.

    Attributes:
        name: key in files, and what effects declare.
        text: in a sentence.
        part: of the residuals of an impact, 0 to 2; None of what is measured beside impacts.
        of_contact: whether it says where a contact is and ends, and impulses do not compare with integrated ones.
    """

    name: str
    text: str
    part: int | None = None
    of_contact: bool = False
    unit = "sigma"

    @property
    def short(self) -> str:
        """The text without its explanation."""
        return self.text.split(",")[0]

    def columns(self, space: Space) -> range:
        """Columns of the channel in the residuals of an impact; empty for what is measured beside impacts."""
        ends = (0, space.motions, 2 * space.motions, 2 * space.motions + 1)
        return range(0) if self.part is None else range(ends[self.part], ends[self.part + 1])

    def concerns(self, effect: Effect) -> bool:
        """Whether the effect changes what the channel compares."""
        return self.name in effect.channels

    def in_sigmas(self, left: Misfits) -> np.ndarray | None:
        """Residuals (k, c) in units of noise; None if the data do not have the channel."""
        z = left.beside.get(self.name)
        return z if z is not None and len(z) else None

    def mean_square(self, z: np.ndarray, left: Misfits) -> float:
        """Robust mean square, from the median, of the worst component of z (k, c), the channel's part of `left`.

        The median ignores a few flights with an undetected hit; the worst component shows a wrong gravity despite x
        and θ.
        """
        return float(np.max(robust_std(z)) ** 2)


@dataclass(frozen=True)
class _Derived(Channel):
    """One that effects do not declare: those concern it that override one of the `hooks`."""

    hooks: tuple[str, ...] = ()

    def concerns(self, effect: Effect) -> bool:
        return any(getattr(type(effect), hook) is not getattr(Effect, hook) for hook in self.hooks)


class _Impact(Channel):
    unit = "m/s"

    def in_sigmas(self, left: Misfits) -> np.ndarray | None:
        columns = self.columns(left.observations.space)
        return left.R[:, columns] / np.sqrt(np.einsum("nii->ni", left.sharp)[:, columns])


class _Meet(_Impact):
    unit = "sigma"

    def in_sigmas(self, left: Misfits) -> np.ndarray | None:
        return super().in_sigmas(left) if left.observations.arcs else None


class _Touch(_Meet):
    def in_sigmas(self, left: Misfits) -> np.ndarray | None:
        if not left.observations.arcs:
            return None
        single = left.observations.span == 0.0  # episodes do not measure the touch
        m = left.observations.space.motions
        return given_the_others(left.R[single, m:], left.S[single, m:, m:]) if single.any() else None

    def mean_square(self, z: np.ndarray, left: Misfits) -> float:
        o, upper, meets = left.observations, z, MEET.in_sigmas(left)
        if meets is not None and not o.space.is_plane:
            # flights that miss each other aside have another hit between them, which the gap cannot show
            met = (np.abs(meets[o.span == 0.0]) < MISSED).all(axis=1)
            upper = z[met] if 2 * met.sum() > len(z) else z
        return max(super().mean_square(z, left), float(np.max(quantile_std(upper, UPPER)) ** 2))


IMPACT = _Impact("impact", "the velocities after impact", 0)
FLIGHT = Channel("flight", "the flights between impacts")
MEET = _Meet("meet", "the poses at impact, where the arcs before and after should meet", 1, of_contact=True)
TOUCH = _Touch("touch", "the gap at impact", 2, of_contact=True)
REST = _Derived("rest", "the poses in which the body lies still", hooks=("to_true", "gap"))
SLIDE = _Derived(
    "slide",
    "the friction of a body that slides on the surface",
    hooks=("to_true", "to_contact", "coefficients", "sliding", "acceleration"),
)
CHANNELS = {channel.name: channel for channel in (IMPACT, FLIGHT, MEET, TOUCH, REST, SLIDE)}
ALWAYS = (FLIGHT.name, MEET.name, TOUCH.name)  # in every table, if as unknown


def present(beside: Iterable[str]) -> list[str]:
    """Names of the channels in sigmas of data that have `beside`, in the order of the registry."""
    return [name for name in CHANNELS if name in ALWAYS or name in beside]


def concerned(effect: Effect) -> tuple[str, ...]:
    """Names of the channels in which the effect changes what is compared."""
    return tuple(name for name, channel in CHANNELS.items() if channel.concerns(effect))
