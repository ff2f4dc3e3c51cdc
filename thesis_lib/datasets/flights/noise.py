"""Measurement noise from trajectories (third differences, then residuals of the arcs), and arcs fitted with it.

Residuals of the arcs fitted to the flights give the final value.  They also show slow errors of a tracker, which third
differences cannot see.  Slow errors correlate the residuals of neighbouring samples, and make fitted velocities worse
than white noise of the same size would:

    var = colour × var_white,    colour = (1 + ρ)/(1 − ρ)        (AR(1) noise, lag-one correlation ρ)

Where samples were smoothed, or the spectrum of long flights contradicts this, the colour is computed by `colour`.

Noise stated in dataset.yaml is independent for each sample, so the arcs show all of it.  A value twice too large would
halve all misfits, and any model would fit; a value clearly above the scatter is replaced by it (`overstated`).
Calibration errors, and drifts slower than a flight, are the same for all samples of an impact: they do not make
velocities less certain, but are causes to be found.  Errors in between, slower than an arc, do; long flights show them.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from thesis_lib.datasets.flights.arcs import ArcFits, fit_arcs, is_bent
from thesis_lib.datasets.flights.colour import long_flights, slope_variance
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.statistics.spread import robust_std
from thesis_lib.statistics.wording import plural

SIGMA_FLOOR = np.array([1e-7, 1e-7, 1e-6])  # m, m, rad: avoids division by zero for noise-free (simulated) data
_MIN_ARCS = 6  # fewer arcs do not determine the noise; third differences are used instead
_MIN_ARC_SAMPLES = 8
_LONG_ARC_SAMPLES = 16  # if there are enough long arcs, short ones are not used: they are rattle, and hide correlation
_MAX_LAG1 = 0.8  # above, an arc of 25 samples cannot separate noise from curvature
_COLOURED = 0.2  # correlation of neighbouring residuals below which noise counts as white
CONTRADICTED = 2.0  # ratio of stated noise to the noise of the arcs (known to 10 %) beyond which it is not believed
_SHORT_MEMORY = 0.7  # ρ; slower noise looks like curvature in an arc of 25 samples
_WORSE = 0.5  # relative excess of a variance, which changes an interval by a quarter
_WRONG = 4.5  # sigmas; 1 in 1,000 flights of white noise has such a third difference
_LONG_FLIGHT = 4  # arcs; errors slower than these are not noise of the arcs
_MOVING = 0.1  # m/s
_CLEARLY = 3.0  # standard errors of a median
_EXCESS = 1.2  # the noise is known to 10 %, its square to 20 %
_MIN_CUT = 8  # samples: fewer cannot separate free fall from rest
_OVERSTATED = 1.2  # ratio of stated noise to the noise of the samples; misfits are then 0.83 of what they should be


@dataclass(frozen=True)
class NoiseEstimate:
    """One-sigma noise of a sample; arrays (3,) are of x, y, θ."""

    position: float  # position, angle: m, rad; as estimated (x and y pooled), NaN without data
    angle: float
    sigma: np.ndarray  # m, m, rad, as estimated
    used: np.ndarray  # the same, as used for the covariances: `stated` if it is a number, else `sigma`
    source: str  # "arcs", "differences" or "header"
    contact_spread: float = 0.0  # s, see `arcs`
    lag1: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))  # ρ; near 0 for white noise
    colour: np.ndarray = field(default_factory=lambda: np.ones(3))  # factor by which covariances exceed white noise's
    # accelerations beyond gravity, m/s², rad/s² (`arcs`)
    stray: np.ndarray = field(default_factory=lambda: np.zeros(3))
    stated: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))  # the header's; NaN if none or not believed

    def variance(self, walls: bool) -> np.ndarray:
        """Variance (3,) of a sample in m², m², rad², correlation included; between `walls` x and y share one."""
        found = self.used**2 * self.colour
        if walls:
            found[:2] = found[:2].mean()  # for any orientation of a wall
        return found


def noise_from_arcs(fits: ArcFits, rough: np.ndarray, stated: np.ndarray, on_table: bool = False) -> NoiseEstimate:
    """Noise from the residuals of all long arcs: the median over arcs, which bad arcs hardly affect.

    `rough` (3,) in m, m, rad is used if there are too few arcs; `stated` (3,) is the header's, NaN if it states none.
    `on_table`: friction with a table may slow the body down.
    """
    fits = fits.flying
    n = np.maximum(fits.n_side, 4)
    long = fits.n_side >= _LONG_ARC_SAMPLES
    if long.sum() < _MIN_ARCS:
        long = fits.n_side >= _MIN_ARC_SAMPLES
    sigma, lag1, colour, source = rough, np.full(3, np.nan), np.ones(3), "differences"
    if long.sum() >= _MIN_ARCS:
        # the median of chi²_ν / ν is (1 − 2/(9ν))³ to within 0.2 % for ν ≥ 5
        dof = n - 3.0  # of arcs with a free acceleration, so that stray accelerations do not pass for noise
        sigma = np.sqrt(np.median((fits.ss_free / (dof * (1.0 - 2.0 / (9.0 * dof)) ** 3)[..., None])[long], axis=0))
        for enough in (_LONG_ARC_SAMPLES, _MIN_ARC_SAMPLES):
            both = (n >= enough).all(1)
            if both.sum() < _MIN_ARCS:
                continue
            # a parabola through n samples lowers the correlation ρ of its residuals by about (3 + 6ρ)/n
            shrink = 1.0 / n[both].mean(1)[:, None]
            lag1 = np.median((fits.lag1[both] + 3.0 * shrink) / (1.0 - 6.0 * shrink), axis=0)
            # AR(1) noise: the mean of many samples has (1 + ρ)/(1 − ρ) times the variance of white noise
            rho = np.clip(np.where(lag1 > _COLOURED, lag1, 0.0), 0.0, _MAX_LAG1)
            colour = (1.0 + rho) / (1.0 - rho)
            # and a parabola takes that many times its 3 degrees of freedom out of the residuals
            m = np.median(n[both])
            sigma = sigma * np.sqrt((m - 3.0) / np.maximum(m - 3.0 * colour, 0.5 * m))
            break
        source = "arcs"
    if source == "arcs":
        # larger scatter that is not white may be a motion that no arc describes; it must not pass for noise
        scatter = np.fmax(sigma, SIGMA_FLOOR)
        far = (scatter * CONTRADICTED < stated) | ((scatter > CONTRADICTED * stated) & (colour == 1.0))
        stated = np.where(far, np.nan, stated)
    used = np.fmax(np.where(np.isnan(stated), sigma, stated), SIGMA_FLOOR)
    position = float(np.sqrt(np.mean(sigma[:2] ** 2)))
    stray = _stray_acceleration(fits, sigma, colour, on_table)
    return NoiseEstimate(position, float(sigma[2]), sigma, used, source, 0.0, lag1, colour, stray, stated)


def with_colour(
    noise: NoiseEstimate,
    fits: ArcFits,
    samples: Samples,
    at: np.ndarray,
    guard: float,
    *,
    smoothed: bool,
    on_table: bool,
) -> NoiseEstimate:
    """The noise with its colour from the spectrum of long flights (`colour`), where AR(1) does not describe it.

    This is so if the samples are `smoothed`, if ρ is larger than short arcs can show, or if noise that seems white is
    clearly worse in two of three channels (air drag bends long flights in one).  Otherwise, any excess over AR(1) in
    long flights may be a motion that no parabola describes.  `at` (n,) are the samples before the hits; samples within
    `guard` (s) of one belong to no flight.
    """
    colour, flights = _colour_of_flights(noise, fits, samples, at, guard)
    if not flights:
        return noise
    worse = 1.0 + max(_WORSE, 4.0 / np.sqrt(flights))  # 2 standard errors, twice
    slow = (noise.lag1 > _SHORT_MEMORY).any() or ((noise.colour == 1.0).all() and np.median(colour) > worse)
    if not (smoothed or slow):
        return noise
    return replace(noise, colour=colour, stray=_stray_acceleration(fits, noise.used, colour, on_table))


def overstated(noise: NoiseEstimate, fits: ArcFits, samples: Samples, at: np.ndarray, guard: float) -> np.ndarray:
    """Mask (3,) of stated noise that would make impacts seem less certain than they are.

    Such noise clearly exceeds the scatter about the arcs, and the slower errors that long flights show do not explain
    the difference.  Arguments as in `with_colour`.
    """
    sides = fits.flying.n_side
    dof = max(float((sides[sides >= _MIN_ARC_SAMPLES] - 3.0).sum()), 1.0)
    # a median of mean squares has 1.25 times the standard error of their mean
    clearly = max(_OVERSTATED, 1.0 + _CLEARLY * 1.25 / np.sqrt(2.0 * dof))
    ratio = noise.stated / np.fmax(noise.sigma, SIGMA_FLOOR)
    if noise.source != "arcs" or not (ratio > clearly).any():
        return np.zeros(3, bool)
    colour, flights = _colour_of_flights(noise, fits, samples, at, guard)
    slower = np.maximum(colour / noise.colour, 1.0) if flights else 1.0
    return ratio > clearly * np.sqrt(slower)


def _colour_of_flights(
    noise: NoiseEstimate, fits: ArcFits, samples: Samples, at: np.ndarray, guard: float
) -> tuple[np.ndarray, int]:
    """Colour (3,) from the spectrum of long flights, and the number of these: 0 where they do not show it."""
    sides = fits.n_side[fits.n_side >= _MIN_ARC_SAMPLES]
    if noise.source != "arcs" or not len(sides):
        return np.ones(3), 0
    n = int(np.median(sides))
    flights = long_flights(samples, at, fits.t, guard, longest=_LONG_FLIGHT * n)
    sigma = np.fmax(noise.sigma, SIGMA_FLOOR)
    # a wrong sample adds to all frequencies; the variance of a third difference of white noise is 20 σ²
    rough = [np.abs(np.diff(poses, n=3, axis=1) / (sigma * np.sqrt(20.0))).max((1, 2)) for poses in flights]
    flights = [poses[worst < _WRONG] for poses, worst in zip(flights, rough)]
    if not flights or min(map(len, flights)) < _MIN_ARCS:
        return np.ones(3), 0
    white = sigma**2 * 12.0 / (n * (n**2 - 1.0))
    return np.maximum(slope_variance(flights, n) / white, 1.0), len(flights[0])


def _stray_acceleration(fits: ArcFits, sigma: np.ndarray, colour: np.ndarray, on_table: bool) -> np.ndarray:
    """One sigma (3,) of accelerations beyond gravity, from the curvature of long arcs beyond noise; else 0.

    A deceleration common to all arcs on a table is known better than the curvature of each arc.
    """
    fits = fits.flying
    speed = np.linalg.norm(np.stack([fits.v_pre, fits.v_post], axis=1)[..., :2], axis=-1)
    moving = (speed > _MOVING) | (not on_table)  # a rest shows no friction
    long = moving & (fits.n_side >= _LONG_ARC_SAMPLES)
    if long.sum() < _MIN_ARCS:
        long = moving & (fits.n_side >= _MIN_ARC_SAMPLES)
    if long.sum() < _MIN_ARCS:
        return np.zeros(3)
    scatter = robust_std(fits.curvature[long]) ** 2
    noise = np.median(1.0 / fits.bow2[long], axis=0)[..., None] * sigma**2 * colour
    # the variance from a median has the relative error 2.3/√n; below a clear excess there is nothing to add
    clear = scatter > noise * (1.3 + 3.0 * 2.3 / np.sqrt(long.sum()))
    stray = np.sqrt(np.where(clear, scatter - noise, 0.0))
    if on_table:
        v = np.stack([fits.v_pre, fits.v_post], axis=1)[..., :2]
        along = -(fits.curvature[..., :2] * v).sum(-1) / np.maximum(speed, 1e-12)
        slowed = float(np.median(along[long]))
        if slowed > _CLEARLY * 1.25 * robust_std(along[long] - slowed) / np.sqrt(long.sum()):
            stray[:2] = np.maximum(stray[:2], slowed / np.sqrt(2.0))
    return stray


def estimate_spread(
    fits: ArcFits, k_g: float, assumed: np.ndarray, noise: NoiseEstimate, settings: ArcSettings
) -> float:
    """s in s, from the distance between free arcs beyond noise: miss/|Δv| is Rayleigh, 2 of 3 dimensions.

    `fits` of all detected impacts were made with s = 0 and the noise `assumed` (3,) in m, m, rad; `noise` is as
    estimated from them; `k_g` in m.
    """
    rescale = np.max(noise.used**2 * noise.colour / assumed**2)
    dv = np.linalg.norm((fits.v_post - fits.v_pre) * [1.0, 1.0, k_g], axis=1)
    good = (fits.n_side >= _MIN_ARC_SAMPLES).all(1) & fits.converged & (dv > settings.min_jump)
    good &= fits.miss < settings.meet_time * dv  # a larger miss means two hits
    if good.sum() < _MIN_ARCS:
        return 0.0
    noise2 = fits.miss_noise**2 * rescale
    # chi² with 2 dof has its median at 2 ln 2, with standard error 2/√n: without a clear excess s is 0
    typical = np.median(fits.chi2_meet[good]) / rescale
    if typical < _EXCESS * (2.0 * np.log(2.0) + 3.0 * 2.0 / np.sqrt(good.sum())):
        return 0.0
    excess = np.median((fits.miss[good] / dv[good]) ** 2) / (2.0 * np.log(2.0))
    return float(np.sqrt(max(excess - np.median(noise2[good] / dv[good] ** 2) / 2.0, 0.0)))


def fit_straightest(
    samples: Samples, at: np.ndarray, noise: NoiseEstimate, header: Header, settings: ArcSettings
) -> ArcFits:
    """Arc fits in which a bent arc is cut to half its samples if that makes it straight.

    A bent far end (a weak hit, the body coming to rest) must not spoil the velocity at the near end.  Bends are
    judged with the noise found in the data: a wrong header should not shorten every window.
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
    # any short arc is nearly straight: under gravity, a flight must also fall rather than rest
    straight = ~bent_still & (shorter.n_side >= settings.min_window)  # pyright: ignore[reportOperatorIssue, reportPossiblyUnboundVariable]
    cured = (size < whole) & straight & ((shorter.fall > 0) | (header.gravity == 0.0))  # pyright: ignore[reportPossiblyUnboundVariable]
    final = fit(at[rows], np.where(cured, size, whole))
    return fits.put(rows, final)


