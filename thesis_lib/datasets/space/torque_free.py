"""Facts from flights in space alone: where bodies fall, and whether angular momentum is kept.

    L = R G Rᵀ ω = const,    u_f = Σ |L − its mean|² / Σ |L|²      over a flight f

A quaternion whose scalar stands elsewhere, or whose turns are reversed, turns as smoothly, but not as a free body does:
u, the middle one of all flights, is then a hundredth to tenths.  Of a body with three equal moments, or one that turns
about a fixed axis, flights cannot say it.

| on paper | in code | unit  | shape  | axes                                                              |
|----------|---------|-------|--------|-------------------------------------------------------------------|
| R        |         |       |        | tracked frame into the recording's                                |
| G        | `G`     | m²    | (3, 3) | inertia per mass, along the axes of the tracked frame             |
| ω        |         | rad/s | (n, 3) | recording                                                         |
"""

from collections.abc import Sequence

import numpy as np

from thesis_lib.datasets.space.flights import NEAR_G, Track, find_flights, follow, inner, smoothed_turning
from thesis_lib.datasets.space.motion import Motion, turning

SCALES = {"": 1.0, "mm": 1e-3, "cm": 1e-2}  # units that lengths may have been in after all
SLOW = 1.0  # rad/s, rms: slower turning says nothing
UNSTEADY = 0.005  # u of a free body is far below, by its noise alone; a box of 5 : 4 : 3 read wrongly has 0.01 and more
BETTER = 0.1  # u of another reading over that of the stated one, which makes it the likely one


def falling(t: np.ndarray, position: np.ndarray, gravity: float) -> tuple[str, np.ndarray, int] | None:
    """The unit of length, the direction (3,) and the number of flights of what falls by `gravity` (m/s²) anywhere.

    Positions (n, 3) at rising times t (n,) in s; None if nothing falls so.
    """
    for unit, scale in SCALES.items():
        track = follow(t, scale * position, gravity)
        size = np.linalg.norm(track.a, axis=1)
        with np.errstate(invalid="ignore"):
            free = track.smooth & (np.abs(size - gravity) < NEAR_G * gravity)
        if not free.any():
            continue
        middle = np.median(track.a[free], axis=0)
        down = middle / max(float(np.linalg.norm(middle)), 1e-9)
        if number := len(find_flights(track, gravity * down)):
            return unit, down, number
    return None


def unsteadiness(motion: Motion, track: Track, flights: Sequence[slice], G: np.ndarray) -> float:
    """u of the motion as it is read, see above; NaN if the body hardly turns, or no sample has an orientation."""
    from scipy.spatial.transform import Rotation

    turns = turning(motion.quaternion)
    R = Rotation.from_quat(motion.quaternion).as_matrix()
    tensor = R @ G @ R.swapaxes(1, 2)
    middle = 0.5 * (tensor[1:] + tensor[:-1])
    L = smoothed_turning(np.einsum("nij,nj->ni", middle, turns), motion.t, track.half)
    shares = []
    for flight in flights:
        own = L[inner(flight, track)]
        own = own[np.isfinite(own).all(axis=1)]
        if len(own) > 2 and np.mean(np.sum(own**2, axis=1)) > (np.trace(G) / 3.0 * SLOW) ** 2:
            shares.append(float(np.sum((own - own.mean(axis=0)) ** 2) / np.sum(own**2)))
    return float(np.median(shares)) if shares else float("nan")


def better_reading(motion: Motion, track: Track, flights: Sequence[slice], G: np.ndarray) -> str:
    """The one of the motion's other readings as which it turns freely, where it does not as it is read; else ""."""
    stated = unsteadiness(motion, track, flights, G)
    if not stated > UNSTEADY:
        return ""
    others = {}
    for name, read in motion.readings.items():
        other = Motion(motion.body, motion.source, motion.t, motion.position, read())
        others[name] = unsteadiness(other, track, flights, G)
    best = min(others, key=lambda name: np.nan_to_num(others[name], nan=np.inf), default="")
    return best if best and others[best] < BETTER * stated else ""
