"""Drake as a contact model for bodies in space: point contact, in continuous time with error control.

Each contact point is a ball on a half-space, with a spring and Hunt and Crossley's dissipation; all points act at the
same time.  One plant simulates, one after another, the bodies with the same coefficients, points and inertia.  Gravity
is the mean acceleration of these bodies in flight; couples in flight are neglected, because the rotation that they
cause during a contact is too small to matter.  See `thesis_lib/engines/in_space.py`.
"""

# Drake's type stubs accept only ndarray[float64], though lists and other arrays work, and lack the types of ports
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

import numpy as np

from thesis_lib.engines.in_space import TouchPoints
from thesis_lib.engines.parameters import DrakeNumbers
from thesis_lib.foundation.errors import UserError

POINTS = 20  # states of a path in one contact time
AT_ONCE = 30  # of these states between two checks of which bodies have left
ACCURACY = 1e-4  # relative, of Drake's error control


class DrakeInSpace:
    """n bodies on Drake's plane; the contact time T sets the time between states, `numbers` the contact force."""

    name = "Drake"

    def __init__(
        self, points: TouchPoints, inertia: np.ndarray, push: np.ndarray, lasting: float, numbers: DrakeNumbers
    ) -> None:
        """Arrays as in the table of `in_space`; all bodies have 1 kg, the same `centres`, and T = `lasting` in s.

        Raises:
            UserError: Drake is not installed.
        """
        try:
            from pydrake.geometry import Ellipsoid, HalfSpace, Sphere
            from pydrake.math import RigidTransform
            from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel
            from pydrake.multibody.tree import SpatialInertia, UnitInertia
            from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
            from pydrake.systems.framework import DiagramBuilder
        except ImportError as error:
            raise UserError(f"Drake cannot be used here ({error}): pip install drake.") from error
        from thesis_lib.simulate.drake.clock import quiet
        from thesis_lib.simulate.drake.plant import STICTION, point_contact

        self.points, self.h = points, lasting / POINTS
        builder = DiagramBuilder()
        plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
        plant.set_contact_model(ContactModel.kPoint)
        plant.set_stiction_tolerance(STICTION)
        plant.mutable_gravity_field().set_gravity_vector(push[:3].mean(axis=1))
        moments = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        body = plant.AddRigidBody("body", SpatialInertia(1.0, np.zeros(3), UnitInertia(*moments)))
        made_of = point_contact(numbers.stiffness, numbers.dissipation, numbers.friction)
        plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "plane", made_of)
        shape = Sphere(points.radius)
        if points.squares.any():
            shape = Ellipsoid(*(np.sqrt(points.squares) + points.radius))
        for i, centre in enumerate(points.centres[..., 0].T):
            plant.RegisterCollisionGeometry(body, RigidTransform(centre), shape, f"p{i}", made_of)
        plant.Finalize()
        with quiet():
            self.plant, self.simulator = plant, Simulator(builder.Build())
        integrator = ResetIntegratorFromFlags(self.simulator, "runge_kutta3", lasting)
        integrator.set_target_accuracy(ACCURACY)
        self.root = self.simulator.get_mutable_context()
        self.context = plant.GetMyMutableContextFromRoot(self.root)

    def path(self, rows: np.ndarray, pose: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses (7, m, steps) and motions (6, m, steps) at `AT_ONCE` successive times."""
        q, v = np.empty((7, len(rows), AT_ONCE)), np.empty((6, len(rows), AT_ONCE))
        for i, row in enumerate(rows):
            self.root.SetTime(0.0)  # Drake stores attitude and spin first
            self.plant.SetPositions(self.context, np.roll(pose[:, i], 4))
            self.plant.SetVelocities(self.context, np.roll(motion[:, i], 3))
            self.simulator.Initialize()
            for step in range(AT_ONCE):
                self.simulator.AdvanceTo((step + 1) * self.h)
                q[:, i, step] = np.roll(self.plant.GetPositions(self.context), 3)
                v[:, i, step] = np.roll(self.plant.GetVelocities(self.context), 3)
                if self.points.gap(q[:, i : i + 1, step], np.array([row])) >= 0.0:
                    q[:, i, step:], v[:, i, step:] = q[:, i, step, None], v[:, i, step, None]
                    break
        return q, v
