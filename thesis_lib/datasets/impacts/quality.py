"""Quality tests of impacts: those that cannot be measured are left out, those that look unphysical are flagged.

Left out, with a reason (the first that applies):

| reason             | meaning                                                                                      |
|--------------------|----------------------------------------------------------------------------------------------|
| `off_wall`         | no wall is near: another body, or a hand, was hit                                            |
| `lost_frames`      | a long gap in time leaves too few samples on a side, or holds the impact itself              |
| `second_hit`       | another hit too close: few samples between them, or arcs and samples that fit only two hits, |
|                    | or a second corner, or another wall, that touches at once                                    |
| `window_too_short` | the trial, or a rest on a table, starts or ends too close to the impact                      |
| `stays_down`       | free flight before, rest or sliding on the surface after: no rebound                         |
| `not_ballistic`    | no free flight on a side (held, resting, rolling, a bad track), or arcs that never meet      |
| `no_approach`      | the contact point does not approach the surface: rest or rolling, no impact                  |

Flagged (names joined by ';') and kept, because they are the evidence of what a model lacks:

| flag            | meaning                                                                             |
|-----------------|-------------------------------------------------------------------------------------|
| `energy`        | contact-space energy grows: α = v_C+ᵀ M_C v_C+ / v_C−ᵀ M_C v_C− > 1                 |
| `cone`          | |P_t| > mu_max P_n                                                                  |
| `compression`   | v_n+ < 0: the impulse lies below the line of maximum compression                    |
| `arc_deviation` | an arc deviates from the parabola by more than noise explains, though not grossly   |
| `no_touch`      | the gap at impact is not 0 within 5 sigma and 2 mm, nor due to the contact time     |

    v_C = J v,   J = [[1, 0, −r_y], [0, 1, r_x]],   M_C = (J M⁻¹ Jᵀ)⁻¹,   M = diag(m, m, m k²),   P = M_C J Δv

Sources: thesis sections 3.3.1 and 3.4; mu_max and the compression test are in the authors' published code.
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.datasets.flights.arcs import ArcFits, is_bent
from thesis_lib.datasets.flights.rounding import approach, touch_time
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.format.samples import ArcSettings, Samples, long_gaps
from thesis_lib.datasets.impacts.at_walls import TOUCH_SIGMA, gravity_towards, off_wall, time_to_another_wall
from thesis_lib.datasets.impacts.stays_down import landing_speeds
from thesis_lib.mechanics.contact import contact_at
from thesis_lib.mechanics.space import PLANE

REASONS = (
    *("off_wall", "lost_frames", "second_hit", "window_too_short"),
    *("stays_down", "not_ballistic", "no_approach"),
)
FLAGS = ("energy", "cone", "compression", "arc_deviation", "no_touch")
THESIS_FLAGS = ("energy", "cone", "compression")
_APPROACH_SIGMA = 3.0  # 1 in 700 motionless contacts would pass
_LONGEST_TOUCH = 5e-3  # s; τ of a contact of 10 ms, as of foam rubber
_RESTITUTIONS = (0.2, 0.9)
_ONE_PLACE = 0.2  # radii of gyration between two contact points
_ROUNDING = 1e-9  # an impact without losses (α = 1) must not be flagged by the last digit


@dataclass(frozen=True)
class ContactMeasures:
    """Measured impact in contact space."""

    v_c_pre: np.ndarray  # v_c_pre, v_c_post: (n, 2) contact velocity (v_t, v_n), m/s
    v_c_post: np.ndarray
    impulse: np.ndarray  # (n, 2) P = (P_t, P_n), N s (per kg if the mass is unknown)
    alpha: np.ndarray  # (n,) energy after over before, in contact space


def contact_measures(impacts: Impacts) -> ContactMeasures:
    """Contact velocities, impulse and energy ratio."""
    m, r = impacts.mass, impacts.r.T
    pre, post = (
        contact_at(PLANE, v.T[:2], v.T[2:], r, 1.0 / (m * impacts.k_g**2), 1.0 / m)
        for v in (impacts.v_pre, impacts.v_post)
    )
    before, after = pre.energy(*pre.v), pre.energy(*post.v)
    alpha = np.divide(after, before, out=np.full(len(before), np.inf), where=before > 0)
    v_pre, v_post, impulse = (np.stack(pair, axis=1) for pair in (pre.v, post.v, pre.impulse_to(*post.v)))
    return ContactMeasures(v_pre, v_post, impulse, alpha)


def flag_physics(impacts: Impacts, mu_max: float = 0.35) -> Impacts:
    """The impacts with the flags `energy`, `cone` and `compression` added where these tests fail."""
    c = contact_measures(impacts)
    p_t, p_n = c.impulse.T
    failed = {
        "energy": c.alpha > 1.0 + _ROUNDING,
        "cone": np.abs(p_t) > mu_max * p_n,
        "compression": c.v_c_post[:, 1] < 0,
    }
    return replace(impacts, flags=_add_flags(impacts.flags, failed))


def has_flag(impacts: Impacts, *names: str) -> np.ndarray:
    """Mask (n,) of impacts with any of the named flags."""
    return np.any([has_flag_text(impacts.flags, name) for name in names], axis=0)


def thesis_filter(impacts: Impacts) -> np.ndarray:
    """Mask (n,) of the impacts that the thesis keeps: no energy, cone or compression flag."""
    return ~has_flag(impacts, *THESIS_FLAGS)


def assess_arcs(
    fits: ArcFits, samples: Samples, at: np.ndarray, sigma: np.ndarray, header: Header, settings: ArcSettings
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Reason ('' = usable), detail and flags, each (n,) text, of n fitted impacts, and the speeds (n,) in m/s at
    which the body hits and stays down, else NaN; `at` (n,) are the detected samples before, `sigma` (3,) is the noise.
    """
    n = len(fits)
    reason, detail = np.full(n, "", object), np.full(n, "", object)

    def leave_out(mask: np.ndarray, name: str, text: np.ndarray | str) -> None:
        mask = mask & (reason == "")
        reason[mask] = name
        detail[mask] = np.broadcast_to(text, n)[mask]

    sides = _text(fits.n_side[:, 0]) + " samples before, " + _text(fits.n_side[:, 1]) + " after"
    short = (fits.n_side < settings.min_window).any(1)
    away = off_wall(fits, header, settings)
    leave_out(away, "off_wall", "the nearest wall is " + _text(1e3 * fits.gap) + " mm away")
    gap = long_gaps(samples.trial, samples.t, header, settings)
    leave_out(short & _lost_near(fits, samples, gap, settings), "lost_frames", sides)
    leave_out(gap[fits.at], "lost_frames", "the gap holds the impact")
    leave_out(short & _hit_near(fits, samples, settings), "second_hit", sides)
    leave_out(short, "window_too_short", sides)  # pyright: ignore[reportArgumentType]

    worst, beyond = np.nan_to_num(fits.reduced).max(1), np.nan_to_num(fits.chi2_rest).max(1)
    k_g = header.body.radius_of_gyration
    dv = np.linalg.norm((fits.v_post - fits.v_pre) * [1.0, 1.0, k_g], axis=1)
    allowed = settings.meet_time * dv
    # A second hit inside the first samples spoils only those; an arc that is bad beyond them is not a flight.
    stray = (fits.chi2_near > settings.meet_sigma**2) & (fits.near > allowed)
    missing = (fits.chi2_meet > settings.meet_sigma**2) & (fits.miss > allowed)
    bad_arc = "reduced chi² of an arc is "
    leave_out(beyond > settings.not_ballistic, "not_ballistic", bad_arc + _text(beyond))
    leave_out(fits.resting, "not_ballistic", "the body does not fall on one side")
    leave_out(stray, "second_hit", "samples beside the impact are off by " + _text(1e3 * fits.near) + " mm")
    leave_out(worst > settings.not_ballistic, "not_ballistic", bad_arc + _text(worst))
    leave_out(missing, "second_hit", "the arcs miss each other by " + _text(1e3 * fits.miss) + " mm")
    leave_out(~fits.converged, "not_ballistic", "the arcs do not meet near the detected instant")
    wait = _second_corner(fits, header)
    leave_out(wait < settings.double_hit, "second_hit", "the next corner hits after " + _text(1e3 * wait) + " ms")
    wait = time_to_another_wall(fits, header)
    unseen = np.maximum(samples.t[fits.at + 1] - samples.t[fits.at], settings.double_hit)
    leave_out(wait < unseen, "second_hit", "another wall is " + _text(1e3 * wait) + " ms away")

    v_n, _ = approach(fits, header)
    row = np.zeros((n, 9))
    row[:, 4], row[:, 5] = 1.0, header.body.shape.contact_point(fits.q[:, 2])[:, 0]
    v_n_std = np.sqrt(np.einsum("ni,nij,nj->n", row, fits.cov, row))
    leave_out(v_n > -_APPROACH_SIGMA * v_n_std, "no_approach", "v_n is " + _text(v_n) + " m/s before")

    far = np.maximum(TOUCH_SIGMA * fits.gap_std, settings.touch_limit)
    failed = {
        "arc_deviation": is_bent(fits, sigma, settings.arc_deviation).any(1),
        "no_touch": (np.abs(fits.gap) > far) & (np.abs(fits.gap + _sunk_in(fits, header)) > far),
    }
    # two arcs do not describe a body that rests after the hit: the reason is then `not_ballistic` so far
    speed = landing_speeds(samples, at, sigma, header, settings)
    rests = (reason == "not_ballistic") & np.isfinite(speed)
    reason[rests], detail[rests] = "stays_down", ("hits with " + _text(speed) + " m/s and does not rebound")[rests]
    return reason, detail, _add_flags(np.full(n, "", object), failed), np.where(rests, speed, np.nan)


