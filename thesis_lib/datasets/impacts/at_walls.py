"""Impacts at walls, in the frame of the wall that each one hits, where they are impacts on a floor.

Arcs are fitted in the plane as it was filmed; only the touch asks for the wall (`arcs`).  What judges and uses the
impacts afterwards sees them turned (`bodies.walls`).  The noise of x and y must then be one, as that of a camera is.
"""

from dataclasses import replace

import numpy as np

from thesis_lib.bodies.walls import in_wall_frame, struck_wall, turns
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.impacts.arcs import ArcFits


def on_floors(fits: ArcFits, header: Header) -> ArcFits:
    """The fits with poses, velocities and their covariance in the frames of the walls; as they are on one surface."""
    if header.surfaces is None or not len(fits):
        return fits
    walls = header.surfaces
    wall = walls_hit(fits, header)
    R = turns(walls, wall)

    def turned(v: np.ndarray) -> np.ndarray:
        return (R @ v[:, :, None])[:, :, 0]

    blocks = np.zeros((len(fits), 9, 9))
    for i in range(0, 9, 3):
        blocks[:, i : i + 3, i : i + 3] = R
    cov = blocks @ fits.cov @ np.swapaxes(blocks, 1, 2)
    q = in_wall_frame(walls, wall, fits.q)
    return replace(fits, q=q, v_pre=turned(fits.v_pre), v_post=turned(fits.v_post), cov=cov)


def walls_hit(fits: ArcFits, header: Header) -> np.ndarray:
    """Number (n,) of the wall that each impact hit; 0 on one surface."""
    if header.surfaces is None:
        return np.zeros(len(fits), int)
    return struck_wall(header.surfaces, header.body.shape, fits.q, fits.v_post - fits.v_pre)
