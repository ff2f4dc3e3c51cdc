"""Reference draw of random impacts, to which the laws' promises and the rates in `Law.breaks` refer.

k² ~ U(0.02, 0.5), r ~ U(−1, 1)², μ ~ U(0, 1.5), ε ~ U(0, 1), m = 1; contact velocity v_t ~ N(0, 1), v_n ~ −|N(0, 1)|,
and ω ~ N(0, 1), on which no impulse depends.  Lengths are then scaled by the radius of gyration, r/k and k ω, so that
impacts of bodies with different k fit in one call (K depends only on r/k).

In space the body's second moments ∫ x_i² dm / m along three random axes are ~ U(0.01, 0.25); k² about an axis is the
sum of the other two, in the range above.  r ~ U(−1, 1)³, and both components of the slip are ~ N(0, 1).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thesis_lib.contact import Law, Outcome, Promise
from thesis_lib.contact.space import contact_space
from thesis_lib.mechanics.contact import Contact, contact_at
from thesis_lib.mechanics.space import SPACE, rotation_matrix

LARGE_MU = 1e3  # represents infinite friction; impacts whose stick impulse lies outside even this cone are left out


@dataclass(frozen=True)
class ImpactDraws:
    """Random impacts (n) of mass 1, in the plane with radius of gyration 1, in space with inertia (n, 3, 3) in m²."""

    v_pre: np.ndarray
    r: np.ndarray
    mu: np.ndarray
    epsilon: np.ndarray
    inertia: np.ndarray | None = None

    @property
    def space(self) -> Contact:
        if self.inertia is None:
            return contact_space(self.v_pre, self.r, mass=1.0, k_g=1.0)
        mobility = np.moveaxis(np.linalg.inv(self.inertia), 0, -1)
        return contact_at(SPACE, self.v_pre.T[:3], self.v_pre.T[3:], self.r.T, mobility)

    @property
    def speed(self) -> np.ndarray:
        """Contact speed: the scale of impulses (m = 1) and velocities."""
        return size(self.space.v)

    @property
    def body(self) -> dict[str, Any]:
        """Properties of the bodies, as arguments of a law."""
        return {"mass": 1.0} | ({"k_g": 1.0} if self.inertia is None else {"inertia": self.inertia})

    def mirrored(self) -> "ImpactDraws":
        """The impacts mirrored at the plane x = 0, which contains the normal: x changes sign."""
        if self.inertia is None:
            return replace(self, v_pre=self.v_pre * [-1, 1, -1], r=self.r * [-1, 1])
        x = np.array([-1, 1, 1])
        v_pre, inertia = self.v_pre * [-1, 1, 1, 1, -1, -1], self.inertia * np.outer(x, x)
        return replace(self, v_pre=v_pre, r=self.r * x, inertia=inertia)

    def __getitem__(self, rows: slice) -> "ImpactDraws":
        """The impacts at `rows`."""
        inertia = None if self.inertia is None else self.inertia[rows]
        return ImpactDraws(self.v_pre[rows], self.r[rows], self.mu[rows], self.epsilon[rows], inertia)

    def resolve(self, law: Law, **changed: np.ndarray | float) -> Outcome:
        state: dict[str, Any] = {"v_pre": self.v_pre, "r": self.r, "mu": self.mu, "epsilon": self.epsilon}
        state |= changed
        v_pre, r = state.pop("v_pre"), state.pop("r")
        return law(v_pre, r, **self.body, **state)

    def impulse(self, law: Law, **changed: np.ndarray | float) -> tuple[np.ndarray, ...]:
        return tuple(self.resolve(law, **changed).impulse.T)


def reference_draw(rng: np.random.Generator, n: int, *, central: bool = False) -> ImpactDraws:
    """Reference draw of n impacts in the plane; `central` puts the centre of mass above the contact (r_x = 0)."""
    k_g = np.sqrt(rng.uniform(0.02, 0.5, n))
    r = rng.uniform(-1.0, 1.0, (n, 2)) * ([0.0, 1.0] if central else [1.0, 1.0]) / k_g[:, None]
    v_t, v_n, omega = rng.standard_normal(n), -np.abs(rng.standard_normal(n)), rng.standard_normal(n)
    v_pre = np.stack([v_t + r[:, 1] * omega, v_n - r[:, 0] * omega, omega], axis=-1)
    return ImpactDraws(v_pre, r, rng.uniform(0.0, 1.5, n), rng.uniform(0.0, 1.0, n))


def reference_draw_in_space(rng: np.random.Generator, n: int, *, central: bool = False) -> ImpactDraws:
    """Reference draw of n impacts in space; `central`: centre of mass above contact, equal inertia for all slips."""
    moments = rng.uniform(0.01, 0.25, (n, 3))
    if central:
        moments[:, 1] = moments[:, 0]
    quaternion = rng.standard_normal((4, n))
    R = rotation_matrix(quaternion / np.linalg.norm(quaternion, axis=0))
    principal = moments.sum(axis=1, keepdims=True) - moments
    inertia = principal[:, :, None] * np.eye(3) if central else np.einsum("ijn,nj,kjn->nik", R, principal, R)
    r = rng.uniform(-1.0, 1.0, (n, 3)) * ([0.0, 0.0, 1.0] if central else [1.0, 1.0, 1.0])
    v, spin = rng.standard_normal((2, n, 3))
    v[:, 2] = -np.abs(v[:, 2])
    v_pre = np.concatenate([v - np.cross(spin, r), spin], axis=1)
    return ImpactDraws(v_pre, r, rng.uniform(0.0, 1.5, n), rng.uniform(0.0, 1.0, n), inertia)


def size(components: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Length (n,) of vectors by component, (d, n) or d of (n,)."""
    return np.hypot.reduce(np.abs(components))


