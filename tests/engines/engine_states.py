"""States of impacts that engines are asked about."""

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon

MASS = 0.05
DISK = Body(shape=Disk(radius=0.03), mass=MASS, radius_of_gyration=0.02)
ELLIPSE = Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=MASS, radius_of_gyration=0.019)
SQUARE = Body(
    shape=Polygon(vertices=((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03))),
    mass=MASS,
    radius_of_gyration=0.0245,
)
# scalene, its origin at the centroid
TRIANGLE = Body(
    shape=Polygon(vertices=((0.04, -0.018), (-0.01, 0.034), (-0.03, -0.016))), mass=MASS, radius_of_gyration=0.0205
)
BODIES = {"ellipse": ELLIPSE, "square": SQUARE, "triangle": TRIANGLE}


def touching(body, n, seed=0, steep=0.0):
    """Poses and velocities (n, 3) of bodies that touch, none nearer to lying on a side than `steep` in rad."""
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-np.pi, np.pi, 20 * n)
    if steep and isinstance(body.shape, Polygon):
        corners = body.shape.corners
        side = np.roll(corners, -1, axis=0) - corners
        lies = np.arctan2(side[:, 1], side[:, 0])  # a side lies on the surface at minus its angle
        off = np.abs(np.angle(np.exp(1j * (theta[:, None] + lies))))
        theta = theta[off.min(axis=1) > steep]
    theta = theta[:n]
    v = np.column_stack([rng.uniform(-1.2, 1.2, n), rng.uniform(-3.0, -1.5, n), rng.uniform(-8.0, 8.0, n)])
    r = body.shape.contact_point(theta)
    return np.column_stack([rng.uniform(-0.1, 0.1, n), -r[:, 1], theta]), v
