"""Base inertial parameters of the two-link arm and its disk, and their dynamics in closed form (thesis 2.3.2, 2.4).

With centres of mass on the links' axes and in the disk's centre, and inertias I about the joints, the motion depends
only on

    Θ = (m_1 c_1 + l_1 m_2,  I_1 + l_1² m_2,  m_2 c_2,  I_2,  m_d,  I_d).

With θ_2 = q_1 + q_2,

    M_11 = Θ_2 + Θ_4 + 2 l_1 Θ_3 cos q_2,   M_12 = Θ_4 + l_1 Θ_3 cos q_2,   M_22 = Θ_4,   M_disk = diag(Θ_5, Θ_5, Θ_6)
    C v  = l_1 Θ_3 sin q_2 (-(2 q̇_1 q̇_2 + q̇_2²), q̇_1²),     g = -g (Θ_1 cos q_1 + Θ_3 cos θ_2, Θ_3 cos θ_2)

which is linear in Θ: Y Θ = M v̇ + C v - g.  M is positive definite at every q exactly if

    [Θ_2  l_1 Θ_3; l_1 Θ_3  Θ_4] = L L',  L lower triangular with a positive diagonal,   Θ_5 > 0,   Θ_6 > 0,

so estimators use the unconstrained ξ = (Θ_1, ln L_11, L_21, ln L_22, ln Θ_5, ln Θ_6).

Sources: W. Khalil, E. Dombre, Modeling, Identification and Control of Robots, 2002,
doi 10.1016/B978-1-903996-66-9.X5000-3; J. C. Pinheiro, D. M. Bates, Statistics and Computing 6 (1996),
doi 10.1007/BF00140873 (log-Cholesky).
"""

import numpy as np
from pydantic import Field

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.rig.release import Spread
from thesis_lib.simulate.stepping.arm_disk import ArmDisk

NAMES = ("m1_c1_plus_l1_m2", "I1_plus_l1l1_m2", "m2_c2", "I2", "m_disk", "I_disk")


class ArmPrior(Section):
    """Prior distribution of arm and disk: the order of magnitude of bodies of that size."""

    mass: Spread = Field(
        Spread(low=0.1, high=10.0), description="kg, of each body, drawn log-uniformly; own choice: two decades"
    )
    com: Spread = Field(Spread(low=0.1, high=0.9), description="centre of mass from the joint over the link's length")
    gyration: Spread = Field(
        Spread(low=0.1, high=0.5), description="radius of gyration over length; 0.5 has all mass at the two ends"
    )
    disk_gyration: Spread = Field(Spread(low=0.2, high=1.0), description="radius of gyration over radius; 1 is a hoop")

    def draw(self, n: int, arm: ArmDisk, rng: np.random.Generator) -> np.ndarray:
        """Draw n sets of base parameters, (n, 6); only the lengths, radius and gravity of `arm` are used."""
        u = rng.random((n, 8))
        low, high = np.log([self.mass.low, self.mass.high])
        m = np.exp(low + (high - low) * u[:, :3])
        l1, l2 = arm.link_lengths
        c1, c2 = l1 * self.com.quantile(u[:, 3]), l2 * self.com.quantile(u[:, 4])
        i1 = m[:, 0] * (c1**2 + (l1 * self.gyration.quantile(u[:, 5])) ** 2)
        i2 = m[:, 1] * (c2**2 + (l2 * self.gyration.quantile(u[:, 6])) ** 2)
        disk = m[:, 2] * (arm.disk_radius * self.disk_gyration.quantile(u[:, 7])) ** 2
        columns = [m[:, 0] * c1 + l1 * m[:, 1], i1 + l1**2 * m[:, 1], m[:, 1] * c2, i2, m[:, 2], disk]
        return np.stack(columns, axis=1)


