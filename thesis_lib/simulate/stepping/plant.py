"""Contact Jacobian of a planar body, from Drake's MultibodyPlant.

The plane is Drake's world x-y plane seen from +z: x to the right, y up, θ counter-clockwise.  A body moves on a
`PlanarJoint` with positions q = (x, y, θ) and velocities v = (v_x, v_y, ω).

    J = (J_t; J_n) = [1, 0, -r_y; 0, 1, r_x]

Source: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (MultibodyPlant, PlanarJoint).
"""

# Drake's type stubs accept only ndarray[float64], although lists and other arrays work, and lack the types of ports
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

import numpy as np
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, PlanarJoint, SpatialInertia, UnitInertia


class PlanarPlant:
    """One free body in the plane, evaluated at arrays of configurations; its origin is its centre of mass.

    Drake evaluates one configuration at a time (about 5 µs).
    """

    def __init__(self) -> None:
        self._plant = MultibodyPlant(time_step=0.0)
        body = self._plant.AddRigidBody("body", SpatialInertia(1.0, np.zeros(3), UnitInertia(1.0, 1.0, 1.0)))
        self._plant.AddJoint(PlanarJoint("plane", self._plant.world_frame(), body.body_frame(), damping=np.zeros(3)))
        self._plant.Finalize()
        self._frame, self._context = body.body_frame(), self._plant.CreateDefaultContext()

    def contact_jacobian(self, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Rows (J_t, J_n), (n, 2, 3), of the body-fixed point at r (n, 2) in m, world axes, at configurations q (n, 3).

        Raises:
            ValueError: a value is not finite (Drake would abort the process), or an array has the wrong shape.
        """
        q, r = np.asarray(q, dtype=float), np.asarray(r, dtype=float)
        for name, values, size in (("configurations", q, 3), ("contact points", r, 2)):
            if values.shape != (len(q), size) or not np.isfinite(values).all():
                raise ValueError(f"{name} must be finite and of shape (n, {size}), got {values.shape}")
        world, J = self._plant.world_frame(), np.empty((len(q), 2, 3))
        for i, row in enumerate(q):
            self._plant.SetPositions(self._context, row)
            R_WB: RotationMatrix = self._frame.CalcRotationMatrixInWorld(self._context)
            # at this instant the point is fixed in the body: p_BoC_B = R_WB' r
            p_BoC_B = R_WB.matrix().T @ np.array([r[i, 0], r[i, 1], 0.0])
            J[i] = self._plant.CalcJacobianTranslationalVelocity(
                self._context, JacobianWrtVariable.kV, self._frame, p_BoC_B, world, world
            )[:2]
        return J
