"""The reference draw of random impacts that the laws' promises and the rates in `Law.breaks` refer to.

k² ~ U(0.02, 0.5), r ~ U(−1, 1)², μ ~ U(0, 1.5), ε ~ U(0, 1), m = 1; contact velocity v_t ~ N(0, 1), v_n ~ −|N(0, 1)|,
and ω ~ N(0, 1), on which no impulse depends.  Lengths are then counted in radii of gyration, r/k and k ω, so that
impacts of bodies with different k fit in one call (K depends on r/k alone).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from thesis_lib.contact import Law, Outcome, Promise
from thesis_lib.contact.space import contact_space
from thesis_lib.mechanics.contact import Contact

LARGE_MU = 1e3  # stands for infinite friction; a stick impulse outside even this cone is left out


@dataclass(frozen=True)
class ImpactDraws:
    """n random impacts with mass 1 and radius of gyration 1."""

    v_pre: np.ndarray
    r: np.ndarray
    mu: np.ndarray
    epsilon: np.ndarray

    @property
    def space(self) -> Contact:
        return contact_space(self.v_pre, self.r, mass=1.0, k_g=1.0)

    @property
    def speed(self) -> np.ndarray:
        """Contact speed: the scale of impulses (m = 1) and velocities."""
        return np.hypot(self.space.v_t, self.space.v_n)

    def resolve(self, law: Law, **changed: np.ndarray | float) -> Outcome:
        state: dict[str, Any] = {"v_pre": self.v_pre, "r": self.r, "mu": self.mu, "epsilon": self.epsilon}
        state |= changed
        v_pre, r = state.pop("v_pre"), state.pop("r")
        return law(v_pre, r, mass=1.0, k_g=1.0, **state)

    def impulse(self, law: Law, **changed: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        return tuple(self.resolve(law, **changed).impulse.T)


def reference_draw(rng: np.random.Generator, n: int, *, central: bool = False) -> ImpactDraws:
    """n impacts of the reference draw; `central` puts the centre of mass above the contact (r_x = 0)."""
    k_g = np.sqrt(rng.uniform(0.02, 0.5, n))
    r = rng.uniform(-1.0, 1.0, (n, 2)) * ([0.0, 1.0] if central else [1.0, 1.0]) / k_g[:, None]
    v_t, v_n, omega = rng.standard_normal(n), -np.abs(rng.standard_normal(n)), rng.standard_normal(n)
    v_pre = np.stack([v_t + r[:, 1] * omega, v_n - r[:, 0] * omega, omega], axis=-1)
    return ImpactDraws(v_pre, r, rng.uniform(0.0, 1.5, n), rng.uniform(0.0, 1.0, n))


def violation(promise: Promise, law: Law, draw: ImpactDraws, central: ImpactDraws, factor: np.ndarray) -> np.ndarray:
    """How far each impact of a draw is from keeping a promise, relative to its speed or energy; 0 or less: kept.

    `central` is a draw with r_x = 0, `factor` > 0 scales the velocities of `draw`.  Impacts to which a promise
    does not apply are left out, so the length varies.
    """
    space, speed = draw.space, draw.speed
    match promise:
        case Promise.NON_PENETRATION:
            return -space.velocity_after(*draw.impulse(law))[1] / speed
        case Promise.FRICTION_CONE:
            c_t, c_n = draw.impulse(law)
            return np.maximum(np.abs(c_t) - draw.mu * c_n, -c_n) / speed
        case Promise.NO_ENERGY_GAIN:
            return space.alpha(*draw.impulse(law)) - 1.0
        case Promise.HOMOGENEOUS:
            scaled = draw.resolve(law, v_pre=factor[:, None] * draw.v_pre).impulse / factor[:, None]
            return np.linalg.norm(scaled - draw.resolve(law).impulse, axis=1) / speed
        case Promise.FRICTIONLESS:
            c_t, c_n = draw.impulse(law, mu=0.0)
            return np.hypot(c_t, c_n + (1.0 + draw.epsilon) * space.v_n / space.K_nn) / speed
        case Promise.PLASTIC:
            return np.abs(space.velocity_after(*draw.impulse(law, epsilon=0.0))[1]) / speed
        case Promise.CENTRAL:
            space, (c_t, c_n) = central.space, central.impulse(law)
            normal = -(1.0 + central.epsilon) * space.v_n
            tangential = -np.sign(space.v_t) * np.minimum(central.mu * normal, np.abs(space.v_t) / space.K_tt)
            return np.hypot(c_t - tangential, c_n - normal) / central.speed
        case Promise.STICKS:
            stick_t, stick_n = space.impulse_to(0.0, 0.0)
            left = np.hypot(*space.velocity_after(*draw.impulse(law, mu=LARGE_MU, epsilon=0.0)))
            return (left / speed)[np.abs(stick_t) <= LARGE_MU * stick_n]
    raise AssertionError(promise)
