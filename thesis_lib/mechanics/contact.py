"""One contact of a rigid body with a surface, in the plane or in space (thesis section 3.3.1, equations 3.2 to 3.4).

| on paper       | in code                | unit | shape                  |                                          |
|----------------|------------------------|------|------------------------|------------------------------------------|
| r              | `r`                    | m    | (d, n)                 | contact point from the centre of mass    |
| v_C = v + ω × r| `v`                    | m/s  | d of (n,)              | velocity of the contact point            |
| M_C⁻¹ = K      | `K`                    | 1/kg | d × d of (n,)          | contact space compliance                 |
| G⁻¹            | `mobility`             | 1/(kg m²) | (n,) or (3, 3, n) | angular velocity per angular impulse     |
| c              | `c`                    | N s  | d of (n,)              | impulse on the body                      |
| α              | `alpha`                | 1    | (n,)                   | contact-space energy after over before   |

    K = 1/m + S G⁻¹ Sᵀ,    S = (−r_y, r_x)ᵀ in the plane,    S = −[r]ₓ in space

Components are (t, n) in the plane and (t_1, t_2, n) in space.  Code for both uses `v`, `K`, `v_n` and `K_nn`; the
planar names `v_t`, `K_tt`, `K_tn` are the names of the thesis.  Arrays broadcast: one call evaluates a grid of
parameters (G, 1) for n impacts.
"""

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from thesis_lib.mechanics.space import Space, by_column, by_row, cross

if TYPE_CHECKING:
    from thesis_lib.mechanics.state import State

Components = Any  # d arrays (n,): a tuple in the plane, an array in space


class Contact:
    """Velocity of the contact point and compliance of n contacts: tuples of arrays in the plane, arrays in space.

    Attributes:
        v: velocity of the contact point in m/s, by component.
        K: compliance in 1/kg, by row and component.
        r: contact point from the centre of mass in m, (d, n); None if not needed.
        mobility: G⁻¹ in 1/(kg m²): (n,) or a number in the plane, (3, 3, n) in space; None if not needed.
        mu, epsilon: coefficients of each impact, if known (`with_coefficients`).
    """

    r: np.ndarray
    mobility: Any
    mu: np.ndarray
    epsilon: np.ndarray

    def __init__(
        self, v: Components, K: Components, r: Any = None, mobility: Any = None, mu: Any = None, epsilon: Any = None
    ) -> None:
        self.v, self.K, self.r, self.mobility, self.mu, self.epsilon = v, K, r, mobility, mu, epsilon
        self.v_n, self.K_nn = v[-1], K[-1][-1]

    @classmethod
    def planar(cls, v_t, v_n, K_tt, K_nn, K_tn) -> "Contact":
        """Planar contacts with the given components, (n,) each."""
        return cls((v_t, v_n), ((K_tt, K_tn), (K_tn, K_nn)))

    def with_coefficients(self, mu: np.ndarray, epsilon: np.ndarray) -> "Contact":
        """The same contacts, with the coefficients (n,) of each impact."""
        return Contact(self.v, self.K, self.r, self.mobility, mu, epsilon)

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return len(self.v)

    @property
    def v_t(self) -> np.ndarray:
        """In the plane: tangential velocity of the contact point, m/s."""
        return self.v[0]

    @property
    def K_tt(self) -> np.ndarray:
        """In the plane: tangential compliance, 1/kg."""
        return self.K[0][0]

    @property
    def K_tn(self) -> np.ndarray:
        """In the plane: coupling of tangent and normal, 1/kg."""
        return self.K[0][-1]

    @cached_property
    def det(self) -> np.ndarray:
        """Determinant of K, positive; in 1/kg² in the plane, 1/kg³ in space."""
        if self.dimension == 2:
            return self.K_tt * self.K_nn - self.K_tn * self.K_tn
        return (self.K[0] * cross(self.K[1], self.K[2])).sum(axis=0)

    @cached_property
    def inverse(self) -> np.ndarray:
        """Contact space inertia M_C = K⁻¹, (d, d, n) in kg."""
        if self.dimension == 2:
            return np.array([[self.K_nn, -self.K_tn], [-self.K_tn, self.K_tt]]) / self.det
        rows = [cross(self.K[1], self.K[2]), cross(self.K[2], self.K[0]), cross(self.K[0], self.K[1])]
        return np.stack(rows) / self.det

    @property
    def M_c(self) -> np.ndarray:
        """Contact space inertia M_C, (n, d, d) in kg."""
        return np.moveaxis(self.inverse, -1, 0)

    def velocity_after(self, *c: np.ndarray) -> Components:
        """Velocity of the contact point in m/s after the impulse c: v_C⁺ = v_C + M_C⁻¹ c (eq. 3.4)."""
        if self.dimension == 2:
            c_t, c_n = c
            v_t, v_n = self.v
            return v_t + self.K_tt * c_t + self.K_tn * c_n, v_n + self.K_tn * c_t + self.K_nn * c_n
        return np.stack([before + change for before, change in zip(self.v, _product(self.K, c))])

    def impulse_to(self, *v: np.ndarray | float) -> Components:
        """Impulse in N s that brings the contact point to the velocity v in m/s: c = M_C (v_C⁺ − v_C)."""
        if self.dimension == 2:
            d_t, d_n = v[0] - self.v_t, v[1] - self.v_n
            return (self.K_nn * d_t - self.K_tn * d_n) / self.det, (self.K_tt * d_n - self.K_tn * d_t) / self.det
        return _product(self.inverse, [wanted - now for wanted, now in zip(v, self.v)])

    def energy(self, *v: np.ndarray) -> np.ndarray:
        """Quadratic form v_Cᵀ M_C v_C (twice the contact-space kinetic energy) in J."""
        if self.dimension == 2:
            v_t, v_n = v
            return (self.K_nn * v_t**2 - 2.0 * self.K_tn * v_t * v_n + self.K_tt * v_n**2) / self.det
        return sum(a * b for a, b in zip(v, _product(self.inverse, v)))

    def alpha(self, *c: np.ndarray) -> np.ndarray:
        """Level α of the energy ellipse on which the impulse lies (eq. 3.5): 1 conserves energy, 0 dissipates all."""
        return self.energy(*self.velocity_after(*c)) / self.energy(*self.v)

    def __getitem__(self, rows: np.ndarray | slice) -> "Contact":
        """The contacts at `rows`."""

        def of(array):
            return array if array is None or np.ndim(array) == 0 else array[..., rows]

        if self.dimension == 2:
            (K_tt, K_tn), (_, K_nn) = self.K
            K = ((of(K_tt), of(K_tn)), (of(K_tn), of(K_nn)))
            v: Components = tuple(of(part) for part in self.v)
        else:
            K, v = of(self.K), of(self.v)
        return Contact(v, K, of(self.r), of(self.mobility), of(self.mu), of(self.epsilon))