def violation(promise: Promise, law: Law, draw: ImpactDraws, central: ImpactDraws, factor: np.ndarray) -> np.ndarray:
    """Violation of a promise in each impact of a draw, relative to its speed or energy; 0 or less: kept.

    `central` is a draw with r_x = 0, `factor` > 0 scales the velocities of `draw`.  Impacts to which a promise
    does not apply are left out, so the length varies.
    """
    space, speed = draw.space, draw.speed
    match promise:
        case Promise.NON_PENETRATION:
            return -space.velocity_after(*draw.impulse(law))[-1] / speed
        case Promise.FRICTION_CONE:
            *c_t, c_n = draw.impulse(law)
            return np.maximum(size(c_t) - draw.mu * c_n, -c_n) / speed
        case Promise.NO_ENERGY_GAIN:
            return space.alpha(*draw.impulse(law)) - 1.0
        case Promise.HOMOGENEOUS:
            scaled = draw.resolve(law, v_pre=factor[:, None] * draw.v_pre).impulse / factor[:, None]
            return np.linalg.norm(scaled - draw.resolve(law).impulse, axis=1) / speed
        case Promise.FRICTIONLESS:
            *c_t, c_n = draw.impulse(law, mu=0.0)
            return size((*c_t, c_n + (1.0 + draw.epsilon) * space.v_n / space.K_nn)) / speed
        case Promise.PLASTIC:
            return np.abs(space.velocity_after(*draw.impulse(law, epsilon=0.0))[-1]) / speed
        case Promise.CENTRAL:
            space, (*c_t, c_n) = central.space, central.impulse(law)
            *v_t, v_n = space.v
            normal, slip = -(1.0 + central.epsilon) * v_n, size(v_t)
            friction = np.minimum(central.mu * normal, slip / space.K[0][0])
            off = [c + friction * np.divide(v, slip, out=np.zeros_like(v), where=slip > 0.0) for c, v in zip(c_t, v_t)]
            return size((*off, c_n - normal)) / central.speed
        case Promise.STICKS:
            *stick_t, stick_n = space.impulse_to(*np.zeros(space.dimension))
            left = size(space.velocity_after(*draw.impulse(law, mu=LARGE_MU, epsilon=0.0)))
            return (left / speed)[size(stick_t) <= LARGE_MU * stick_n]
    raise AssertionError(promise)
