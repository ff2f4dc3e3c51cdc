"""Engines under one name each, and states of impacts that they are asked about."""

from importlib.util import find_spec

import numpy as np
import pytest

from tests.simulate.falling import DISK, SQUARE
from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.engines.bullet_engine import PACKAGE, BulletEngine
from thesis_lib.engines.bullet_engine import STEPS as BULLET_STEPS
from thesis_lib.engines.drake_engine import DrakeEngine
from thesis_lib.engines.mujoco_engine import STEPS, MujocoEngine
from thesis_lib.simulate.mujoco.contact import MujocoContact
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

MASS = DISK.mass
ELLIPSE = Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=MASS, radius_of_gyration=0.019)
# scalene, its origin at the centroid
TRIANGLE = Body(
    shape=Polygon(vertices=((0.04, -0.018), (-0.01, 0.034), (-0.03, -0.016))), mass=MASS, radius_of_gyration=0.0205
)
BODIES = {"ellipse": ELLIPSE, "square": SQUARE, "triangle": TRIANGLE}
STEEP = 0.3  # rad from lying on a side: nearer, a second corner touches in the same contact
STILL = 1e-6  # m/s²: a gravity that maps of contact numbers leave out

bullet = pytest.mark.skipif(not find_spec("pybullet"), reason=f"Bullet is optional: pip install {PACKAGE}")
SOFT = ["mujoco", "drake", pytest.param("bullet", marks=bullet)]
ENGINES = [*SOFT, pytest.param("rigid", marks=bullet)]  # the last is Bullet's rigid contact


def of(name, body, n, *, causes=None, gravity=9.81, options=None, **contact):
    """An engine with a contact of these settings, 1 ms if they do not say; `options` are its own."""
    more = {"causes": causes or HiddenCauses(), "gravity": gravity} | (options or {})
    if name == "mujoco":
        return MujocoEngine(body, n, contact=MujocoContact(steps=STEPS, **contact), **more)
    if name == "drake":
        return DrakeEngine(body, n, contact=CompliantContact(**contact), **more)
    made = CompliantContact(steps=BULLET_STEPS, **contact)
    return BulletEngine(body, n, contact=made, rigid=name == "rigid", **more)


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


def distance(body, v, w):
    """Between velocities (n, 3), in the kinetic metric."""
    return np.sqrt((((v - w) * [1.0, 1.0, body.radius_of_gyration]) ** 2).sum(axis=1))
