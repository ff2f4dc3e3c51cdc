"""Hits after which the body stays down, though its restitution at other hits would make it rebound visibly.

Every body that bounces comes to rest in the end, at hits too weak to see the flight after them.  A body with the
restitution ε that hits with v_n would fly for 2 ε v_n / g and rise by (ε v_n)²/(2 g).  If samples would show this, but
the body stays down while faster hits rebound, then restitution vanishes below some speed: the bounce threshold of a
simulator, putty, a wet floor.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.datasets.flights.lines import lines_through, rank, windows_around
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples

FEWEST = 3  # hits that stay down
STRAY = 0.1  # rebounding hits below the speed, over hits that stay down
RISE = 5.0  # sigmas of y
FLIGHT = 7  # sampling intervals
UNKNOWN = 0.3  # ε if no hit rebounds
OFF = 3  # samples by which the detector may miss the hit: it expects two flights
FALLS = 9.0  # chi² (3 sigmas) by which free fall before, and rest after, must beat the alternative
AT_SURFACE = 5.0  # sigmas beyond touch_limit


@dataclass(frozen=True)
class StaysDown:
    """Speed in m/s below which hits do not rebound, the lowest and highest of the `count` that stay down, how many of
    these would rebound visibly, how many rebound, and with which ε in the median (NaN if none does)."""

    speed: float
    lowest: float
    highest: float
    count: int
    visible: int
    rebound: int
    epsilon: float

    def sentence(self) -> str:
        """Sentence on hits that stay down, and on known causes of such hits."""
        seen = f"{self.count} hits at {self.lowest:.2g} to {self.highest:.2g} m/s, stays_down"
        expected = f"; {self.visible} of them would visibly rebound with the restitution of the others"
        why = "the bounce threshold of a simulator, putty, a wet or a yielding surface"
        if not self.rebound:
            return f"The body does not rebound: it stays down after each hit ({seen}), as with {why}."
        return (
            f"Below about {self.speed:.2g} m/s the body does not rebound ({seen}{expected}); above it does "
            f"({self.rebound} impacts, restitution {self.epsilon:.2g} in the median). Restitution that ends at a "
            f"speed is typical of {why}."
        )


def stays_down(
    down: np.ndarray, v_pre: np.ndarray, v_post: np.ndarray, sigma: float, interval: float, gravity: float
) -> StaysDown | None:
    """Comparison of hits that stay down with the speeds `down` (m,) and hits that rebound with `v_post` (n,) after
    `v_pre` (n,), all in m/s across the surface; None if hits are too weak to see a rebound, or rebound as often.

    `sigma` is the noise of y in m, `interval` the sampling interval in s, `gravity` in m/s².
    """
    down, v_pre, v_post = np.abs(down), np.abs(v_pre), np.abs(v_post)
    bounced = v_pre > 0.0
    v_pre, v_post = v_pre[bounced], v_post[bounced]
    epsilon = float(np.median(v_post / v_pre)) if len(v_pre) else np.nan
    after = (UNKNOWN if np.isnan(epsilon) else epsilon) * down
    visible = np.sort(down[(2.0 * after > FLIGHT * interval * gravity) & (after**2 > 2.0 * gravity * RISE * sigma)])
    if len(visible) < FEWEST:
        return None
    below = np.array([np.sum(v_pre <= speed) for speed in visible])
    count = np.arange(1, len(visible) + 1)
    best = int(np.argmax(count - below / STRAY))
    if count[best] < FEWEST or below[best] > STRAY * count[best]:
        return None
    highest, above = float(visible[best]), v_pre[v_pre > visible[best]]
    speed = 0.5 * (highest + float(above.min())) if len(above) else highest
    down = down[down <= highest]
    return StaysDown(speed, float(down.min()), highest, len(down), int(count[best]), len(above), epsilon)


def landing_speeds(
    samples: Samples, at: np.ndarray, sigma: np.ndarray, header: Header, settings: ArcSettings
) -> np.ndarray:
    """Downward speed (n,) in m/s with which the body lands, if it flies before a hit and lies after it; else NaN.
    Hits happen after the samples `at` (n,); `sigma` (3,) is the noise in m, m, rad.
    """
    landed = np.full(len(at), np.nan)
    if header.surfaces is not None or header.gravity == 0.0 or not len(at):
        return landed
    windows = windows_around(samples, at, settings.max_window)
    q = windows.q + windows.q_0[:, None]
    r = header.body.shape.contact_point(q[..., 2])
    gap = q[..., 1] + r[..., 1] - header.surface.height
    near = np.abs(gap) < settings.touch_limit + AT_SURFACE * np.hypot(sigma[1], r[..., 0] * sigma[2])
    falling = windows.q[..., 1] + 0.5 * header.gravity * windows.t**2
    paths = np.stack([falling, windows.q[..., 1], windows.q[..., 2]], -1)
    number = np.arange(windows.t.shape[1]) - windows.t.shape[1] // 2
    least, best = np.full(len(at), np.inf), np.zeros((len(at), 2))  # misfit; y and v_y of the fall at t_0
    for shift in range(-OFF, OFF + 1):
        side = np.stack([windows.usable & (number < shift - 1), windows.usable & (number >= shift + 1)], 1) * 1.0
        side *= rank(side) <= side.sum(2, keepdims=True) - 2.0  # the outermost may lie in a neighbouring contact
        lines = lines_through(side, windows.t, paths)
        chi2 = ((lines.residual * side[..., None]) ** 2).sum(2) / sigma[[1, 1, 2]] ** 2
        fits_well = np.stack([chi2[:, 0, 0], chi2[:, 1, 1]], 1) / np.maximum(lines.count - 2.0, 1.0)
        good = (lines.count >= settings.min_window).all(1) & (fits_well < settings.not_ballistic).all(1)
        good &= (chi2[:, 0, 1] - chi2[:, 0, 0] > FALLS) & (chi2[:, 1, 0] - chi2[:, 1, 1] > FALLS)
        good &= (near | (side[:, 1] == 0.0)).all(1) & (fits_well.sum(1) < least)
        least[good] = fits_well.sum(1)[good]
        best[good] = np.stack([lines.value[:, 0, 0], lines.slope[:, 0, 0]], 1)[good]
    rows = np.flatnonzero(np.isfinite(least))
    r_0 = header.body.shape.contact_point(windows.q_0[rows, 2])
    y, v_y = best[rows].T
    fallen = 2.0 * header.gravity * (y + windows.q_0[rows, 1] + r_0[:, 1] - header.surface.height)
    landed[rows] = np.sqrt(np.maximum(v_y**2 + fallen, 0.0))
    return landed