def _sunk_in(fits: ArcFits, header: Header) -> np.ndarray:
    """Depth (n,) in m below the surface at which arcs meet because contacts take time: τ |v_n| / √K_nn.

    τ in s is the same for all, from the median of the gaps; 0 if another height of the surface explains them
    better.
    """
    v_n, root = approach(fits, header)
    sunk = min(touch_time(fits, header), _LONGEST_TOUCH) * np.abs(v_n) / root
    known = np.isfinite(fits.gap) & np.isfinite(sunk)
    if not known.any():
        return np.zeros_like(sunk)
    gap = fits.gap[known]
    by_time, by_height = np.median(np.abs(gap + sunk[known])), np.median(np.abs(gap - np.median(gap)))
    return sunk if by_time < by_height else np.zeros_like(sunk)


def _second_corner(fits: ArcFits, header: Header) -> np.ndarray:
    """Time (n,) in s from the impact of a polygon's lowest corner to that of the next corner; ∞ for other shapes.

    From the state before the impact and impulses without friction: the longer time of low and high restitution.
    """
    wait = np.full(len(fits), np.inf)
    if not isinstance(header.body.shape, Polygon):
        return wait
    corners = np.asarray(header.body.shape.vertices)
    cos, sin = np.cos(fits.q[:, 2])[:, None], np.sin(fits.q[:, 2])[:, None]
    r_x, r_y = cos * corners[:, 0] - sin * corners[:, 1], sin * corners[:, 0] + cos * corners[:, 1]
    rows, lowest = np.arange(len(fits)), r_y.argmin(axis=1)
    height, lever = r_y - r_y[rows, lowest][:, None], r_x[rows, lowest][:, None]
    v_n = fits.v_pre[:, 1:2] + r_x * fits.v_pre[:, 2:3]
    k2, g = header.body.radius_of_gyration**2, gravity_towards(fits, header)[:, None]
    last = np.zeros(len(fits))
    for epsilon in _RESTITUTIONS:
        c_n = -(1.0 + epsilon) * v_n[rows, lowest][:, None] / (1.0 + lever**2 / k2)
        after = v_n + c_n * (1.0 + lever * r_x / k2)
        # where nothing pulls a corner down, it comes down by itself or not at all
        by_itself = np.where(after < 0.0, -height / np.where(after < 0.0, after, -1.0), np.inf)
        pulled = (after + np.sqrt(np.maximum(after**2 + 2.0 * g * height, 0.0))) / np.where(g > 0.0, g, 1.0)
        fall = np.where(g > 0.0, pulled, by_itself)
        # vertices side by side (a rounded corner drawn as a polygon) are one place
        fall[np.abs(r_x - lever) < _ONE_PLACE * header.body.radius_of_gyration] = np.inf
        last = np.maximum(last, fall.min(axis=1))
    return last


