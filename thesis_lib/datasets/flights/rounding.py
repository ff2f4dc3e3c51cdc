"""Reach of the rounding of samples around impacts, by a filter that smoothed them, a long contact, or a vibration.

The path has a corner at an impact.  A filter that smooths the samples rounds this corner, and so do a contact that
lasts several samples and a body that vibrates afterwards.  Rounded samples belong to neither flight, so the guard
(`lines`) must cover them.

A parabola is fitted to the samples of each side beyond a reach R.  Let e be the deviation of nearer samples from it,
divided by the noise and averaged over the samples whose |τ| lies between two `EDGES`.  Rounding moves samples along Δv
(divided by the noise: direction u), noise moves them in all directions alike.  So for each pair of edges

    F = (median of (e·u)² / m_1) / (median of (‖e‖² − (e·u)²) / m_2),    m_k: median of chi² with k dof

(upper quartiles instead of medians before impacts that only a flight precedes: a median filter moves every other
sample beside these.  Where samples move by less than `LEAST_MOVED` of Δv times a sampling interval, nothing is rounded:
any filter moves the nearest sample further, and the noise-free path of a point a tenth of a millimetre beside the
centre of mass sways)

is 1 without rounding, for noise of any size and colour common to all channels.  The parabola contains the acceleration
in flight.  F above `MATERIAL` by `CLEAR` standard errors indicates rounding; the guard ends one pair of edges after the
last such pair, because rounding fades out.  R grows until its outer half shows no rounding, and the guard is at least
the previous R: a parabola that starts further away shows less.
"""

import itertools
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import chi2, theilslopes

from thesis_lib.datasets.flights.arcs import ArcFits
from thesis_lib.datasets.flights.lines import sides_of, windows_around
from thesis_lib.datasets.flights.low_pass import LowPass
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.spread import robust_std

EDGES = np.array([0, 1, 2, 3, 4, 6, 8, 12, 16, 24])  # sampling intervals from the impact
_BEYOND = 32  # the edge after the last
REACHES = (3, 6, 12, 24)  # sampling intervals: R
NARROWEST = 0.01  # s, the least R: filters of motion capture reach further
FAR = 25  # samples beyond R at most; and at least
LEAST = 10
ENOUGH = 30  # flights that have such samples
# rounding of 0.7 sigma of a sample moves the velocity of a line through 25 by a fifth of its standard error
MATERIAL = 1.5
CLEAR = 3.0
LEAST_MOVED = 0.04  # a mean over three samples moves the nearest one by 0.16, a pivot that is 0.1 mm off by 0.01
_CONTACT = 1.5  # τ; contacts end before
LONGEST = 5e-3  # s; a guard for longer contacts must be seen in the samples
LEAST_SUNK, MOST_SUNK = 20, 400  # number of impacts for the dependence of sinking on speed
SUNK_ODD = 3.0  # robust standard deviations; impacts beyond do not count for the shape
_EXACT = 1e-2  # mean square of e below which samples have no noise
# Sides of an impact on which samples must be rounded.  After an impact a body may slide before it rolls, or hit again:
# then both sides must show a filter, or the side before impacts that only a flight precedes.
Seen = Literal["either", "both", "before"]


@dataclass(frozen=True)
class Kinks:
    """Impacts as corners of a path: the samples `at` (n,) before them, their instants `t` (n,) in s, the changes `dv`
    (n, 3) of the velocity, and whether they are `at_wall` (n,)."""

    at: np.ndarray
    t: np.ndarray
    dv: np.ndarray
    at_wall: np.ndarray


@dataclass(frozen=True)
class Rounding:
    """F between the `edges` (g + 1,) in s of |τ|, before and after the impacts: (g, 2), NaN with few flights."""

    edges: np.ndarray
    ratio: np.ndarray
    count: np.ndarray  # (g, 2) flights
    spread: float  # standard error of ln F times the root of the count
    seen: Seen
    moved: float  # shift of the nearest samples before impacts along Δv, over Δv times the interval

    @property
    def sides(self) -> np.ndarray:
        """Mask (g, 2) of the pairs of edges between which samples of a side are rounded."""
        # errors of the logarithm: with 30 flights F itself is far from normal
        limit = MATERIAL * np.exp(CLEAR * self.spread / np.sqrt(np.maximum(self.count, 1)))
        return np.nan_to_num(self.ratio) > limit

    @property
    def reach(self) -> float:
        """Time from an impact in s within which samples of either side, or of both, are rounded; 0 if none are."""
        if self.seen == "before":  # a path that sways deviates in places; a filter rounds from the hit on
            if not self.moved > LEAST_MOVED:
                return 0.0
            few = self.count[:, 0] < ENOUGH
            groups = np.flatnonzero(np.cumprod(few | self.sides[:, 0]) * ~few)
        else:
            groups = np.flatnonzero(self.sides.all(axis=1) if self.seen == "both" else self.sides.any(axis=1))
        return float(self.edges[groups[-1] + 1]) if len(groups) else 0.0

    @property
    def is_clear(self) -> bool:
        """Whether samples are rounded anywhere."""
        return bool(self.sides.any()) if self.seen != "before" else self.reach > 0.0


