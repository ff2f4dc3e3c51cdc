"""Drops of a planar body onto a level surface, by time stepping with contact impulses from an LCP.

All drops are advanced at once with a fixed h.  Contact Jacobians come from a Drake plant (plant.py), the impulse from
the Anitescu-Potra LCP (lcp.py).  Within a step:

    flight   q(t) = q + v t + a t²/2,  v(t) = v + a t,  a = M⁻¹ τ_g     exact, since a is constant
    impact   a flight that ends with φ_n < 0 is cut at φ_n(t) = 0 (Newton inside a bracket, φ̇_n = J_n v); there
             v ← v + M⁻¹ J' c,  c from the LCP with K = J M⁻¹ J'; the rest of the step is flight again
    support  a contact slower than `V_PLASTIC` is plastic and held for the rest of the step: an Anitescu-Potra step,
             v ← v + a h + M⁻¹ J' c with ε = 0 and v_n after it >= 0, q ← q + h v, J taken half a step ahead

Impacts do not depend on h; support depends on h to first order.  Plastic slow contacts end the infinite sequence of
ever smaller bounces.  After support, a body that has drifted into the surface (third order in h) is lifted to it.

`rng` spawns one stream for releases and one for measurement noise.  Each is drawn as one block in the order of the
drops; drop i therefore does not depend on the number of drops.

Sources: thesis chapter 3 (experiment); Anitescu and Potra 1997, doi 10.1023/A:1008292328909; Stewart and Trinkle 1996,
doi 10.1002/(SICI)1097-0207(19960815)39:15<2673::AID-NME972>3.0.CO;2-I (time stepping of support).
"""

import math
from enum import IntEnum

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.bodies.shapes import Shape
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.rig.record import (
    CONTACT,
    DropsWithTruth,
    as_dataset,
    check_request,
    contact_columns,
    contact_table,
    sample_times,
    trial_table,
)
from thesis_lib.simulate.rig.release import Release
from thesis_lib.simulate.stepping.lcp import ContactImpulse, LcpStatus, impact
from thesis_lib.simulate.stepping.plant import PlanarPlant

V_PLASTIC = 0.05  # m/s; a slower contact rebounds by at most v²/2g = 0.13 mm, below motion-capture noise
GAP_TOL = 1e-13  # m; accepted |φ_n| at contact; rounding errors of a pose of about 1 m are 1e-16
V_LEAVING = 1e-9  # m/s; a body on the surface leaves it above this upward speed
MAX_IMPACTS = 20  # most impacts of one drop in one step
MAX_NEWTON = 80  # most iterations; bisection alone needs 50

TRUTH = (*CONTACT, "energy_change", "residual", "status")


class DropStatus(IntEnum):
    """Outcome of one drop."""

    DONE = 0
    CLUSTERED = 1  # more than MAX_IMPACTS impacts in one step; the rest of the step was treated as support
    LCP_FAILED = 2  # no impulse was found; the trajectory ends there


