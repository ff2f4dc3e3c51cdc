"""Registry of the channels of evidence, the blocks of residuals in which the error of a model is judged.

| channel | for each             | compared                                 | error                                   |
|---------|----------------------|------------------------------------------|-----------------------------------------|
| impact  | impact               | velocity after it, with the prediction   | mean kinetic norm in m/s                |
| flight  | flight               | acceleration, with the prediction        | root mean square of the worst component |
| meet    | impact               | pose after it, with the pose before      | as for flight                           |
| touch   | single hit           | gap, given the poses                     | as for flight, or from the upper tenth  |
| rest    | rest on the surface  | gap and angle, with those of lying flat  | as for flight                           |
| slide   | slide on the surface | acceleration, with that due to friction  | as for flight                           |

All channels except impact are in units of noise.  In the plane rests and slides are used only if the settings require
them (`CritiqueSettings.channels`), in space always; flights in space also contain the change of their acceleration.  A
misfit in touch may affect few impacts, for example of one corner.  An error is material if it changes by the amount in
the settings (`SearchSettings.matters`), above the level due to noise alone: 1 sigma.  In space a flight has twelve
components; the expected largest value of so many due to noise is subtracted (`worst_of_noise`).
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

UPPER = 0.9  # quantile of the touch that is sensitive to a misfit in a tenth of the impacts
MISSED = 3.0  # sigma between poses at a hit that indicates a second hit; by noise, 2 % of hits have one of six


@dataclass(frozen=True)
class Misfits:
    """Residuals of a model: R (n, m) of n impacts, their covariance S (n, m, m) for an unknown instant and `sharp` for
    the estimated instant; by channel, whitened residuals (k, c) of the evidence in addition to impacts."""

    observations: Observations
    R: np.ndarray
    S: np.ndarray
    sharp: np.ndarray
    beside: Mapping[str, np.ndarray]


def worst_of_noise(size: int, components: int) -> float:
    """Expected largest robust mean square of `components` of `size` values each, due to noise alone.

    It is 2.7 for twelve components with ten values each.  Spreads are assumed to be normal; the largest is given by
    Blom's scores (Statistical Estimates and Transformed Beta-Variables, 1958).
    """
    spread = OF_MEDIAN / np.sqrt(size)
    return float((1.0 + spread * norm.ppf((components - 0.375) / (components + 0.25))) ** 2 + spread**2)


@dataclass(frozen=True)
class Channel:
    """A channel; this class is for evidence in addition to impacts.

    Attributes:
        name: key in files and in the declarations of effects.
        text: description for use in a sentence.
        part: part of the residuals of an impact, 0 to 2; None for evidence in addition to impacts.
        of_contact: whether it depends on where a contact begins and ends: impulses and integrated contacts then differ.
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
        """Columns of the channel in the residuals of an impact; empty for evidence in addition to impacts."""
        ends = (0, space.motions, 2 * space.motions, 2 * space.motions + 1)
        return range(0) if self.part is None else range(ends[self.part], ends[self.part + 1])

    def concerns(self, effect: Effect) -> bool:
        """Whether the effect changes the quantities that the channel compares."""
        return self.name in effect.channels

    def in_sigmas(self, left: Misfits) -> np.ndarray | None:
        """Residuals (k, c) in units of noise; None if the data do not contain the channel."""
        z = left.beside.get(self.name)
        return z if z is not None and len(z) else None

    def mean_square(self, z: np.ndarray, left: Misfits) -> float:
        """Robust mean square, from the median, of the worst component of z (k, c), the channel's part of `left`.

        The median ignores a few flights with an undetected hit; the worst component shows a wrong gravity that does
        not affect x and θ.
        """
        return float(np.max(robust_std(z)) ** 2)


@dataclass(frozen=True)
class _Derived(Channel):
    """A channel that effects do not declare; it concerns the effects that override one of the `hooks`."""

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
        single = left.observations.span == 0.0  # episodes do not give a touch residual
        m = left.observations.space.motions
        return given_the_others(left.R[single, m:], left.S[single, m:, m:]) if single.any() else None

    def mean_square(self, z: np.ndarray, left: Misfits) -> float:
        o, upper, meets = left.observations, z, MEET.in_sigmas(left)
        if meets is not None and not o.space.is_plane:
            # poses that differ along the surface indicate another hit in between, which the gap does not show
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
ALWAYS = (FLIGHT.name, MEET.name, TOUCH.name)  # in every table, possibly as unknown


def present(beside: Iterable[str]) -> list[str]:
    """Names of the channels in units of sigma for data with the channels `beside`, in the order of the registry."""
    return [name for name in CHANNELS if name in ALWAYS or name in beside]


def concerned(effect: Effect) -> tuple[str, ...]:
    """Names of the channels that the effect concerns."""
    return tuple(name for name, channel in CHANNELS.items() if channel.concerns(effect))
