"""Mass matrix, gravity and contact Jacobians of planar mechanisms, from Drake's MultibodyPlant.

The plane is Drake's world x-y plane seen from +z: x to the right, y up, θ counter-clockwise.  A body moves on a
`PlanarJoint` with positions q = (x, y, θ) and velocities v = (v_x, v_y, ω).

    M(q) v̇ = τ_g(q) + J(q)' λ,        J = (J_t; J_n) = [1, 0, -r_y; 0, 1, r_x]   (one planar body)

Source: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (MultibodyPlant, PlanarJoint).
"""

# Drake's stubs take ndarray[float64] alone, where lists and other arrays work, too, and do not type ports' values
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

from collections.abc import Sequence

import numpy as np
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, PlanarJoint, RigidBody, SpatialInertia, UnitInertia


class PlanarPlant:
    """A finalized MultibodyPlant that moves in its world x-y plane, evaluated at arrays of configurations.

    Drake evaluates one configuration at a time (about 5 µs).  `body` is that of `contact_jacobian`.  A value that
    is not finite or an array of wrong shape raises a ValueError.
    """

    def __init__(self, plant: MultibodyPlant, body: RigidBody) -> None:
        self.plant = plant
        self.body = body
        self._context = plant.CreateDefaultContext()

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """M (n, nv, nv) in kg, kg m, kg m² at configurations q (n, nq)."""
        q, nv = self._checked(q), self.plant.num_velocities()
        M = np.empty((len(q), nv, nv))
        for i, row in enumerate(q):
            self.plant.SetPositions(self._context, row)
            M[i] = self.plant.CalcMassMatrix(self._context)
        return M

    def gravity_forces(self, q: np.ndarray) -> np.ndarray:
        """Generalised gravity forces τ_g (n, nv) in N, N m at q (n, nq), on the right-hand side of M v̇ = τ_g."""
        q = self._checked(q)
        tau = np.empty((len(q), self.plant.num_velocities()))
        for i, row in enumerate(q):
            self.plant.SetPositions(self._context, row)
            tau[i] = self.plant.CalcGravityGeneralizedForces(self._context)
        return tau

    def contact_jacobian(self, q: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows J_t, J_n (n, nv) of the body-fixed point at r (n, 2) in m, world axes, at configurations q (n, nq)."""
        q, r = self._checked(q), np.asarray(r, dtype=float)
        if r.shape != (len(q), 2) or not np.isfinite(r).all():
            raise ValueError(f"contact points must be finite and of shape {(len(q), 2)}, got {r.shape}")
        world, frame = self.plant.world_frame(), self.body.body_frame()
        J = np.empty((len(q), 2, self.plant.num_velocities()))
        for i, row in enumerate(q):
            self.plant.SetPositions(self._context, row)
            R_WB: RotationMatrix = frame.CalcRotationMatrixInWorld(self._context)
            # the point is fixed in the body for this instant: p_BoC_B = R_WB' r
            p_BoC_B = R_WB.matrix().T @ np.array([r[i, 0], r[i, 1], 0.0])
            J[i] = self.plant.CalcJacobianTranslationalVelocity(
                self._context, JacobianWrtVariable.kV, frame, p_BoC_B, world, world
            )[:2]
        return J[:, 0], J[:, 1]

    def _checked(self, q: np.ndarray) -> np.ndarray:
        # Drake ends the process on a position that is not finite
        q = np.asarray(q, dtype=float)
        if q.ndim != 2 or q.shape[1] != self.plant.num_positions() or not np.isfinite(q).all():
            raise ValueError(
                f"configurations must be finite and of shape (n, {self.plant.num_positions()}), got {q.shape}"
            )
        return q


def planar_body(mass: float, radius_of_gyration: float, gravity: Sequence[float] = (0.0, -9.81)) -> PlanarPlant:
    """One free body in the plane; its origin is its centre of mass.

    Mass in kg, radius of gyration in m, gravity (g_x, g_y) in m/s², y up.
    """
    plant = MultibodyPlant(time_step=0.0)
    # Only the moment about z acts in the plane; equal moments satisfy Drake's triangle inequality.
    k2 = radius_of_gyration**2
    body = plant.AddRigidBody("body", SpatialInertia(mass, np.zeros(3), UnitInertia(k2, k2, k2)))
    plant.AddJoint(PlanarJoint("plane", plant.world_frame(), body.body_frame(), damping=np.zeros(3)))
    plant.mutable_gravity_field().set_gravity_vector([gravity[0], gravity[1], 0.0])
    plant.Finalize()
    return PlanarPlant(plant, body)