def base_of(arm: ArmDisk) -> np.ndarray:
    """Base parameters Θ (6,) of an arm with disk.

    Raises:
        UserError: a link's centre of mass lies off its axis, which would require further parameters.
    """
    if arm.link_coms[:, 1].any():
        raise UserError(
            "These base parameters require that each link's centre of mass lies on its axis; the arm has it "
            f"{arm.link_coms[:, 1]} m off. For such arms, use the general base_parameters."
        )
    (m1, m2), (c1, c2) = arm.link_masses, arm.link_coms[:, 0]
    i1, i2 = arm.link_inertias + arm.link_masses * arm.link_coms[:, 0] ** 2
    l1 = arm.link_lengths[0]
    return np.array([m1 * c1 + l1 * m2, i1 + l1**2 * m2, m2 * c2, i2, arm.disk_mass, arm.disk_inertia])


def regressor(arm: ArmDisk, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Regressor Y (n, 5, 6), N or N m per Θ, at positions, velocities, accelerations (n, 5); lengths and g of `arm`."""
    l1, g = arm.link_lengths[0], arm.g
    c1, c12 = np.cos(q[:, 0]), np.cos(q[:, 0] + q[:, 1])
    c2, s2 = l1 * np.cos(q[:, 1]), l1 * np.sin(q[:, 1])
    v1, v2, a1, a2 = v[:, 0], v[:, 1], a[:, 0], a[:, 1]
    Y = np.zeros((len(q), 5, 6))
    Y[:, 0, 0] = g * c1
    Y[:, 0, 1] = a1
    Y[:, 0, 2] = c2 * (2.0 * a1 + a2) - s2 * (2.0 * v1 * v2 + v2**2) + g * c12
    Y[:, 1, 2] = c2 * a1 + s2 * v1**2 + g * c12
    Y[:, 0, 3] = Y[:, 1, 3] = a1 + a2
    Y[:, 2, 4], Y[:, 3, 4], Y[:, 4, 5] = a[:, 2], a[:, 3] + g, a[:, 4]
    return Y


def positive_definite(theta: np.ndarray, l1: float) -> np.ndarray:
    """Whether M is positive definite at every configuration: (...,) for Θ (..., 6) and length `l1` in m."""
    theta = np.asarray(theta, dtype=float)
    det = theta[..., 1] * theta[..., 3] - (l1 * theta[..., 2]) ** 2
    return (det > 0) & (theta[..., 3] > 0) & (theta[..., 4] > 0) & (theta[..., 5] > 0)


def free_coordinates(theta: np.ndarray, l1: float) -> np.ndarray:
    """Unconstrained coordinates ξ (..., 6) of base parameters Θ (..., 6).

    Raises:
        UserError: M is not positive definite.
    """
    theta = np.asarray(theta, dtype=float)
    if not positive_definite(theta, l1).all():
        raise UserError(f"These base parameters of the arm do not give a positive definite mass matrix: {theta}.")
    L11 = np.sqrt(theta[..., 1])
    L21 = l1 * theta[..., 2] / L11
    L22 = np.sqrt(theta[..., 3] - L21**2)
    return np.stack(
        [theta[..., 0], np.log(L11), L21, np.log(L22), np.log(theta[..., 4]), np.log(theta[..., 5])], axis=-1
    )


def from_free(xi: np.ndarray, l1: float) -> np.ndarray:
    """Base parameters Θ (..., 6) of unconstrained coordinates ξ (..., 6)."""
    xi = np.asarray(xi, dtype=float)
    L11, L21, L22 = np.exp(xi[..., 1]), xi[..., 2], np.exp(xi[..., 3])
    return np.stack(
        [xi[..., 0], L11**2, L11 * L21 / l1, L21**2 + L22**2, np.exp(xi[..., 4]), np.exp(xi[..., 5])], axis=-1
    )


def from_free_jacobian(xi: np.ndarray, l1: float) -> np.ndarray:
    """Jacobian ∂Θ/∂ξ (6, 6) at one ξ (6,)."""
    L11, L21, L22 = np.exp(xi[1]), xi[2], np.exp(xi[3])
    D = np.zeros((6, 6))
    D[0, 0] = 1.0
    D[1, 1] = 2.0 * L11**2
    D[2, 1], D[2, 2] = L11 * L21 / l1, L11 / l1
    D[3, 2], D[3, 3] = 2.0 * L21, 2.0 * L22**2
    D[4, 4], D[5, 5] = np.exp(xi[4]), np.exp(xi[5])
    return D