def _lost_near(fits: ArcFits, samples: Samples, gap_after: np.ndarray, settings: ArcSettings) -> np.ndarray:
    """Mask (n,): a gap in time, after the samples `gap_after` (N − 1,), within min_window samples of the impact."""
    count = np.r_[0, np.cumsum(gap_after), gap_after.sum()]
    low = np.maximum(fits.at - settings.min_window, 0)
    high = np.minimum(fits.at + settings.min_window + 1, len(samples))
    return count[high] > count[low]


def _hit_near(fits: ArcFits, samples: Samples, settings: ArcSettings) -> np.ndarray:
    """Mask (n,): another detected hit of the same trial within min_window samples (and one for the guard)."""
    close = np.diff(fits.at) <= settings.min_window + 1
    close &= samples.trial[fits.at[1:]] == samples.trial[fits.at[:-1]]
    return np.r_[False, close][: len(fits)] | np.r_[close, False][: len(fits)]


def has_flag_text(flags: np.ndarray, name: str) -> np.ndarray:
    """Mask (n,) of the ';'-joined texts (n,) that contain `name`."""
    padded = np.char.add(np.char.add(";", flags.astype(str)), ";")
    return np.char.find(padded, f";{name};") >= 0


def _add_flags(flags: np.ndarray, failed: dict[str, np.ndarray]) -> np.ndarray:
    flags = np.asarray(flags, object).copy()
    for name, mask in failed.items():
        new = mask & ~has_flag_text(flags, name)
        flags[new] = np.where(flags[new] == "", name, flags[new] + f";{name}")
    return flags


def _text(values: np.ndarray) -> np.ndarray:
    """Numbers as short text (n,), an object array that can be added to text."""
    return np.array([f"{value:.3g}" for value in values], object)
