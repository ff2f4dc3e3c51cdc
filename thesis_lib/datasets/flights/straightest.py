"""Arc fits in which a bent arc is cut to half its samples if that makes it straight."""

import numpy as np

from thesis_lib.datasets.flights.arcs import ArcFits, fit_arcs, is_bent
from thesis_lib.datasets.flights.noise import SIGMA_FLOOR, NoiseEstimate
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples

_MIN_CUT = 8  # samples: fewer cannot separate free fall from rest


def fit_straightest(
    samples: Samples, at: np.ndarray, noise: NoiseEstimate, header: Header, settings: ArcSettings
) -> ArcFits:
    """Arc fits in which a bent arc is cut to half its samples if that makes it straight.

    A bent far end (a weak hit, the body coming to rest) must not spoil the velocity at the near end.  The noise found
    in the data judges: a wrong header should not shorten every window.
    """
    sigma = np.fmax(noise.sigma, SIGMA_FLOOR)

    def fit(hits: np.ndarray, size: np.ndarray | None = None) -> ArcFits:
        parts = {"spread": noise.contact_spread, "colour": noise.colour, "stray": noise.stray}
        return fit_arcs(samples, hits, noise.used, header, settings, size=size, **parts)

    def bends(fits: ArcFits) -> np.ndarray:
        bent = is_bent(fits, sigma, settings.arc_deviation)
        # a ball slides after a hit, and rolls later: the samples beside the hit show it
        return bent | ((fits.chi2_near > settings.meet_sigma**2) & (header.gravity == 0.0))[:, None]

    fits = fit(at)
    bent = bends(fits)
    if not bent.any():
        return fits
    # hits of a trial bound each other's windows and are fitted together
    rows = np.flatnonzero(np.isin(samples.trial[at], samples.trial[at[bent.any(1)]]))
    bent, whole = bent[rows], np.full((len(rows), 2), settings.max_window)
    size, count = whole, fits.n_side[rows]
    for _ in range(2):
        size = np.where(bent & (count > _MIN_CUT), np.maximum(count // 2 + 1, _MIN_CUT), size)
        shorter = fit(at[rows], size)
        bent_still = bends(shorter)
        bent, count = bent & bent_still, shorter.n_side
    # any short arc is nearly straight: to be a flight it must also fall rather than rest, where there is gravity
    straight = ~bent_still & (shorter.n_side >= settings.min_window)  # pyright: ignore[reportOperatorIssue, reportPossiblyUnboundVariable]
    cured = (size < whole) & straight & ((shorter.fall > 0) | (header.gravity == 0.0))  # pyright: ignore[reportPossiblyUnboundVariable]
    final = fit(at[rows], np.where(cured, size, whole))
    return fits.put(rows, final)