def contact(state: "State", r: np.ndarray, mobility: np.ndarray | float, inverse_mass: float = 1.0) -> Contact:
    """Contacts of bodies in `state`, with velocities of the centre of mass, at r (d, n) in m from it (eq. 3.4).

    `mobility` is G⁻¹ in 1/(kg m²) as in the module's table; `inverse_mass` is in 1/kg, 1 by default: all quantities are
    then per unit mass.
    """
    return contact_at(state.space, state.velocity, state.spin, r, mobility, inverse_mass)


def contact_at(
    space: Space,
    velocity: np.ndarray,
    spin: np.ndarray,
    r: np.ndarray,
    mobility: np.ndarray | float,
    inverse_mass: float = 1.0,
) -> Contact:
    """Contacts as in `contact`, from velocity (d, n) in m/s and spin (turns, n) in rad/s."""
    if space.is_plane:
        (v_x, v_y), omega, (r_x, r_y) = velocity, spin[0], r
        x_I, y_I = r_x * mobility, r_y * mobility
        K_tn = -r_x * y_I
        K = ((inverse_mass + r_y * y_I, K_tn), (K_tn, inverse_mass + r_x * x_I))
        return Contact((v_x - r_y * omega, v_y + r_x * omega), K, r, mobility)
    K = by_column("compliance", r, by_row(mobility))
    K[[0, 1, 2], [0, 1, 2]] += inverse_mass
    return Contact(velocity + cross(spin, r), K, r, mobility)


def velocity_change(
    c: Components,
    r: np.ndarray,
    mobility: np.ndarray | float,
    inverse_mass: float = 1.0,
    couple: np.ndarray | None = None,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Change of the motion Δv = M⁻¹ Jᵀ c (d + turns, n) in m/s, rad/s due to the impulse c and a couple (eq. 3.2).

    `couple` in N m s is (n,) in the plane, (3, n) in space; the result is written to `out`, if given.
    """
    if len(r) == 2:
        c_t, c_n = c
        turning = r[0] * c_n - r[1] * c_t
        if out is None:
            out = np.empty((3, *np.shape(turning)))
        np.multiply(c_t, inverse_mass, out=out[0])
        np.multiply(c_n, inverse_mass, out=out[1])
        np.multiply(turning if couple is None else turning + couple, mobility, out=out[2])
        return out
    c = np.asarray(c)
    turning = cross(r, c)
    change = np.concatenate([c * inverse_mass, _product(mobility, turning if couple is None else turning + couple)])
    if out is None:
        return change
    out[:] = change
    return out


def _product(A: np.ndarray, b) -> np.ndarray:
    """Product A b (3, ...) of matrices (3, 3, ...) and vectors (3, ...)."""
    vectors = b if isinstance(b, np.ndarray) else np.array(np.broadcast_arrays(*b))
    return by_column("product", by_row(A), vectors)