def simulate_drops(
    body: Body,
    release: Release,
    n: int,
    *,
    mu: np.ndarray | float,
    epsilon: np.ndarray | float,
    gravity: float = 9.81,
    dt: float = 1e-3,
    duration: float = 0.8,
    rate: float = 250.0,
    noise: Noise | None = None,
    rng: np.random.Generator,
) -> DropsWithTruth:
    """Release n bodies over the surface y = 0 and record their poses.

    `mu` and `epsilon` are scalars or (n,); `gravity` is in m/s², `dt` is the largest time step in s (the step used
    divides the sampling period).  Samples are at 0, 1/rate, ... up to `duration` (Hz, s); `noise`: `compliant.drops`.

    Returns:
        Drops whose `impacts` (above the plastic limit, and failed solutions) also have residual (1) and status
        (`LcpStatus`), and whose `trials` have impacts (their number), t_support (s, time of the first supported step;
        NaN: none) and status (`DropStatus`).

    Raises:
        UserError: the body has no mass, an argument is out of range, or a release touches the surface.
    """
    mu, epsilon = np.asarray(mu, dtype=float), np.asarray(epsilon, dtype=float)
    reach = body.shape.extent
    check_request(body, release, reach, n=n, gravity=gravity, dt=dt, duration=duration, rate=rate)
    if not ((mu >= 0) & (mu < np.inf)).all() or not ((epsilon >= 0) & (epsilon <= 1)).all():
        raise UserError("Simulated drops need mu >= 0 and epsilon between 0 and 1; a given value is out of range.")
    release_rng, noise_rng = rng.spawn(2)
    q, v = release.draw(n, release_rng)
    simulation = _Simulation(body, q, v, np.broadcast_to(mu, n), np.broadcast_to(epsilon, n), gravity)

    substeps = math.ceil(1.0 / (rate * dt) - 1e-9)
    poses = np.empty((n, len(sample_times(duration, rate)), 3))
    poses[:, 0] = q
    for k in range(1, poses.shape[1]):
        for i in range(substeps):
            simulation.step(((k - 1) + i / substeps) / rate, 1.0 / (rate * substeps))
        poses[:, k] = np.where(simulation.alive[:, None], simulation.q, np.nan)

    text = f"{n} simulated drops (Anitescu-Potra LCP with Newton restitution)"
    dataset = as_dataset(poses, text, body, gravity, rate, noise, noise_rng)
    impacts = contact_table(simulation.contacts, TRUTH, {"status": int})
    count = np.bincount(impacts["trial"], minlength=n)
    trials = trial_table(q, v, impacts=count, t_support=simulation.t_support, status=simulation.status)
    return DropsWithTruth(*dataset, impacts, trials)


