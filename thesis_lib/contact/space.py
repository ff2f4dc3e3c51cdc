"""Contact space of a planar body that touches a horizontal surface (thesis section 3.3.1, equations 3.2 to 3.6).

| on paper        | in code                | unit     | shape  |                                            |
|-----------------|------------------------|----------|--------|--------------------------------------------|
| v = (v_x,v_y,ω) | `v_pre`, `v_post`      | m/s, rad/s | (n, 3) | velocity of the centre of mass            |
| r = (r_x, r_y)  | `r`                    | m        | (n, 2) | contact point from the centre of mass      |
| v_C = (v_t,v_n) | `v_t`, `v_n`           | m/s      | (n,)   | velocity of the contact point              |
| M_C⁻¹           | `K_tt`, `K_nn`, `K_tn` | 1/kg     | (n,)   | contact space compliance                   |
| M_C             | `M_c`                  | kg       | (n,2,2)| contact space inertia                      |
| c = (c_t, c_n)  | `c_t`, `c_n`           | N s      | (n,)   | impulse on the body                        |
| α               | `alpha`                | 1        | (n,)   | contact-space energy after over before     |

Contact frame: t = +x, n = +y, so J_t = [1, 0, −r_y] and J_n = [0, 1, r_x].
Equation 3.6 of the thesis lacks M_C on its right-hand side (compare equation 4.5); the corrected form is used here.
Source of the energy ellipse: Chatterjee and Ruina, J. Appl. Mech. 65 (1998), doi:10.1115/1.2791929.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.mechanics.contact import Contact, contact_at
from thesis_lib.mechanics.contact import velocity_change as change_of_motion
from thesis_lib.mechanics.space import PLANE

ContactSpace = Contact  # the thesis's name; user-defined laws import the class under this name


def contact_space(v_pre: np.ndarray, r: np.ndarray, *, mass: float, k_g: float) -> Contact:
    """Contacts for impacts with velocity `v_pre` (..., 3) and contact point `r` (..., 2) in m (eq. 3.4).

    K_tt = 1/m + r_y²/I,  K_nn = 1/m + r_x²/I,  K_tn = −r_x r_y/I,  with I = m k².
    """
    v, point = np.moveaxis(v_pre, -1, 0), np.moveaxis(r, -1, 0)
    return contact_at(PLANE, v[:2], v[2:], point, 1.0 / (mass * k_g * k_g), 1.0 / mass)


def velocity_change(c_t: np.ndarray, c_n: np.ndarray, r: np.ndarray, *, mass: float, k_g: float) -> np.ndarray:
    """Velocity change Δv = M⁻¹ Jᵀ c (..., 3) of the centre of mass, in m/s and rad/s (eq. 3.2)."""
    dv = np.empty(np.broadcast_shapes(np.shape(c_t), r.shape[:-1]) + (3,))
    change_of_motion(
        (c_t, c_n), np.moveaxis(r, -1, 0), 1.0 / (mass * k_g * k_g), 1.0 / mass, out=np.moveaxis(dv, -1, 0)
    )
    return dv


def measured_impulse(dv: np.ndarray, r: np.ndarray, *, mass: float, k_g: float) -> tuple[np.ndarray, np.ndarray]:
    """Impulse (c_t, c_n) in N s that best explains a measured velocity change (..., 3): c_irb = M_C J Δv (eq. 3.7).

    The least-squares norm of eq. 3.7 is the kinetic metric √(Δv_x² + Δv_y² + (k Δω)²), which converts an error of ω
    to a velocity at distance k.  This is our choice: the thesis leaves the units of the norm open.
    """
    return contact_space(-dv, r, mass=mass, k_g=k_g).impulse_to(0.0, 0.0)


def residual_couple(dv: np.ndarray, r: np.ndarray, *, mass: float, k_g: float) -> np.ndarray:
    """Couple τ (n,) in N m s about the contact point, which no point impulse can produce.

    τ = m (k² Δω − r_x Δv_y + r_y Δv_x), counter-clockwise; zero for every impulse through the contact point.
    """
    return mass * (k_g * k_g * dv[..., 2] - r[..., 0] * dv[..., 1] + r[..., 1] * dv[..., 0])


def velocity_error(dv: np.ndarray, k_g: float) -> np.ndarray:
    """Kinetic norm √(δv_x² + δv_y² + (k δω)²) of a velocity error (..., 3), in m/s (thesis, figure 3-8)."""
    return np.sqrt(dv[..., 0] ** 2 + dv[..., 1] ** 2 + (k_g * dv[..., 2]) ** 2)


@dataclass(frozen=True)
class EnergyEllipse:
    """Geometry of the energy ellipses (eq. 3.6) of n impacts, for figures and for the bounds.

    Attributes:
        centre: (n, 2) impulse −M_C v_C of a plastic impact that sticks, N s.
        semi_axes: (n, 2) lengths at α = 1, the major one first, N s.
        angle: (n,) angle from the t axis to the major axis, rad.
    """

    centre: np.ndarray
    semi_axes: np.ndarray
    angle: np.ndarray

    def outline(self, alpha: float = 1.0, points: int = 181) -> np.ndarray:
        """Points (n, points, 2) in N s on the ellipses of level `alpha`."""
        phase = np.linspace(0.0, 2.0 * np.pi, points)
        axes = np.sqrt(alpha) * self.semi_axes
        x, y = axes[:, :1] * np.cos(phase), axes[:, 1:] * np.sin(phase)
        cos, sin = np.cos(self.angle)[:, None], np.sin(self.angle)[:, None]
        return self.centre[:, None, :] + np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def energy_ellipse(space: Contact) -> EnergyEllipse:
    """Energy ellipse (c + M_C v_C)ᵀ M_C⁻¹ (c + M_C v_C) ≤ α v_Cᵀ M_C v_C of each impact."""
    centre = np.stack(space.impulse_to(0.0, 0.0), axis=-1)
    K = np.stack([np.stack([space.K_tt, space.K_tn], -1), np.stack([space.K_tn, space.K_nn], -1)], -2)
    stiffness, axes = np.linalg.eigh(K)  # in ascending order: the least eigenvalue of K belongs to the major axis
    lengths = np.sqrt(space.energy(space.v_t, space.v_n)[:, None] / stiffness)
    major = axes[:, :, 0]
    return EnergyEllipse(centre, lengths, np.arctan2(major[:, 1], major[:, 0]))


def line_of_sticking(space: Contact, c_n: np.ndarray) -> np.ndarray:
    """c_t (n,) in N s on the line of sticking v_t⁺ = 0 at the given c_n (n,)."""
    return -(space.v_t + space.K_tn * c_n) / space.K_tt


def beyond_sticking(space: Contact, c_t: np.ndarray, c_n: np.ndarray) -> np.ndarray:
    """Distance (n,) in N s of impulses beyond the line of sticking; negative on the side that contains c_t = 0.

    Friction that ceases when the contact sticks cannot cross this line.  A change of sign of v_t is not sufficient to
    detect a crossing: if K_tn ≠ 0, the normal impulse alone can reverse the slip.
    """
    without_friction = space.v_t + space.K_tn * c_n
    after = without_friction + space.K_tt * c_t
    return -np.sign(without_friction) * after / np.hypot(space.K_tt, space.K_tn)


def line_of_maximum_compression(space: Contact, c_t: np.ndarray) -> np.ndarray:
    """c_n (n,) in N s on the line of maximum compression v_n⁺ = 0 at the given c_t (n,)."""
    return -(space.v_n + space.K_tn * c_t) / space.K_nn


def admissible(space: Contact, c_t: np.ndarray, c_n: np.ndarray, tolerance: float = 1e-9) -> np.ndarray:
    """Whether each impulse (n,) pushes, does not penetrate and does not gain energy (thesis, figure 3-2).

    `tolerance` is relative to the scales of impulse, velocity and energy before the impact.
    """
    v_t, v_n = space.velocity_after(c_t, c_n)
    before = space.energy(space.v_t, space.v_n)
    return (
        (c_n >= -tolerance * np.abs(space.v_n) / space.K_nn)
        & (v_n >= -tolerance * np.abs(space.v_n))
        & (space.energy(v_t, v_n) <= (1.0 + tolerance) * before)
    )