def sampling_interval(samples: Samples) -> float:
    """Median time in s between samples of a run; 1 without any."""
    step = np.diff(samples.t)[samples.run[1:] == samples.run[:-1]]
    return float(np.median(step)) if len(step) else 1.0


def guard_of(kinks: Kinks, samples: Samples, sigma: np.ndarray, settings: ArcSettings, seen: Seen = "either") -> float:
    """Time from an impact in s within which samples are rounded, extended to the next of `EDGES`; 0 if none are.

    `sigma` (3,) is the noise of x, y, θ in m, m, rad; `seen`: on which sides of impacts samples must be rounded.
    UserError: rounding may extend over whole flights, so that no sample is known to be free of it.
    """
    interval = sampling_interval(samples)
    widest, ends, clear = 0.0, True, False
    for reach in REACHES:
        found = rounding_within(reach, kinks, samples, sigma, settings, interval, seen)
        if (found.count.max(axis=1) < ENOUGH).all():
            break
        widest, clear = max(widest, found.reach), clear or found.is_clear
        ends = found.reach <= 0.5 * reach * interval
        if not ends:
            widest = max(widest, reach * interval)
        if ends and reach * interval > NARROWEST:
            break
    if not clear:
        return 0.0
    if not ends:
        raise UserError(
            f"Over {1e3 * widest:.2g} ms and more from an impact the samples leave the free flight: they are smoothed, "
            "or the body vibrates. Too few flights are long enough to see where that ends. Write the data without a "
            "filter, or with a higher cutoff frequency; fasten what is loose; or drop the body from higher up."
        )
    return interval * float(np.append(EDGES, _BEYOND)[(EDGES * interval < widest + 0.5 * interval).sum()])


def rounding_within(
    reach: int,
    kinks: Kinks,
    samples: Samples,
    sigma: np.ndarray,
    settings: ArcSettings,
    interval: float,
    seen: Seen = "either",
) -> Rounding:
    """Rounding nearer to the impacts than R, `reach` sampling intervals of `interval` (s)."""
    # without the effect of the air on the path
    windows = windows_around(replace(samples, q=samples.without_air()), kinks.at, reach + FAR + 1)
    t = kinks.t - windows.t_0
    tau = windows.t - t[:, None]
    beyond = sides_of(windows, t, settings.model_copy(update={"guard": reach * interval, "max_window": FAR}), None)
    near = sides_of(windows, t, settings.model_copy(update={"max_window": reach + FAR}), None) > 0
    near &= (kinks.at_wall[:, None] & (np.abs(tau) < reach * interval))[:, None] & (beyond.sum(2) >= LEAST)[..., None]

    # parabolas through the samples beyond R, in units of R
    basis = (tau / (reach * interval))[..., None] ** np.arange(3)
    normal = np.einsum("nsw,nwi,nwj->nsij", beyond, basis, basis)
    normal += (beyond.sum(2) < LEAST)[..., None, None] * np.eye(3)
    right = np.einsum("nsw,nwi,nwc->nsic", beyond, basis, windows.q)
    path = np.einsum("nwi,nsic->nswc", basis, np.linalg.solve(normal, right))
    e = (windows.q[:, None] - path) / sigma
    u = kinks.dv / sigma
    u /= np.maximum(np.sqrt((u**2).sum(1)), 1e-300)[:, None]

    share = 0.75 if seen == "before" else 0.5
    dof = 1 + int(samples.q[:, 2].any())  # across Δv; an angle that is not measured has no noise
    (usual, spread), (usual_across, spread_across) = _of_chi2(share, 1), _of_chi2(share, dof)
    edges = EDGES[reach >= EDGES] * interval
    ratio, count = np.full((len(edges) - 1, 2), np.nan), np.zeros((len(edges) - 1, 2))
    moved = np.nan
    for g, (low, high) in enumerate(itertools.pairwise(edges)):
        here = near & ((np.abs(tau) >= low) & (np.abs(tau) < high))[:, None]
        for side in (0, 1):
            number = here[:, side].sum(1)
            rows = number > 0
            count[g, side] = rows.sum()
            if count[g, side] < ENOUGH:
                continue
            mean = np.einsum("nw,nwc->nc", here[rows, side], e[rows, side]) / number[rows, None]
            along = (mean * u[rows]).sum(1) ** 2
            if side == 0 and np.isnan(moved):
                step = ((kinks.dv[rows] / sigma) ** 2).sum(1) * interval**2
                moved = float(np.sqrt(np.quantile(along / step, share)))
            across = np.quantile((mean**2).sum(1) - along, share) / usual_across
            ratio[g, side] = np.quantile(along, share) / usual / max(across, _EXACT)
    return Rounding(edges, ratio, count, float(np.hypot(spread, spread_across)), seen, moved)


