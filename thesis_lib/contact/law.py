"""What an impact law is: a name, an impulse for (contact space, μ, ε), and the promises that it keeps.

A law never fails in silence: every impact gets a status.  `Law.impulse` broadcasts, so that a whole grid of parameters
(G, 1) against n impacts (n,) is one call; calling the law itself checks its input first.
"""

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.mechanics.contact import Contact, contact_at, velocity_change
from thesis_lib.mechanics.space import PLANE

if TYPE_CHECKING:  # numba comes with it
    from thesis_lib.contact.compliant.normal_force import NormalForce


class Status(enum.IntEnum):
    """What a law made of an impact."""

    OK = 0
    NOT_APPROACHING = 1  # v_n ≥ 0 before impact: there is nothing to resolve, the impulse is zero
    NO_SOLUTION = 2  # the law has no finite impulse for this state
    INVALID_INPUT = 3  # NaN or infinity in the state; the outcome is NaN


class Promise(enum.StrEnum):
    """Properties that a law may promise; momentum holds for all, mirror symmetry wherever the impulse pushes."""

    NON_PENETRATION = "v_n⁺ ≥ 0"
    FRICTION_CONE = "|c_t| ≤ μ c_n, c_n ≥ 0"
    NO_ENERGY_GAIN = "α ≤ 1"
    HOMOGENEOUS = "the impulse is homogeneous of degree 1 in the velocity"
    FRICTIONLESS = "μ = 0 gives c_t = 0 and c_n = −(1 + ε) v_n / K_nn"
    PLASTIC = "ε = 0 gives v_n⁺ = 0"
    CENTRAL = "central impacts agree: c_n = −(1 + ε) m v_n, |c_t| = min(μ c_n, |v_t| / K_tt)"
    STICKS = "large μ and ε = 0 take all contact velocity"


ImpulseFunction = Callable[[Contact, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Outcome:
    """Result of n impacts.

    Attributes:
        v_post: (n, 3) velocity after impact, m/s and rad/s.
        impulse: (n, 2) impulse (c_t, c_n), N s.
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
        title: as in tables and figures.
        impulse: (space, mu, epsilon) -> (c_t, c_n) in N s, arrays that broadcast; for approaching contacts (v_n < 0).
        promises: what holds for every impact.
        breaks: promises that it breaks, with the share of impacts in which it does (in the tests' reference draw).
        reference: where the law is defined.
        mu_unit: unit of μ; "1" except for the viscous variant.
        force: of a contact that takes time, whose limit `impulse` is.
        engine: physics engine whose own contact takes the place of `force`, which is near it; "" for a law.
    """

    name: str
    title: str
    impulse: ImpulseFunction
    promises: frozenset[Promise]
    reference: str
    breaks: Mapping[Promise, float] = field(default_factory=lambda: MappingProxyType({}))
    mu_unit: str = "1"
    force: "NormalForce | None" = None
    engine: str = ""

    @property
    def as_published(self) -> bool:
        """Whether this is the authors' code rather than the law that it is named after."""
        return self.name.endswith("_as_published")

    def __call__(
        self,
        v_pre: np.ndarray,
        r: np.ndarray,
        *,
        mass: float,
        k_g: float,
        mu: float | np.ndarray,
        epsilon: float | np.ndarray,
    ) -> Outcome:
        """Resolve n impacts at once.

        Args:
            v_pre: (n, 3) velocity (v_x, v_y, ω) before impact, m/s and rad/s.
            r: (n, 2) contact point from the centre of mass, m.
            mass: kg.
            k_g: radius of gyration, m.
            mu: coefficient of friction, scalar or (n,).
            epsilon: coefficient of restitution, scalar or (n,).

        Raises:
            ValueError: wrong shapes, mass or k_g not positive, μ < 0, ε outside [0, 1], or either NaN.
        """
        v_pre, r = np.asarray(v_pre, dtype=float), np.asarray(r, dtype=float)
        mu, epsilon = np.asarray(mu, dtype=float), np.asarray(epsilon, dtype=float)
        _check(v_pre, r, mass, k_g, mu, epsilon)
        with np.errstate(all="ignore"):  # the status says what went wrong
            w, w_I = 1.0 / mass, 1.0 / (mass * k_g * k_g)
            space = contact_at(PLANE, v_pre.T[:2], v_pre.T[2:], r.T, w_I, w)
            c_t, c_n = self.impulse(space, mu, epsilon)
            status = np.zeros(len(v_pre), dtype=np.int8)
            # an infinite velocity can give a finite impulse: look at the input, too
            if not np.isfinite(c_t.sum() + c_n.sum() + v_pre.sum() + r.sum()):
                status[~(np.isfinite(c_t) & np.isfinite(c_n))] = Status.NO_SOLUTION
                valid = np.isfinite(v_pre).all(axis=1) & np.isfinite(r).all(axis=1)
                status[~valid] = Status.INVALID_INPUT
                failed = status != Status.OK
                c_t, c_n = np.where(failed, np.nan, c_t), np.where(failed, np.nan, c_n)
            away = space.v_n >= 0.0
            if away.any():
                away &= status != Status.INVALID_INPUT
                status[away] = Status.NOT_APPROACHING
                c_t, c_n = np.where(away, 0.0, c_t), np.where(away, 0.0, c_n)
            impulse = np.empty((len(v_pre), 2))
            impulse[:, 0], impulse[:, 1] = c_t, c_n
            v_post = np.empty((len(v_pre), 3))
            velocity_change((c_t, c_n), r.T, w_I, w, out=v_post.T)  # v⁺ = v + M⁻¹ Jᵀ c (eq. 3.2)
            v_post += v_pre
        return Outcome(v_post, impulse, status)


def _check(v_pre: np.ndarray, r: np.ndarray, mass: float, k_g: float, mu: np.ndarray, epsilon: np.ndarray) -> None:
    if v_pre.ndim != 2 or v_pre.shape[1] != 3:
        raise ValueError(f"v_pre must have shape (n, 3), got {v_pre.shape}")
    n = len(v_pre)
    if r.shape != (n, 2):
        raise ValueError(f"r must have shape ({n}, 2) like v_pre, got {r.shape}")
    if not (mass > 0 and k_g > 0 and np.isfinite(mass) and np.isfinite(k_g)):
        raise ValueError(f"mass and k_g must be positive, got mass={mass}, k_g={k_g}")
    for name, value in (("mu", mu), ("epsilon", epsilon)):
        if value.shape not in ((), (n,)):
            raise ValueError(f"{name} must be a scalar or have shape ({n},), got {value.shape}")
    if not np.all((mu >= 0.0) & (mu < np.inf)):
        raise ValueError("mu must be finite and at least 0")
    if not np.all((epsilon >= 0.0) & (epsilon <= 1.0)):
        raise ValueError("epsilon must lie in [0, 1]")
