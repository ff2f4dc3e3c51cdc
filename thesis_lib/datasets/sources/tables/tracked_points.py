"""Points of a body that a video tracker follows (DeepLabCut, Lightning Pose, SLEAP), as its pose in the picture.

A point z_j = u_j + i v_j of a rigid body is p + c_j exp(iθ), with c_j its place in the body, p and θ the pose:

    θ = arg Σ_j (c_j − c̄)* (z_j − z̄),    p = z̄ − c̄ exp(iθ)

over the points j that are seen (bars: their means; Horn 1987, doi:10.1364/JOSAA.4.000629, in the plane).  The c_j are
means over the frames in which all are seen; their own mean is the origin, and the first two give the direction θ.
"""

from collections.abc import Collection, Sequence

import numpy as np

SURE = ("likelihood", "score")  # columns of DeepLabCut and SLEAP beside the x and y of a point
LIKELY = 0.6  # likelihood from which DeepLabCut itself takes a point as seen (pcutoff)


def sureness(point: str, columns: Collection[str]) -> str | None:
    """The column that says how sure a point is, if there is one."""
    return next((f"{point}.{word}" for word in SURE if f"{point}.{word}" in columns), None)


def points_of(columns: Sequence[str]) -> tuple[str, ...]:
    """The points among columns named POINT.x, POINT.y, POINT.likelihood."""
    names = [name[:-2] for name in columns if name.endswith(".x")]
    return tuple(name for name in names if f"{name}.y" in columns and sureness(name, columns) is not None)


def pose_of_points(z: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Place p (n, 2) and angle θ (n,) of a body with points z (n, m), complex and NaN where not seen.

    Also how far the points stray from a rigid body, rms over its size.  A pose takes two points, and a single point
    has no angle (NaN).  ValueError if no frame shows all points.
    """
    if z.shape[1] == 1:
        return np.column_stack([np.real(z[:, 0]), np.imag(z[:, 0])]), np.full(len(z), np.nan), 0.0
    whole = z[np.isfinite(z).all(axis=1)]
    if len(whole) == 0:
        raise ValueError("no frame shows all points")
    whole = whole - whole.mean(axis=1, keepdims=True)
    turn = np.angle(np.sum(whole[0].conj() * whole, axis=1))
    c = np.mean(whole * np.exp(-1j * turn)[:, None], axis=0)
    c = c * np.exp(-1j * np.angle(c[1] - c[0]))

    seen = np.isfinite(z)
    count = np.maximum(seen.sum(axis=1), 1)
    c_mean, z_mean = (seen * c).sum(axis=1) / count, np.where(seen, z, 0.0).sum(axis=1) / count
    arms = np.where(seen, (c - c_mean[:, None]).conj() * (np.where(seen, z, 0.0) - z_mean[:, None]), 0.0)
    theta = np.angle(arms.sum(axis=1))
    p = z_mean - c_mean * np.exp(1j * theta)
    few = seen.sum(axis=1) < 2
    p[few], theta[few] = np.nan, np.nan
    off = np.abs(z - p[:, None] - c * np.exp(1j * theta)[:, None])
    size = float(np.sqrt(np.mean(np.abs(c) ** 2)))
    place = np.column_stack([np.real(p), np.imag(p)])
    return place, theta, float(np.sqrt(np.nanmean(off**2))) / size if size > 0.0 else np.inf
