"""Interface of an impact law: name, impulse as a function of (contact, μ, ε), and guaranteed properties.

A law never fails silently: every impact has a status.  `Law.impulse` broadcasts: one call evaluates a whole grid of
parameters (G, 1) for n impacts (n,).  Calling the law itself also checks the input.
"""

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.mechanics.contact import Contact, contact_at, velocity_change
from thesis_lib.mechanics.space import PLANE, SPACE, Space

if TYPE_CHECKING:  # the module imports numba
    from thesis_lib.contact.compliant.normal_force import NormalForce


class Status(enum.IntEnum):
    """Status of the impulse that a law gives for one impact."""

    OK = 0
    NOT_APPROACHING = 1  # v_n ≥ 0 before impact: the impulse is zero
    NO_SOLUTION = 2  # the law has no finite impulse for this state
    INVALID_INPUT = 3  # NaN or infinity in the state; the result is NaN


class Promise(enum.StrEnum):
    """Properties that a law may guarantee; all laws balance momentum, and mirror symmetry where the impulse pushes."""

    NON_PENETRATION = "v_n⁺ ≥ 0"
    FRICTION_CONE = "|c_t| ≤ μ c_n, c_n ≥ 0"
    NO_ENERGY_GAIN = "α ≤ 1"
    HOMOGENEOUS = "the impulse is homogeneous of degree 1 in the velocity"
    FRICTIONLESS = "μ = 0 gives c_t = 0 and c_n = −(1 + ε) v_n / K_nn"
    PLASTIC = "ε = 0 gives v_n⁺ = 0"
    CENTRAL = "central impacts agree: c_n = −(1 + ε) m v_n, |c_t| = min(μ c_n, |v_t| / K_tt)"
    STICKS = "large μ and ε = 0 take all contact velocity"


ImpulseFunction = Callable[[Contact, np.ndarray, np.ndarray], tuple[np.ndarray, ...]]
ROUNDING = 1e-9  # relative to speed or energy: rounding error, amplified by the condition number of M_C


@dataclass(frozen=True)
class Outcome:
    """Result of n impacts.

    Attributes:
        v_post: (n, 3) velocity after impact, m/s and rad/s; (n, 6) in space.
        impulse: (n, 2) impulse (c_t, c_n), N s; (n, 3) in space, (c_t1, c_t2, c_n).
        status: (n,) codes of `Status`.
    """

    v_post: np.ndarray
    impulse: np.ndarray
    status: np.ndarray


