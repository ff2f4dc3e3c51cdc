"""Two-link arm that pushes a disk over the ground (thesis figure 2-1): dynamics from Drake, contacts in closed form.

Coordinates q = (q_1, q_2, x, y, θ): angle of link 1 to the horizontal, of link 2 to link 1, and the pose of the disk.
Gravity acts along -y, the ground is y = 0.  For each contact pair the normal n points to the disk, and the tangent is
t = (n_y, -n_x):

    arm:     C is the point of link 2 (a segment without thickness) nearest to the disk's centre P,
             φ = |P - C| - R,  n = (P - C) / |P - C|
             J_n = [-n'∂C/∂q_1, -n'∂C/∂q_2, n_x, n_y, 0],      J_t = [-t'∂C/∂q_1, -t'∂C/∂q_2, t_x, t_y, R]
    ground:  φ = y - R,  n = (0, 1),      J_n = [0, 0, 0, 1, 0],      J_t = [0, 0, 1, 0, R]

C moves along the link as the disk rolls on it, but J_n = ∂φ/∂q still holds, since |P - C| is minimal at C.
The force on the disk is c_n n + c_t t, and the force on the link is its opposite.

Source: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (MultibodyPlant).
"""

# Drake's type stubs accept only ndarray[float64], although lists and other arrays work, and lack the types of ports
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.multibody import ContactGeometry, Mechanism, require_positive

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant

LINKS = ("link_1", "link_2")
ON_LINK = (
    "The disk's centre lies on link 2 of the arm, where the contact has no normal. Start the disk outside the arm, "
    "or use smaller steps or torques."
)
MIN_DISTANCE = 1e-9  # m, distance of the disk's centre from the link below which the normal is undefined


