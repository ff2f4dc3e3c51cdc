"""Impacts at walls, each turned into the frame of the wall that it hits, in which that wall is the floor.

Arcs are fitted in the plane as recorded; only the touch term depends on the wall (`arcs`).  Later tests and uses of the
impacts see them turned (`bodies.walls`).  The noise of x and y must therefore be equal, as for a camera.
"""

from dataclasses import replace

import numpy as np

from thesis_lib.bodies.walls import as_filmed, gaps, in_wall_frame, struck_wall, turns
from thesis_lib.datasets.flights.arcs import ArcFits
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings

TOUCH_SIGMA = 5.0


def on_floors(fits: ArcFits, header: Header) -> ArcFits:
    """The fits with poses, velocities and covariance in the frames of the walls; unchanged if there is one surface."""
    if header.surfaces is None or not len(fits):
        return fits
    walls = header.surfaces
    wall = struck_wall(walls, header.body.shape, fits.q, fits.v_post - fits.v_pre)
    R = turns(walls, wall)

    def turned(v: np.ndarray) -> np.ndarray:
        return (R @ v[:, :, None])[:, :, 0]

    blocks = np.zeros((len(fits), 9, 9))
    for i in range(0, 9, 3):
        blocks[:, i : i + 3, i : i + 3] = R
    cov = blocks @ fits.cov @ np.swapaxes(blocks, 1, 2)
    q = in_wall_frame(walls, wall, fits.q)
    return replace(fits, q=q, v_pre=turned(fits.v_pre), v_post=turned(fits.v_post), cov=cov, surface=wall)


def off_wall(fits: ArcFits, header: Header, settings: ArcSettings) -> np.ndarray:
    """Mask (n,) of hits clearly away from all walls; none on one surface.

    Fits are those in the frames of the walls.  The position of a wall is estimated by the median of the gaps at it.
    """
    n = len(fits)
    if header.surfaces is None or not n:
        return np.zeros(n, bool)
    seen = (fits.n_side >= 2).all(axis=1)
    near = seen & fits.at_wall
    wall, level = fits.surface, np.zeros(len(header.surfaces))
    for number in np.unique(wall[near]):
        level[number] = np.median(fits.gap[near & (wall == number)])
    far = np.maximum(settings.touch_limit, TOUCH_SIGMA * fits.gap_std)
    return seen & (~fits.at_wall | (np.minimum(fits.gap, fits.gap - level[wall]) > far))


def gravity_towards(fits: ArcFits, header: Header) -> np.ndarray:
    """Gravity (n,) in m/s² normal to the walls of n impacts in their frames, positive towards the wall."""
    if header.surfaces is None:
        return np.full(len(fits), header.gravity)
    return header.gravity * np.cos([wall.angle for wall in header.surfaces])[fits.surface]


def time_to_another_wall(fits: ArcFits, header: Header) -> np.ndarray:
    """Time (n,) in s between each of n impacts, in the frames of their walls, and a hit on the nearest other wall.

    Before or after the impact, whichever is sooner; ∞ on one surface.
    """
    walls, n = header.surfaces or (), len(fits)
    if len(walls) < 2 or not n:
        return np.full(n, np.inf)
    wall = fits.surface
    angle = np.array([one.angle for one in walls])[wall]
    apart = np.abs(
        gaps(walls, header.body.shape, np.column_stack([as_filmed(walls, wall, fits.q), fits.q[:, 2] + angle]))
    )
    normals = np.stack([one.n for one in walls])
    speeds = [
        np.abs(np.einsum("nij,ni->nj", turns(walls, wall), v)[:, :2] @ normals.T) for v in (fits.v_pre, fits.v_post)
    ]
    took = apart / np.maximum(np.maximum(*speeds), 1e-9)
    took[np.arange(n), wall] = np.inf
    return took.min(axis=1)