def noise_warnings(
    noise: NoiseEstimate, stated: np.ndarray, glitches: pd.DataFrame, settings: ArcSettings, falls: bool = True
) -> tuple[str, ...]:
    """Sentences for the user about noise and glitches (columns trial, t); `stated` (3,) is the header's noise.

    `falls`: whether there is gravity.
    """
    sentences = []
    units = {"x": "m", "y": "m", "theta": "rad"}
    for (name, unit), scatter, said, believed in zip(units.items(), noise.sigma, stated, noise.stated):
        ratio = scatter / said
        far = not 1.0 / settings.noise_ratio <= ratio <= settings.noise_ratio
        if np.isfinite(ratio) and (far or np.isnan(believed)):
            sentences.append(
                f"dataset.yaml states noise of {said:.3g} {unit} for {name}, but its samples scatter by {scatter:.3g} "
                f"{unit} about the arcs; the {'value of the arcs' if np.isnan(believed) else 'stated value'} is used. "
                "Correct it, or delete it to use the estimate."
            )
    if (noise.colour > 1.0).any():
        known = {name: f"{value:.2f}" for name, value in zip(units, noise.lag1) if np.isfinite(value)}
        correlations = f" (lag-one correlation of {', '.join(known)}: {', '.join(known.values())})" if known else ""
        sentences.append(
            f"The noise of neighbouring samples is correlated{correlations}; the covariances of the impacts are "
            "widened accordingly."
        )
    if noise.stray.any():
        sizes = ", ".join(f"{value:.2g} {unit}" for value, unit in zip(noise.stray, ("m/s²", "m/s²", "rad/s²")))
        usual = "air, guides, cables or a tilt" if falls else "friction with the table or a tilt"
        sentences.append(
            f"In flight the body has accelerations besides gravity, as from {usual} (one sigma for x, y and theta: "
            f"{sizes}); the fits of the flights allow for them."
        )
    if len(glitches):
        sentences.append(
            f"{plural(len(glitches), 'single sample')} in {plural(glitches['trial'].nunique(), 'trial')} treated as "
            "lost frames: off their neighbours, like tracking glitches."
        )
    return tuple(sentences)
