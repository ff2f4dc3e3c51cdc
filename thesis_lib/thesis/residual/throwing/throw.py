"""Simulation of throws of many particles at once, flight by flight and impact by impact, until they are at rest.

Each round moves all particles to their next contact: flight in closed form to the first touch
(`flight.first_touch`), then one call of the impact model.  Two corners that hit within a step take two rounds, the
second with a flight of zero length; at a tie, the faster corner is first.  A round is the integral over the earlier
state (thesis, eq. 4.17) by samples: every particle draws its own next state.

A particle is at rest once it can no longer leave its side.  After each impact,

    E = (v_y² + k² ω²)/2 + g (y − y_side)  <  f g (y_corner − y_side)

with y_corner the height of the centre above the surface on the lower of the side's two corners; f (setting `settle`) is
small, so the omitted hops are negligible.  The infinitely many hops of a real bounce (Zeno) end here: friction at the
mean impulse of many small hops equals sliding friction, so the remaining v_x is lost at the rate μ g + c_v v_x, over

    Δx = sign(v_x) (|v_x|/c_v − (μ g/c_v²) ln(1 + c_v |v_x|/(μ g)))         (v_x²/(2 μ g) where c_v → 0)

and the angle becomes that of the side.  A body that tips over a corner, or slides on it, has lasting contact, which in
impacts is again infinitely many.  As in Mirtich's microcollisions, contacts slower than `micro` have restitution 1:
hops stay small, gain no energy, and transmit weight and friction on average.  Particles that still move
after `max_contacts` contacts are counted and put on their nearest side.

In code, f is `settle` and μ `mu_slide`; poses are in m and rad, velocities in m/s and rad/s.

Sources: Mirtich 1996 (impulse-based simulation), thesis section 4.3.3.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thesis_lib.contact.law import Law
from thesis_lib.contact.space import contact_space
from thesis_lib.effects.effect import Effect, Impulse, Parameters, Rig
from thesis_lib.mechanics.contact import Contact, velocity_change
from thesis_lib.mechanics.state import State
from thesis_lib.thesis.residual.throwing.flight import ThrownBody, first_touch, fly
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings

# Model that resolves one contact of each of n particles, called as model(q, v, r, slow, rng): pose and velocity
# (n, 3) at the touch, contact point r (n, 2), and a mask (n,) of contacts that must keep their energy (see above).
# It returns pose and velocity (n, 3) after contact, and the duration (n,) in s, 0 for an impulse.
ImpactModel = Callable[..., tuple[np.ndarray, np.ndarray, np.ndarray | float]]


@dataclass(frozen=True)
class LawImpact:
    """An `ImpactModel` by a law with constant parameters for a body with radius of gyration `k_g` (m).

    `effects`, with their parameters, act on (μ, ε) and on the impulse; `rig` is the body and set-up that they use.
    """

    law: Law
    mu: float
    epsilon: float
    k_g: float
    effects: tuple[tuple[Effect, Parameters], ...] = ()
    rig: Rig | None = None

    def __call__(
        self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray, rng: np.random.Generator | None = None
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the unchanged pose, the velocity after impact, and zero duration; a law does not use `rng`."""
        with np.errstate(all="ignore"):
            space = contact_space(v, r, mass=1.0, k_g=self.k_g)
            if self.effects:
                return q, push(v, r, self._with_effects(space, q, v, slow), self.k_g), 0.0
            c_t, c_n = self.law.impulse(space, self.mu, np.where(slow, 1.0, self.epsilon))
        return q, push(v, r, np.stack([c_t, c_n], axis=1), self.k_g), 0.0

    def _with_effects(self, contact: Contact, q: np.ndarray, v: np.ndarray, slow: np.ndarray) -> np.ndarray:
        """Impulse per unit mass and couple about r, (n, 3)."""
        assert self.rig is not None
        zero, middle = np.zeros(len(q)), self.rig.reference
        state = State.of(q, v, zero + middle.trial, zero + middle.t)
        mu, epsilon = np.full(len(q), self.mu), np.full(len(q), self.epsilon)
        for effect, p in self.effects:
            mu, epsilon = effect.coefficients(mu, epsilon, contact, state, p, self.rig)
        epsilon = np.where(slow, 1.0, epsilon)
        contact = contact.with_coefficients(mu, epsilon)
        impulse = Impulse(self.law.impulse(contact, mu, epsilon), zero)
        for effect, p in self.effects:
            impulse = effect.impulse(impulse, contact, state, p, self.rig)
        return np.stack([*impulse.c, impulse.couple], axis=1)


def push(v: np.ndarray, r: np.ndarray, impulse: np.ndarray, k_g: float) -> np.ndarray:
    """Velocity v⁺ = v + M⁻¹ Jᵀ c after impulses per unit mass (n, 2) = (c_t, c_n), or (n, 3) with a couple about r."""
    couple = impulse[:, 2] if impulse.shape[1] == 3 else None
    return v + velocity_change((impulse[:, 0], impulse[:, 1]), r.T, 1.0 / (k_g * k_g), couple=couple).T


