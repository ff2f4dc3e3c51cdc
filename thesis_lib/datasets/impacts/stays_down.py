"""Hits after which the body stays down, though its restitution at other hits would make it rebound visibly.

Every body that bounces comes to rest in the end, at hits too weak to see the flight after them.  A body with the
restitution ε that hits with v_n would fly for 2 ε v_n / g and rise by (ε v_n)²/(2 g).  Where samples would show that,
and it stays down all the same while faster hits rebound, restitution ends at a speed: the bounce threshold of a
simulator, putty, a wet floor.
"""

from dataclasses import dataclass

import numpy as np

FEWEST = 3  # hits that stay down
STRAY = 0.1  # rebounding hits below the speed, over those that stay down
RISE = 5.0  # sigmas of y
FLIGHT = 7  # sampling intervals
UNKNOWN = 0.3  # ε if no hit rebounds


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
        """What was seen, and what is like that."""
        seen = f"{self.count} hits at {self.lowest:.2g} to {self.highest:.2g} m/s, stays_down"
        expected = f"; {self.visible} of them would visibly rebound with the restitution of the others"
        why = "the bounce threshold of a simulator, putty, a wet or a yielding surface"
        if not self.rebound:
            return f"The body does not rebound: it stays down after each hit ({seen}), as with {why}."
        return (
            f"Below about {self.speed:.2g} m/s the body does not rebound ({seen}{expected}); above it does "
            f"({self.rebound} impacts, restitution {self.epsilon:.2g} in the median). A restitution that ends at a "
            f"speed is that of {why}."
        )


def stays_down(
    down: np.ndarray, v_pre: np.ndarray, v_post: np.ndarray, sigma: float, interval: float, gravity: float
) -> StaysDown | None:
    """What hits that stay down with the speeds `down` (m,) say beside those that rebound with `v_post` (n,) after
    `v_pre` (n,), all in m/s across the surface; None if they are too weak to see a rebound, or rebound as often.

    `sigma` is the noise of y in m, `interval` that between samples in s, `gravity` in m/s².
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