def _of_chi2(share: float, dof: int) -> tuple[float, float]:
    """The quantile of chi² for the probability `share`, and √n times the standard error of its logarithm when it is
    estimated from n values."""
    value = float(chi2.ppf(share, dof))
    return value, float(np.sqrt(share * (1.0 - share)) / (chi2.pdf(value, dof) * value))


def rounding_warning(
    guard: float, usual: float, touch_time: float, interval: float, low_pass: LowPass | None
) -> tuple[str, ...]:
    """A sentence for the user if samples further from impacts than `usual` are left out; times in s.

    In a contact of duration T a body sinks in for τ = `touch_time` ≈ T/2, and samples of the contact lie within about
    1.2 τ of the instant where the arcs meet.  Smoothing rounds the corners of a path but does not make it sink in.
    """
    if guard <= usual:
        return ()
    # the last rounded samples are at least this far from the impact
    least = max(0.5 * guard - interval, usual)
    contacts = f"contacts of about {2e3 * touch_time:.2g} ms"
    if low_pass is not None:
        why = f"The samples were smoothed by {low_pass.text()}: corners at impacts are rounded more than by {contacts}."
    elif least > _CONTACT * touch_time:
        why = f"Corners at impacts are rounded further than {contacts} reach, as if the samples were smoothed."
    else:
        several = ", several samples" if touch_time > interval else ""
        why = f"Contacts last about {2e3 * touch_time:.2g} ms{several}."
    return (f"{why} Samples within {1e3 * guard:.3g} ms of an impact belong to no flight and are not used.",)


def contact_guard(sunk: np.ndarray, speed: np.ndarray, shape: np.ndarray | None = None) -> float:
    """Time in s from an impact within which samples may lie in its contact, from the contact time that arcs show.

    Due to contact time, arcs meet the lower the faster the impact, τ = −∂φ_n/∂(|v_n|/√K_nn); a wrong height does not do
    this.  At 250 Hz few contacts contain a sample: too few for `guard_of`, but they bias the mean of hundreds.
    0 with fewer than `LEAST_SUNK` impacts, or if τ is not clear of 0 (Theil-Sen, 95 %).

    `sunk` (n,) is −φ_n in m where the arcs meet, `speed` (n,) is |v_n|/√K_nn in m/s.  `shape` (n, c) are columns of
    the depth due to a wrong shape, by the point that touches (a rounded corner, say).  As points also differ in speed,
    only the residuals of both from these columns are used.
    """
    if len(sunk) < LEAST_SUNK + (0 if shape is None else shape.shape[1]):
        return 0.0
    if shape is not None:
        both = np.stack([sunk, speed], axis=1)
        both = both - shape @ np.linalg.lstsq(shape, both, rcond=None)[0]
        usual = np.abs(both[:, 0]) <= SUNK_ODD * robust_std(both[:, 0])
        fitted = np.linalg.lstsq(shape[usual], np.stack([sunk, speed], axis=1)[usual], rcond=None)[0]
        sunk, speed = (np.stack([sunk, speed], axis=1) - shape @ fitted).T
    some = np.unique(np.linspace(0, len(sunk) - 1, MOST_SUNK).astype(int))
    slope, _, low, _ = np.array(theilslopes(sunk[some], speed[some])).tolist()
    return min(_CONTACT * slope, LONGEST) if low > 0.0 else 0.0


def touch_time(fits: ArcFits, header: Header) -> float:
    """τ of contacts in s, from the depth below the surface where arcs meet, −φ_n √K_nn / |v_n|: median, at least 0."""
    sunk, speed = sunk_and_speed(fits, header)
    return max(float(np.median(sunk / speed)), 0.0) if len(sunk) else 0.0


def approach(fits: ArcFits, header: Header) -> tuple[np.ndarray, np.ndarray]:
    """Normal velocity v_n (n,) in m/s of the contact points before impact, negative on approach; and √K_nn (n,)."""
    r_x = header.body.shape.contact_point(fits.q[:, 2])[:, 0]
    return fits.v_pre[:, 1] + r_x * fits.v_pre[:, 2], np.sqrt(1.0 + (r_x / header.body.radius_of_gyration) ** 2)


def sunk_and_speed(fits: ArcFits, header: Header) -> tuple[np.ndarray, np.ndarray]:
    """Depth −φ_n (n,) in m and speed |v_n| / √K_nn (n,) in m/s of the impacts whose arcs are known."""
    v_n, root = approach(fits, header)
    rows = fits.converged & (fits.n_side >= 2).all(1) & (v_n != 0.0)
    return -fits.gap[rows], np.abs(v_n[rows]) / root[rows]
