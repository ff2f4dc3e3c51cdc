"""Result of the search for impacts: usable impacts, impacts left out with a reason, and further findings."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import contact_kind
from thesis_lib.datasets.checks.lasting_contacts import LastingContacts
from thesis_lib.datasets.flights.arcs import ArcFits
from thesis_lib.datasets.flights.low_pass import LowPass
from thesis_lib.datasets.flights.noise import NoiseEstimate
from thesis_lib.datasets.flights.parabolas import NO_PARABOLAS, Hits, Parabolas, hits_of
from thesis_lib.datasets.format.air import Air
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.datasets.impacts.stays_down import StaysDown
from thesis_lib.mechanics.state import State

LEFT_OUT_COLUMNS = ("trial", "impact", "t", "reason", "detail")
# fewest for a verdict: some trials select the model, others validate it
MIN_TRIALS = 10
MIN_IMPACTS = 30
ARC_COLUMNS = (
    *("trial", "impact", "t", "t_std", "used", "n_pre", "n_post"),
    *(f"rms_{axis}_{side}" for side in ("pre", "post") for axis in ("x", "y", "theta")),
    *("chi2_pre", "chi2_post", "chi2_meet", "miss", "gap", "gap_std"),
)


@dataclass(frozen=True)
class Away:
    """n changes of velocity away from the surface, in its frame.

    Attributes:
        before, after: states at the instant, from the samples on either side under gravity.
        middle: (n, 2) s, mean times of these samples from the instant.
        std: (n,) m/s, standard error of the change along one axis.
    """

    before: State
    after: State
    middle: np.ndarray
    std: np.ndarray


@dataclass(frozen=True)
class FoundImpacts:
    """Usable impacts, and further findings of the search."""

    impacts: Impacts  # the usable ones, with t, cov and flags
    # `LEFT_OUT_COLUMNS`, reasons as in `quality`; `energy_gain`: a row of impacts.csv gains more than any impact can
    left_out: pd.DataFrame
    arcs: pd.DataFrame  # a row per detected impact, used or not, `ARC_COLUMNS` in s, m, rad; chi2_* per dof
    noise: NoiseEstimate
    glitches: pd.DataFrame  # columns trial, t: samples masked as tracking glitches
    # the poses searched, sorted, without glitches and ends of records that stand out; None if impacts.csv was used
    samples: Samples | None = None
    parabolas: Parabolas = NO_PARABOLAS  # through the flights between impacts
    guard: float = ArcSettings().guard  # s; samples nearer to an impact belong to neither flight
    low_pass: LowPass | None = None  # the filter that smoothed the samples, if corners at impacts show one
    remarks: tuple[str, ...] = ()  # sentences on behaviour that no impact law describes
    soft: LastingContacts | None = None  # contacts too long for impulses
    down: StaysDown | None = None  # hits that end at rest, where faster ones rebound
    step: float = 0.0  # s; contacts seem to be detected once per such step
    air: Air | None = None  # forces of the air on the body in flight; `samples.air` where arcs take them into account
    contacts: pd.DataFrame | None = None  # for bodies in space, a row per hit: trial, impact, kind, jump in m/s
    away: Away | None = None  # in space, of the hits `off_surface`, in their order
    gain: float = 0.0  # median relative gain of energy at impacts, 0 unless most gain
    warnings: tuple[str, ...] = ()  # sentences for the user, the remarks among them

    @property
    def hits(self) -> Hits:
        """All detected hits, by trial and time."""
        return hits_of(self.arcs)

    @property
    def used_arcs(self) -> pd.DataFrame:
        """The rows of `arcs` of the usable impacts."""
        return self.arcs[self.arcs["used"].astype(bool)].reset_index(drop=True)

    @property
    def arcs_air(self) -> Air | None:
        """The air forces assumed in the arcs; None if they assume only gravity."""
        return None if self.samples is None else self.samples.air

    def summary(self) -> dict:
        """Counts, reasons, flags, noise and warnings, ready for JSON (NaN as null)."""
        flags = [flag for text in self.impacts.flags for flag in str(text).split(";") if flag]
        noise = {"position": self.noise.position, "angle": self.noise.angle}
        return {
            "used": len(self.impacts),
            "left_out": self.left_out["reason"].value_counts().sort_index().to_dict(),
            "flagged": {flag: flags.count(flag) for flag in sorted(set(flags))},
            "noise": {key: value if np.isfinite(value) else None for key, value in noise.items()},
            "noise_source": self.noise.source,
            "glitches": len(self.glitches),
            "low_pass": None if self.low_pass is None else self.low_pass.content(),
            "warnings": list(self.warnings),
        }


def are_enough(impacts: int, trials: int) -> bool:
    """Whether these numbers of usable impacts and trials are enough for a verdict."""
    return impacts >= MIN_IMPACTS and trials >= MIN_TRIALS


def ordinals(trial: np.ndarray) -> np.ndarray:
    """Number 0, 1, 2, … of each row within its trial."""
    first = np.flatnonzero(np.r_[True, trial[1:] != trial[:-1]][: len(trial)])
    return np.arange(len(trial)) - np.repeat(first, np.diff(np.r_[first, len(trial)]))


def arc_table(fits: ArcFits, trial: np.ndarray, ordinal: np.ndarray, used: np.ndarray) -> pd.DataFrame:
    """A row (`ARC_COLUMNS`) for each of n fits; `trial` and `ordinal` (n,) are its trial and its number therein."""
    dof = np.maximum(fits.n_side - 2, 1)[..., None]
    rms = np.sqrt(fits.ss / dof).reshape(len(fits), 6)  # over degrees of freedom: comparable with sigma
    measured = (fits.n_side >= 2).all(1)  # a line needs two samples
    t_std, gap, gap_std = (np.where(measured, a, np.nan) for a in (fits.t_std, fits.gap, fits.gap_std))
    columns = [trial, ordinal, fits.t, t_std, used, *fits.n_side.T, *rms.T, *fits.reduced.T]
    columns += [fits.chi2_meet / 2.0, np.where(measured, fits.miss, np.nan), gap, gap_std]
    return pd.DataFrame(dict(zip(ARC_COLUMNS, columns)))


def found_in_space(
    header: SpaceHeader,
    detected: State,
    impact: np.ndarray,
    reason: np.ndarray,
    jump: np.ndarray,
    noise: tuple[float, float],
) -> FoundImpacts:
    """Result of the search for a body in space, with the `kind` of contact of each hit.

    Args:
        detected: poses at the hits in the frame of the surface, trials and times.
        impact, reason: (n,) number in the trial, and why it is left out, "" if it is not.
        jump: (n,) m/s, change of the motion at the hits, in the norm of `Observations.norm`; NaN where unknown.
        noise: one sigma of a position in m and of each component of a turn in rad.
    """
    none, out = np.zeros(0), np.flatnonzero(reason != "")
    cells = (detected.trial[out], impact[out], detected.t[out], reason[out], np.full(len(out), "", object))
    left_out = pd.DataFrame(dict(zip(LEFT_OUT_COLUMNS, cells)))
    sigma, k_g = np.array([noise[0], noise[0], noise[1]]), header.body.radius_of_gyration
    kind = contact_kind(header.body.solid, detected.attitude)
    return FoundImpacts(
        impacts=Impacts(
            none, none, none.reshape(0, 7), none.reshape(0, 6), none.reshape(0, 6), none.reshape(0, 3), k_g
        ),
        left_out=left_out.assign(kind=kind[out]),
        contacts=pd.DataFrame({"trial": detected.trial, "impact": impact, "kind": kind, "jump": jump}),
        arcs=pd.DataFrame(columns=ARC_COLUMNS),
        noise=NoiseEstimate(*noise, sigma, sigma, "differences" if header.noise is None else "header"),
        glitches=pd.DataFrame(columns=["trial", "t"]),
    )