@dataclass(frozen=True)
class Law:
    """An impact law.

    Attributes:
        name: key in `LAWS`.
        title: name shown in tables and figures.
        impulse: (contact, mu, epsilon) -> (c_t, c_n), in space (c_t1, c_t2, c_n), in N s, arrays that broadcast; for
            approaching contacts (v_n < 0).
        promises: properties that hold for every impact.
        breaks: properties that the law violates, with the fraction of impacts that do so in the tests' reference draw.
        dimensions: contains 2 if the law holds in the plane, 3 if it holds in space.
        breaks_in_space: as `breaks`, for the reference draw of impacts in space; a property that is violated only in
            space may be listed in `promises`.
        reference: publication that defines the law.
        mu_unit: unit of μ; "1" except for the viscous variant.
        force: normal force of a contact of finite duration, of which `impulse` is the rigid limit.
        engine: physics engine whose own contact model replaces `force`, which approximates it; "" for a law.
    """

    name: str
    title: str
    impulse: ImpulseFunction
    promises: frozenset[Promise]
    reference: str
    breaks: Mapping[Promise, float] = field(default_factory=dict)
    dimensions: frozenset[int] = frozenset({2})
    breaks_in_space: Mapping[Promise, float] = field(default_factory=dict)
    mu_unit: str = "1"
    force: "NormalForce | None" = None
    engine: str = ""

    @property
    def as_published(self) -> bool:
        """Whether this is the authors' published code rather than the law as defined."""
        return self.name.endswith("_as_published")

    def __call__(
        self,
        v_pre: np.ndarray,
        r: np.ndarray,
        *,
        mass: float,
        k_g: float | None = None,
        inertia: np.ndarray | None = None,
        mu: float | np.ndarray,
        epsilon: float | np.ndarray,
    ) -> Outcome:
        """Return velocities and impulses of n impacts, in the plane if `k_g` is given, in space if `inertia` is.

        Args:
            v_pre: (n, 3) velocity (v_x, v_y, ω) before impact, m/s and rad/s; in space (n, 6).
            r: (n, 2) contact point from the centre of mass, m; in space (n, 3), axes (t_1, t_2, n).
            mass: kg.
            k_g: radius of gyration, m.
            inertia: (3, 3) or (n, 3, 3) inertia per mass in m², in the axes of r at the impact.
            mu: coefficient of friction, scalar or (n,).
            epsilon: coefficient of restitution, scalar or (n,).

        Raises:
            ValueError: a shape is wrong; mass, k_g or inertia is not positive; μ < 0; ε is outside [0, 1]; μ or ε is
                NaN; or the law does not hold in this dimension.
        """
        v_pre, r = np.asarray(v_pre, dtype=float), np.asarray(r, dtype=float)
        mu, epsilon = np.asarray(mu, dtype=float), np.asarray(epsilon, dtype=float)
        space = PLANE if inertia is None else SPACE
        if space.dimension not in self.dimensions:
            raise ValueError(f"{self.title} holds in {' and '.join(map(str, sorted(self.dimensions)))} dimensions only")
        _check(v_pre, r, mass, mu, epsilon, space)
        mobility = _mobility(mass, k_g, inertia, len(v_pre))
        d, inverse_mass = space.dimension, 1.0 / mass
        with np.errstate(all="ignore"):  # the status reports failures
            contact = contact_at(space, v_pre.T[:d], v_pre.T[d:], r.T, mobility, inverse_mass)
            c = tuple(self.impulse(contact, mu, epsilon))
            status = np.zeros(len(v_pre), dtype=np.int8)
            # an infinite velocity can give a finite impulse: also check the input
            if not np.isfinite(sum(part.sum() for part in c) + v_pre.sum() + r.sum()):
                status[~np.isfinite(sum(c))] = Status.NO_SOLUTION
                valid = np.isfinite(v_pre).all(axis=1) & np.isfinite(r).all(axis=1)
                status[~valid] = Status.INVALID_INPUT
                failed = status != Status.OK
                c = tuple(np.where(failed, np.nan, part) for part in c)
            away = contact.v_n >= 0.0
            if away.any():
                away &= status != Status.INVALID_INPUT
                status[away] = Status.NOT_APPROACHING
                c = tuple(np.where(away, 0.0, part) for part in c)
            impulse = np.empty((len(v_pre), d))
            impulse.T[:] = c
            v_post = np.empty_like(v_pre)
            # v⁺ = v + M⁻¹ Jᵀ c (eq. 3.2)
            velocity_change(tuple(impulse.T), r.T, mobility, inverse_mass, out=v_post.T)
            v_post += v_pre
        return Outcome(v_post, impulse, status)


def _check(v_pre: np.ndarray, r: np.ndarray, mass: float, mu: np.ndarray, epsilon: np.ndarray, space: Space) -> None:
    if v_pre.ndim != 2 or v_pre.shape[1] != space.motions:
        raise ValueError(f"v_pre must have shape (n, {space.motions}), got {v_pre.shape}")
    n = len(v_pre)
    if r.shape != (n, space.dimension):
        raise ValueError(f"r must have shape ({n}, {space.dimension}) like v_pre, got {r.shape}")
    for name, value in (("mu", mu), ("epsilon", epsilon)):
        if value.shape not in ((), (n,)):
            raise ValueError(f"{name} must be a scalar or have shape ({n},), got {value.shape}")
    if not np.all((mu >= 0.0) & (mu < np.inf)):
        raise ValueError("mu must be finite and at least 0")
    if not np.all((epsilon >= 0.0) & (epsilon <= 1.0)):
        raise ValueError("epsilon must lie in [0, 1]")


def _mobility(mass: float, k_g: float | None, inertia: np.ndarray | None, n: int) -> np.ndarray | float:
    """Angular velocity per unit of angular impulse: 1/(m k²) in the plane, (3, 3, n) in space."""
    if inertia is None:
        if not (k_g is not None and mass > 0 and k_g > 0 and np.isfinite(mass) and np.isfinite(k_g)):
            raise ValueError(f"mass and k_g must be positive, got mass={mass}, k_g={k_g}")
        return 1.0 / (mass * k_g * k_g)
    if k_g is not None:
        raise ValueError("give either k_g (in the plane) or inertia (in space), not both")
    G = np.asarray(inertia, dtype=float)
    if G.shape not in ((3, 3), (n, 3, 3)):
        raise ValueError(f"inertia must have shape (3, 3) or ({n}, 3, 3), got {G.shape}")
    if not (mass > 0 and np.isfinite(mass) and np.isfinite(G).all() and np.all(np.linalg.eigvalsh(G) > 0.0)):
        raise ValueError(f"mass and inertia must be positive, got mass={mass}")
    return np.moveaxis(np.broadcast_to(np.linalg.inv(G) / mass, (n, 3, 3)), 0, -1)
