"""Bullet as an impact model: its own contact, soft or rigid; bodies are simulated one after another in one world.

Bullet has two contact models.  The soft contact (`contactStiffness`, `contactDamping`) is a spring and a damper that
do not pull, with Coulomb friction on the slip after the step; it lasts the contact time T, in `STEPS` steps, with the
numbers from `thesis_lib/engines/parameters.py`.  The rigid contact (`restitution`), Bullet's default, ends after one
step of length T: it is Anitescu and Potra's law with Newton's restitution.

Bullet has no ellipse, and it keeps only about a hundred vertices of a hull, between which the contact point jumps.  In
each contact, a smooth body is therefore replaced by its osculating sphere at the point that lands; a corner is a small
sphere.  Bullet's drag, its contact slop of 10 µm and its penetration correction are switched off, as are its two
limits: no rebound below 0.2 m/s, and no rotation faster than 100 rad/s.
"""

import math

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.engines.engine import mechanics
from thesis_lib.engines.parameters import bullet_numbers
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.forces import SHARP
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

PACKAGE = "pybullet==3.2.7"
STEPS = 100  # in one contact time
FASTEST = 1e6  # m/s and rad/s
SURFACE = {"contactStiffness": 1e18, "contactDamping": 0.0}  # stiffness in N/m: Bullet's number for a rigid body
# m; paths of a rigid contact start this far below the surface and continue above it, so a contact without rebound ends
OVER = 1e-12


class BulletEngine:
    """n bodies on Bullet's surface; see `thesis_lib/engines/engine.py`."""

    name = "bullet"

    def __init__(
        self,
        body: Body,
        n: int,
        *,
        contact: CompliantContact,
        causes: HiddenCauses,
        gravity: float = 9.81,
        rigid: bool = False,
    ) -> None:
        """`rigid`: ε is Bullet's restitution, and T its time step.  UserError for causes that no engine models."""
        try:
            import pybullet  # noqa: F401  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise UserError(f"Bullet cannot be used here ({error}): pip install {PACKAGE}.") from error
        self.mechanics = mechanics(body, contact, causes, gravity, n)
        self.h = contact.contact_time if rigid else contact.dt
        self.rigid, self._radius = rigid, causes.corner_radius or SHARP
        # the spheres that represent sharp corners extend below the corners
        self._raised = SHARP if self.mechanics.vertices is not None and not causes.corner_radius else 0.0
        if self.mechanics.vertices is None:
            self._axes = self.mechanics.grown * np.array(body.shape.semi_axes)  # pyright: ignore[reportAttributeAccessIssue]

    def press(self, rows: np.ndarray, q: np.ndarray, v: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the paths q, v (m, steps + 1, 3) that start from the states (m, 3) of the centre of mass."""
        import pybullet  # pyright: ignore[reportMissingImports]

        paths = np.empty((2, len(rows), steps + 1, 3))
        paths[:, :, 0] = q, v
        world = pybullet.connect(pybullet.DIRECT)
        try:
            self._surface(pybullet, world)
            for i in range(len(rows)):
                body = self._body(pybullet, world, q[i, 2])
                start = [q[i, 0], q[i, 1] + self._raised, 0.0]
                pybullet.resetBasePositionAndOrientation(body, start, [0, 0, 0, 1], physicsClientId=world)
                pybullet.resetBaseVelocity(body, [v[i, 0], v[i, 1], 0.0], [0, 0, v[i, 2]], physicsClientId=world)
                for step in range(1, 2 if self.rigid else steps + 1):
                    pybullet.stepSimulation(physicsClientId=world)
                    place, turn = pybullet.getBasePositionAndOrientation(body, physicsClientId=world)
                    rate, spin = pybullet.getBaseVelocity(body, physicsClientId=world)
                    angle = q[i, 2] + 2.0 * math.atan2(turn[2], turn[3])
                    paths[0, i, step] = place[0], place[1] - self._raised, angle
                    paths[1, i, step] = rate[0], rate[1], spin[2]
                pybullet.removeBody(body, physicsClientId=world)
        finally:
            pybullet.disconnect(world)
        return self._flown(paths) if self.rigid else (paths[0], paths[1])

    def _flown(self, paths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the paths q, v of bodies that leave the surface with their velocities after one step."""
        q, v = paths
        v[:] = v[:, 1:2]
        q[:, 1:] = q[:, :1] + self.h * np.arange(1, q.shape[1])[:, None] * v[:, 1:]
        gap = self.mechanics.gap(q.reshape(-1, 3), np.zeros(q[..., 0].size), np.zeros(q[..., 0].size, int))
        gap = gap.reshape(q.shape[:2])
        q[:, 0, 1] -= gap[:, 0] + OVER
        q[:, 1:, 1] += np.maximum(OVER - gap[:, 1:], 0.0)
        return q, v

    def _surface(self, pybullet, world: int) -> None:
        """Create the plane, and set gravity and the options of Bullet's time step."""
        m = self.mechanics
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=[0, 1, 0], physicsClientId=world)
        height = [0, m.hidden.surface_height, 0]
        surface = pybullet.createMultiBody(0, plane, basePosition=height, physicsClientId=world)
        more = {} if self.rigid else SURFACE
        pybullet.changeDynamics(surface, -1, lateralFriction=1, restitution=1, **more, physicsClientId=world)
        pybullet.setGravity(*m.gravity, 0, physicsClientId=world)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.h, contactSlop=0, contactERP=0, restitutionVelocityThreshold=0, physicsClientId=world
        )

    def _body(self, pybullet, world: int, theta: float) -> int:
        """Create a body at the angle `theta` in rad, in unrotated axes; return its number in Bullet."""
        m, contact = self.mechanics, self.mechanics.contact
        if m.vertices is None:
            a, b = self._axes
            reach = np.hypot(a * np.sin(theta), b * np.cos(theta))
            radius = (a * b) ** 2 / reach**3  # of curvature
            centres = m.lowest_point(np.array([theta])) + [0.0, radius]
        else:
            cos, sin, radius = np.cos(theta), np.sin(theta), self._radius
            centres = m.vertices @ np.array([[cos, sin], [-sin, cos]])
        shape = pybullet.createCollisionShapeArray(
            shapeTypes=[pybullet.GEOM_SPHERE] * len(centres),
            radii=[radius] * len(centres),
            collisionFramePositions=np.column_stack([centres, np.zeros(len(centres))]).tolist(),
            physicsClientId=world,
        )
        body = pybullet.createMultiBody(m.mass, shape, physicsClientId=world)
        if self.rigid:
            numbers = {"restitution": contact.epsilon}
        else:
            soft = bullet_numbers(contact.mu, contact.epsilon, contact.contact_time, mass=m.mass, step=self.h)
            numbers = {"restitution": 0.0, "contactStiffness": soft.stiffness, "contactDamping": soft.damping}
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=contact.mu,
            localInertiaDiagonal=[m.inertia] * 3,
            linearDamping=0,
            angularDamping=0,
            maxJointVelocity=FASTEST,
            **numbers,
            physicsClientId=world,
        )
        return body