@dataclass(frozen=True)
class Throws:
    """Results of n throws: final states, and states after the first contacts."""

    q: np.ndarray  # (n, 3) pose at rest; θ includes whole turns
    face: np.ndarray  # (n,) side on which it lies
    settled: np.ndarray  # (n,) whether the criterion of rest was met (else: put on a side after `max_contacts`)
    contacts: np.ndarray  # (n,) number of contacts, nearby hits merged
    # snapshot_q, snapshot_v: (snapshots, n, 3) just after the last hit of each of the first contacts; else NaN
    snapshot_q: np.ndarray
    snapshot_v: np.ndarray
    snapshot_t: np.ndarray  # (snapshots, n) time in s


def simulate_throws(
    body: ThrownBody,
    q: np.ndarray,
    v: np.ndarray,
    impact: ImpactModel,
    mu_slide: float,
    settings: ThrowSettings,
    rng: np.random.Generator,
) -> Throws:
    """Simulate n particles from pose `q` and velocity `v` (n, 3), all above the surface, until they are at rest."""
    n, kept = len(q), settings.snapshots
    q, v = np.array(q, float), np.array(v, float)
    contacts, settled = np.zeros(n, int), np.zeros(n, bool)
    snap_q, snap_v, snap_t = (np.full((kept, n, *more), np.nan) for more in ((3,), (3,), ()))
    clock, last, moving = np.zeros(n), np.full(n, -np.inf), np.arange(n)
    for _ in range(settings.max_contacts):
        if not len(moving):
            break
        q_m, v_m, t, _ = _next_contact(body, q[moving], v[moving], np.full(len(moving), np.inf), impact, settings, rng)
        q[moving], v[moving] = q_m, v_m
        clock[moving] += t
        contacts[moving] += clock[moving] - last[moving] > settings.merge
        last[moving] = clock[moving]
        shown = moving[contacts[moving] <= kept]
        if len(shown):
            which = contacts[shown] - 1
            snap_q[which, shown], snap_v[which, shown] = q[shown], v[shown]
            snap_t[which, shown] = clock[shown]
        rest = lies(body, q_m, v_m, settings.settle)
        settled[moving[rest]] = True
        moving = moving[~rest]
    face = body.face(q[:, 2])
    turned = np.mod(q[:, 2] - body.faces[face] + np.pi, 2.0 * np.pi) - np.pi
    slid = slide(v[:, 0], mu_slide * body.gravity, body.c_v)
    end = np.stack([q[:, 0] + slid, body.height + body.rest_height[face], q[:, 2] - turned], axis=1)
    return Throws(end, face, settled, contacts, snap_q, snap_v, snap_t)


def state_at(
    body: ThrownBody, q: np.ndarray, v: np.ndarray, until: np.ndarray, impact: LawImpact, settings: ThrowSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate to the times `until` (n,) in s; pose and velocity (n, 3), NaN beyond `max_contacts`."""
    n = len(q)
    q, v, remaining = np.array(q, float), np.array(v, float), np.array(np.broadcast_to(until, n), float)
    moving = np.arange(n)
    for _ in range(settings.max_contacts):
        if not len(moving):
            break
        states = q[moving], v[moving], remaining[moving]
        q[moving], v[moving], t, touches = _next_contact(body, *states, impact, settings)
        remaining[moving] -= t
        moving = moving[touches]
    q[moving], v[moving] = np.nan, np.nan
    return q, v


def _next_contact(
    body: ThrownBody,
    q: np.ndarray,
    v: np.ndarray,
    left: np.ndarray,
    impact: ImpactModel,
    settings: ThrowSettings,
    rng: np.random.Generator | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Simulate to the end of the next contact, or for `left` (n,) in s if that is earlier; pose and velocity (n, 3).

    Also return the time (n,) in s of flight and contact, and a mask (n,) of the particles that touch.
    """
    t, corner = first_touch(body, q, v)
    touches = t < left
    t = np.minimum(t, left)
    q, v = fly(body, q, v, t)
    if touches.any():
        on = slice(None) if touches.all() else touches
        r = body.contact_point(q[on, 2], corner[on])
        slow = -(v[on, 1] + r[:, 0] * v[on, 2]) < settings.micro
        q[on], v[on], took = impact(q[on], v[on], r, slow, rng)
        t[on] += took
    return q, v, t, touches


def lies(body: ThrownBody, q: np.ndarray, v: np.ndarray, settle: float) -> np.ndarray:
    """Mask (n,) of bodies that can no longer leave their side (see the module)."""
    above = q[:, 1] - body.height - body.rest_height[body.face(q[:, 2])]
    energy = 0.5 * (v[:, 1] ** 2 + (body.k_g * v[:, 2]) ** 2) + body.gravity * above
    return energy < settle * body.gravity * body.barrier


def slide(speed: np.ndarray, friction: float, drag: float) -> np.ndarray:
    """Distance (n,) in m over which friction (m/s²) and linear drag (1/s) stop `speed` (n,) in m/s."""
    v = np.abs(speed)
    if drag * np.max(v, initial=0.0) < 1e-6 * friction:
        return speed * v / (2.0 * friction)
    return np.sign(speed) * (v / drag - friction / drag**2 * np.log1p(drag * v / friction))