class ArmDisk(Mechanism):
    """The arm, the disk and the ground; 5 degrees of freedom, contact pairs ("arm", "ground").

    Lengths are in m, masses in kg, inertias in kg m² about the centres of mass.  `link_coms` in m from the joint are
    distances along the link, or pairs (along, across); `base` is (x, y) of the first joint in m.  `plant` is the
    finalized MultibodyPlant of link_1, link_2 and disk, with frames at the joint or centre and x along the link.

    Raises:
        UserError: a length, mass or inertia is not positive.
    """

    nv = 5
    pairs = ("arm", "ground")

    def __init__(
        self,
        link_lengths: Sequence[float],
        link_masses: Sequence[float],
        link_coms: Sequence[float] | Sequence[Sequence[float]],
        link_inertias: Sequence[float],
        disk_radius: float,
        disk_mass: float,
        disk_inertia: float,
        gravity: float = 9.81,
        base: Sequence[float] = (0.0, 0.0),
    ) -> None:
        for i in range(2):
            require_positive(
                LINKS[i].replace("_", " "), length=link_lengths[i], mass=link_masses[i], inertia=link_inertias[i]
            )
        require_positive("disk", radius=disk_radius, mass=disk_mass, inertia=disk_inertia)
        coms = np.zeros((2, 2))
        for row, com in zip(coms, link_coms):
            row[: np.size(com)] = com
        if not (np.isfinite(coms).all() and np.isfinite(base).all() and 0.0 <= gravity < np.inf):
            raise UserError("The arm needs finite centres of mass, a finite base, and a gravity of at least 0.")
        self.link_lengths, self.link_masses = np.array(link_lengths, float), np.array(link_masses, float)
        self.link_coms, self.link_inertias = coms, np.array(link_inertias, float)
        self.disk_radius, self.disk_mass = float(disk_radius), float(disk_mass)
        self.disk_inertia, self.g, self.base = float(disk_inertia), float(gravity), np.array(base, float)
        from pydrake.multibody.plant import MultibodyPlant

        self.plant = MultibodyPlant(time_step=0.0)
        self.add_bodies(self.plant)
        self.plant.Finalize()
        self._context = self.plant.CreateDefaultContext()

    def add_bodies(self, plant: "MultibodyPlant") -> None:
        """Add links, disk, joints and gravity, in the order of q, to a plant that is not yet finalized."""
        from pydrake.math import RigidTransform
        from pydrake.multibody.tree import FixedOffsetFrame, PlanarJoint, RevoluteJoint

        up = [0.0, 0.0, 1.0]
        parent, place = plant.world_body(), RigidTransform([*self.base, 0.0])
        for i, name in enumerate(LINKS):
            inertia = spatial_inertia(self.link_masses[i], self.link_coms[i], self.link_inertias[i])
            link = plant.AddRigidBody(name, inertia)
            mount = place if i == 0 else RigidTransform([self.link_lengths[0], 0.0, 0.0])
            frame = plant.AddFrame(FixedOffsetFrame(f"mount_{i}", parent.body_frame(), mount))
            plant.AddJoint(RevoluteJoint(f"joint_{i + 1}", frame, link.body_frame(), up))
            parent = link
        disk = plant.AddRigidBody("disk", spatial_inertia(self.disk_mass, np.zeros(2), self.disk_inertia))
        plant.AddJoint(PlanarJoint("plane", plant.world_frame(), disk.body_frame(), damping=np.zeros(3)))
        plant.mutable_gravity_field().set_gravity_vector([0.0, -self.g, 0.0])

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        self.plant.SetPositions(self._context, _finite(q))
        return self.plant.CalcMassMatrix(self._context)

    def bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        self.plant.SetPositionsAndVelocities(self._context, _finite(np.concatenate([q, v])))
        return self.plant.CalcBiasTerm(self._context)

    def gravity(self, q: np.ndarray) -> np.ndarray:
        self.plant.SetPositions(self._context, _finite(q))
        return self.plant.CalcGravityGeneralizedForces(self._context)

    def joints(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Second joint and tip of the arm, (n, 2) each in m, at configurations q (n, 5)."""
        l1, l2 = self.link_lengths
        first, second = q[:, 0], q[:, 0] + q[:, 1]
        elbow = self.base + l1 * np.stack([np.cos(first), np.sin(first)], axis=1)
        return elbow, elbow + l2 * np.stack([np.cos(second), np.sin(second)], axis=1)

    def contacts(self, q: np.ndarray) -> ContactGeometry:
        # like `contacts_of`, but with plain floats for speed, since it is called at every time step
        q1, q2, x, y, _ = (float(value) for value in q)
        (l1, l2), (bx, by), R = self.link_lengths, self.base, self.disk_radius
        ex, ey = bx + l1 * math.cos(q1), by + l1 * math.sin(q1)
        ux, uy = math.cos(q1 + q2), math.sin(q1 + q2)
        reach = min(max((x - ex) * ux + (y - ey) * uy, 0.0), l2)
        cx, cy = ex + reach * ux, ey + reach * uy
        distance = math.hypot(x - cx, y - cy)
        if distance < MIN_DISTANCE:
            raise UserError(ON_LINK)
        nx, ny = (x - cx) / distance, (y - cy) / distance
        rows = [[d[0] * (cy - oy) - d[1] * (cx - ox) for ox, oy in ((bx, by), (ex, ey))] for d in ((nx, ny), (ny, -nx))]
        J_n = np.array([[*rows[0], nx, ny, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0]])
        J_t = np.array([[*rows[1], ny, -nx, R], [0.0, 0.0, 1.0, 0.0, R]])
        return ContactGeometry(np.array([distance - R, y - R]), J_n, J_t)

    def contacts_of(self, q: np.ndarray) -> ContactGeometry:
        q = np.asarray(q, dtype=float)
        elbow, tip = self.joints(q)
        centre, along = q[:, 2:4], (tip - elbow) / self.link_lengths[1]
        reach = np.clip(((centre - elbow) * along).sum(axis=1), 0.0, self.link_lengths[1])
        C = elbow + reach[:, None] * along
        away = centre - C
        distance = np.hypot(away[:, 0], away[:, 1])
        if distance.min(initial=np.inf) < MIN_DISTANCE:
            raise UserError(ON_LINK)
        n = away / distance[:, None]
        t = np.stack([n[:, 1], -n[:, 0]], axis=1)
        J_n, J_t = np.zeros((2, len(q), 2, 5))
        for J, direction in ((J_n, n), (J_t, t)):
            for joint, origin in enumerate((self.base, elbow)):
                lever = C - origin  # ∂C/∂q_i = ẑ × lever
                J[:, 0, joint] = direction[:, 0] * lever[:, 1] - direction[:, 1] * lever[:, 0]
            J[:, 0, 2:4] = direction
        J_t[:, :, 4] = self.disk_radius
        J_n[:, 1, 3] = J_t[:, 1, 2] = 1.0
        return ContactGeometry(np.stack([distance, q[:, 3]], axis=1) - self.disk_radius, J_n, J_t)


def spatial_inertia(mass: float, com: Sequence[float] | np.ndarray, inertia: float) -> object:
    """Drake's inertia of a planar body: mass in kg, `com` (2,) in m from its origin, inertia in kg m² about `com`."""
    from pydrake.multibody.tree import RotationalInertia, SpatialInertia

    # only the moment about z matters in the plane; equal moments satisfy Drake's triangle inequality
    central = RotationalInertia(inertia, inertia, inertia)
    return SpatialInertia.MakeFromCentralInertia(mass, np.array([com[0], com[1], 0.0]), central)


def _finite(values: np.ndarray) -> np.ndarray:
    # Drake aborts the process if a position is not finite
    values = np.asarray(values, dtype=float)
    if not np.isfinite(values).all():
        raise ValueError(f"the state of the arm and disk must be finite, got {values}")
    return values