class _Simulation:
    """State of n drops, and the record of their impacts."""

    def __init__(
        self, body: Body, q: np.ndarray, v: np.ndarray, mu: np.ndarray, epsilon: np.ndarray, gravity: float
    ) -> None:
        n = len(q)
        self.shape: Shape = body.shape
        self.plant, mass = PlanarPlant(), body.mass or 0.0  # `check_request` rejects bodies without a mass
        # M and the acceleration in flight are the same at every pose of a single free body
        self.M = np.diag([mass, mass, mass * body.radius_of_gyration**2])
        self.a = np.linalg.solve(self.M, [0.0, -mass * gravity, 0.0])
        self.q, self.v, self.mu, self.epsilon = q.copy(), v.copy(), mu, epsilon
        self.status = np.full(n, DropStatus.DONE, dtype=int)
        self.t_support = np.full(n, np.nan)
        self.contacts: list[dict[str, np.ndarray]] = []

    @property
    def alive(self) -> np.ndarray:
        """Mask (n,) of the drops for which an impulse was found at every contact so far."""
        return self.status != DropStatus.LCP_FAILED

    def step(self, t: float, h: float) -> None:
        """Advance every drop from time `t` by `h`, in s."""
        q, v = self._fly(self.q, self.v, np.full(len(self.q), h))
        touches = (self.shape.gap(q[:, 1], q[:, 2]) < 0.0) & self.alive
        flies = self.alive & ~touches
        self.q[flies], self.v[flies] = q[flies], v[flies]

        rows = np.flatnonzero(touches)
        rest = np.full(len(rows), h)  # remaining time of flight in the step
        for contact in range(MAX_IMPACTS + 1):
            if not len(rows):
                break
            t_c = self._time_of_contact(self.q[rows], self.v[rows], rest)
            self.q[rows], self.v[rows] = self._fly(self.q[rows], self.v[rows], t_c)
            rest = rest - t_c
            fast = self._gap_rate(self.q[rows], self.v[rows]) < -V_PLASTIC
            if contact == MAX_IMPACTS:
                self.status[rows[fast]] = DropStatus.CLUSTERED
                fast[:] = False
            self._support(rows[~fast], rest[~fast], t + h - rest[~fast])
            rows, rest = rows[fast], rest[fast]
            self._impact(rows, t + h - rest)
            rows, rest = rows[self.alive[rows]], rest[self.alive[rows]]
            q, v = self._fly(self.q[rows], self.v[rows], rest)
            again = self.shape.gap(q[:, 1], q[:, 2]) < 0.0
            self.q[rows[~again]], self.v[rows[~again]] = q[~again], v[~again]
            rows, rest = rows[again], rest[again]

    def _fly(self, q: np.ndarray, v: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = t[:, None]
        return q + v * t + 0.5 * self.a * t**2, v + self.a * t

    def _gap_rate(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        # φ̇_n = J_n v; the motion of the lowest point along a level surface does not change the gap
        return v[:, 1] + self.shape.contact_point(q[:, 2])[:, 0] * v[:, 2]

    def _time_of_contact(self, q: np.ndarray, v: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """Time (n,) in [0, rest] at which a flight that ends below the surface reaches it from above.

        Newton's iteration inside a bracket.  A body that leaves the surface at the start counts as above it; after a
        bounce, the time of the next touch is therefore found.
        """
        low, high = np.zeros_like(rest), rest.copy()
        above = (self.shape.gap(q[:, 1], q[:, 2]) > GAP_TOL) | (self._gap_rate(q, v) > V_LEAVING)
        t = np.where(above, 0.5 * rest, 0.0)
        todo = np.arange(len(t))
        for _ in range(MAX_NEWTON):
            q_t, v_t = self._fly(q[todo], v[todo], t[todo])
            gap, rate = self.shape.gap(q_t[:, 1], q_t[:, 2]), self._gap_rate(q_t, v_t)
            below = gap < 0.0
            low[todo[~below]], high[todo[below]] = t[todo[~below]], t[todo[below]]
            going = (np.abs(gap) > GAP_TOL) | (rate > V_LEAVING)
            todo, gap, rate = todo[going], gap[going], rate[going]
            if not len(todo):
                break
            newton = t[todo] - gap / np.where(rate < 0.0, rate, -1.0)
            good = (rate < 0.0) & (newton > low[todo]) & (newton < high[todo])
            t[todo] = np.where(good, newton, 0.5 * (low[todo] + high[todo]))
        t[todo] = low[todo]  # not converged (grazing contact, or the start itself): use the end above the surface
        return t

    def _impulse(
        self, rows: np.ndarray, q: np.ndarray, v: np.ndarray, epsilon: np.ndarray
    ) -> tuple[ContactImpulse, np.ndarray]:
        """Impulse at poses q of drops `rows` with velocities v, and the velocities after it (n, 3)."""
        J = self.plant.contact_jacobian(q, self.shape.contact_point(q[:, 2]))
        out, v_post = impact(self.M, J, v, self.mu[rows], epsilon)
        self.status[rows[out.status != LcpStatus.SOLVED]] = DropStatus.LCP_FAILED
        return out, v_post

    def _impact(self, rows: np.ndarray, t: np.ndarray) -> None:
        if not len(rows):
            return
        q, v = self.q[rows], self.v[rows]
        out, v_post = self._impulse(rows, q, v, self.epsilon[rows])
        before, after = (0.5 * np.einsum("ni,ij,nj->n", u, self.M, u) for u in (v, v_post))
        r = self.shape.contact_point(q[:, 2])
        more = {"energy_change": after - before, "residual": out.residual, "status": out.status}
        self.contacts.append(contact_columns(rows, t, (q, v, v_post), r, out.c, **more))
        self.v[rows] = v_post

    def _support(self, rows: np.ndarray, rest: np.ndarray, t: np.ndarray) -> None:
        if not len(rows):
            return
        q, v = self.q[rows], self.v[rows]
        ahead = q + 0.5 * rest[:, None] * v  # J half a step ahead; drift along a curve is then O(h³) per step
        _, v = self._impulse(rows, ahead, v + self.a * rest[:, None], np.zeros(len(rows)))
        q = q + rest[:, None] * v
        q[:, 1] -= np.minimum(self.shape.gap(q[:, 1], q[:, 2]), 0.0)
        self.q[rows], self.v[rows] = q, v
        self.t_support[rows] = np.fmin(self.t_support[rows], t)
