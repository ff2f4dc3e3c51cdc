"""Time stepping of mechanisms with contact: one linear complementarity problem per step (thesis 2.3.1).

    v_free = v_k + h M⁻¹ (g + f_ext - C v_k),     M, C, g, J at (q_k, v_k)
    M (v_{k+1} - v_k) = h (g + f_ext - C v_k + J_n' c_n + J_t' c_t),      q_{k+1} = q_k + h v_{k+1}

A step has contact if φ_free = φ(q_k + h v_free) <= 0 for a pair.  Such pairs are active, and so are pairs that already
touch, φ_k <= `TOUCH`: free motion may open a pair that another pair's impulse keeps closed.  Active pairs obey, with
the friction cone and maximal dissipation as in `lcp`,

    0 <= J_n v_{k+1} - b  ⟂  c_n >= 0,     b = -ε J_n v_k                        if this exceeds v_reb
                                           b = min(J_n v_free - φ_free / h, v_rec)  otherwise.

The first case is Newton's restitution.  In the second case, a support or an impact without rebound, the gap closes: φ,
linearised at the end of the free step, is zero after the step.  (If it were linearised at the start, with φ_k and
J_n v_free instead of φ_free, a curved path would leave the surface in one step and return in the next, and the contact
would chatter.)  An impact without rebound takes two steps: one closes the gap, one stops the motion.  v_rec limits the
speed at which a penetration is undone, and thereby the energy that this can add.

`contact_modes` solves for the active pairs; after a step without solution, the record is NaN.  In flight, mechanisms
with constant M and g take many steps at a time.

Sources: D. E. Stewart, J. C. Trinkle, Int. J. Numer. Methods Eng. 39 (1996); M. Anitescu, F. A. Potra, Nonlinear
Dynamics 14 (1997), doi 10.1023/A:1008292328909; E. Drumwright, Drake's MobyLcpSolver.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.contact_modes import StepSolution, solve_contacts
from thesis_lib.simulate.stepping.lcp import LcpStatus
from thesis_lib.simulate.stepping.multibody import ContactGeometry, Mechanism

MAX_START_DEPTH = 1e-6  # m; allows for rounding of a touching pose
# most flight steps computed ahead at once; with more, most of the work would be discarded at a contact
MAX_FLIGHT = 256

Force = Callable[[float, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class SimulatedMotion:
    """A simulated motion of m steps with all its forces; without hidden forces, the module's equation holds exactly."""

    h: float  # s, time step
    q: np.ndarray  # q, v: (m+1, nv) states; NaN after a step that could not be solved
    v: np.ndarray
    f_ext: np.ndarray  # (m, nv) known external force during step k in N, N m; excludes gravity and contact
    phi: np.ndarray  # (m, p) gaps at q_k in m
    J_n: np.ndarray  # J_n, J_t: (m, p, nv) contact Jacobians at q_k
    J_t: np.ndarray
    c_n: np.ndarray  # c_n, c_t: (m, p) contact forces over step k in N; the impulse is h times the force
    c_t: np.ndarray
    residual: np.ndarray  # (m,) largest violation of the step's complementarity problem, 1; 0 without contact
    status: np.ndarray  # (m,) `LcpStatus` codes

    @property
    def steps(self) -> int:
        """Number of steps m."""
        return len(self.f_ext)

    @property
    def t(self) -> np.ndarray:
        """Times (m+1,) of the states in s."""
        return self.h * np.arange(self.steps + 1)

    @property
    def solved(self) -> bool:
        """Whether a solution was found for every step."""
        return bool((self.status == LcpStatus.SOLVED).all())

    def window(self, start: int, stop: int) -> "SimulatedMotion":
        """Steps start..stop-1 with the stop - start + 1 states around them."""
        if not 0 <= start < stop <= self.steps:
            raise UserError(f"A window of the record must lie in steps 0..{self.steps}; got {start}..{stop}.")
        states = {name: getattr(self, name)[start : stop + 1] for name in ("q", "v")}
        names = ("f_ext", "phi", "J_n", "J_t", "c_n", "c_t", "residual", "status")
        return SimulatedMotion(h=self.h, **states, **{name: getattr(self, name)[start:stop] for name in names})


@dataclass(frozen=True)
class StateTerms:
    """Terms of equation 2.2 that depend only on the state: M⁻¹ (nv, nv), g and C v (nv,), and the contact pairs."""

    M_inv: np.ndarray
    gravity: np.ndarray
    bias: np.ndarray
    contacts: ContactGeometry

    @classmethod
    def of(cls, mechanism: Mechanism, q: np.ndarray, v: np.ndarray) -> "StateTerms":
        M_inv = np.linalg.inv(mechanism.mass_matrix(q))
        return cls(M_inv, mechanism.gravity(q), mechanism.bias(q, v), mechanism.contacts(q))


def step_lcp(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    f_ext: np.ndarray,
    h: float,
    mu: np.ndarray | float,
    epsilon: np.ndarray | float,
    terms: StateTerms | None = None,
) -> tuple[np.ndarray, np.ndarray, StepSolution]:
    """Advance one step from state (q, v) (nv,) under f_ext (nv,) in N, N m.

    `h` is in s; `mu`, `epsilon` are scalars or (p,); `terms` of the state can be passed if several steps start from it.
    Returns q and v (nv,) after the step, NaN if it has no solution, and the contact impulses.
    """
    p = len(mechanism.pairs)
    at = terms or StateTerms.of(mechanism, q, v)
    v_free = v + h * (at.M_inv @ (at.gravity + f_ext - at.bias))
    mu, epsilon = np.broadcast_to(mu, p), np.broadcast_to(epsilon, p)
    out = solve_contacts(mechanism, q, at.M_inv, v, v_free, h, mu, epsilon, at.contacts)
    return q + h * out.v, out.v, out


def simulate(
    mechanism: Mechanism,
    q0: np.ndarray,
    v0: np.ndarray,
    torque: np.ndarray | Force | None,
    h: float,
    steps: int,
    mu: np.ndarray | float,
    epsilon: np.ndarray | float,
    *,
    hidden: Force | None = None,
) -> SimulatedMotion:
    """Simulate `steps` steps from (q0, v0).

    Args:
        q0, v0: (nv,) initial state.
        torque: known external force in N, N m: None, (nv,) constant, (steps, nv), or a function of (t, q, v) at the
            start of a step.
        h, mu, epsilon: time step in s; coefficients of friction and restitution, scalars or (p,).
        hidden: force as a function of (t, q, v) that acts but does not appear in the record's f_ext.

    Raises:
        UserError: a shape, a coefficient or the time step is invalid, or the start is not finite or penetrates.
    """
    p, nv = len(mechanism.pairs), mechanism.nv
    q0, v0 = np.array(q0, dtype=float), np.array(v0, dtype=float)
    _check(mechanism, q0, v0, h, steps, np.asarray(mu, float), np.asarray(epsilon, float))
    out = SimulatedMotion(
        h=float(h),
        q=np.full((steps + 1, nv), np.nan),
        v=np.full((steps + 1, nv), np.nan),
        f_ext=external_force(torque, steps, nv),
        phi=np.full((steps, p), np.nan),
        J_n=np.full((steps, p, nv), np.nan),
        J_t=np.full((steps, p, nv), np.nan),
        c_n=np.zeros((steps, p)),
        c_t=np.zeros((steps, p)),
        residual=np.zeros(steps),
        status=np.full(steps, int(LcpStatus.SOLVED)),
    )
    out.q[0], out.v[0] = q0, v0
    coefficients = np.broadcast_to(np.asarray(mu, float), p), np.broadcast_to(np.asarray(epsilon, float), p)
    force = torque if callable(torque) else None
    reached = _run(mechanism, out, force, hidden, *coefficients)
    if reached:
        contacts = mechanism.contacts_of(out.q[:reached])
        out.phi[:reached], out.J_n[:reached], out.J_t[:reached] = contacts.phi, contacts.J_n, contacts.J_t
    return out


def _run(
    mechanism: Mechanism,
    out: SimulatedMotion,
    force: Force | None,
    hidden: Force | None,
    mu: np.ndarray,
    epsilon: np.ndarray,
) -> int:
    """Fill the record step by step; return the number of steps with a known starting state."""
    h, steps = out.h, out.steps
    constant = mechanism.constant
    M_inv = np.linalg.inv(mechanism.mass_matrix(out.q[0]))
    acceleration = None
    if constant and force is None and hidden is None:
        # M⁻¹ (g + f_ext), known in advance as neither depends on the state
        acceleration = (mechanism.gravity(out.q[0]) + out.f_ext) @ M_inv.T
    k, ahead = 0, 8
    q, v = out.q[0], out.v[0]
    while k < steps:
        if acceleration is not None:
            v_free = v + h * acceleration[k]
        else:
            if force is not None:
                out.f_ext[k] = force(k * h, q, v)
            total = mechanism.gravity(q) + out.f_ext[k]
            if hidden is not None:
                total = total + hidden(k * h, q, v)
            if not constant:
                total = total - mechanism.bias(q, v)
                M_inv = np.linalg.inv(mechanism.mass_matrix(q))
            v_free = v + h * (M_inv @ total)
        step = solve_contacts(mechanism, q, M_inv, v, v_free, h, mu, epsilon)
        q, v = q + h * step.v, step.v
        out.q[k + 1], out.v[k + 1] = q, v
        k += 1
        if step.impulse:
            out.c_n[k - 1], out.c_t[k - 1] = step.c_n / h, step.c_t / h
            out.residual[k - 1], out.status[k - 1] = step.residual, step.status
            if step.status != LcpStatus.SOLVED:
                out.c_n[k:], out.c_t[k:], out.residual[k:], out.status[k:] = (np.nan, np.nan, np.nan, step.status)
                return k
            ahead = 8
        elif acceleration is not None and k < steps:
            n = _fly(mechanism, out, acceleration, k, ahead)
            k, ahead = k + n, min(2 * ahead, MAX_FLIGHT)
            q, v = out.q[k], out.v[k]
    return k


def _fly(mechanism: Mechanism, out: SimulatedMotion, acceleration: np.ndarray, k: int, ahead: int) -> int:
    """Fill up to `ahead` steps without contact from step k on; return their number."""
    h = out.h
    v = out.v[k] + h * np.cumsum(acceleration[k : k + ahead], axis=0)
    q = out.q[k] + h * np.cumsum(v, axis=0)
    touching = (mechanism.contacts_of(q).phi <= 0.0).any(axis=1)  # φ_free, as nothing else acts
    n = int(np.argmax(touching)) if touching.any() else len(v)
    out.q[k + 1 : k + 1 + n], out.v[k + 1 : k + 1 + n] = q[:n], v[:n]
    return n


def external_force(torque: np.ndarray | Force | None, steps: int, nv: int) -> np.ndarray:
    """Known external force (steps, nv) in N, N m from the `torque` of `simulate`; zeros if it is a function.

    Raises:
        UserError: the force has the wrong shape or is not finite.
    """
    if torque is None or callable(torque):
        return np.zeros((steps, nv))
    f_ext = np.asarray(torque, dtype=float)
    if f_ext.shape not in ((nv,), (steps, nv)) or not np.isfinite(f_ext).all():
        raise UserError(
            f"The external force of a simulation must be finite and of shape ({nv},) or ({steps}, {nv}); "
            f"got {f_ext.shape}{'' if np.isfinite(f_ext).all() else ' with NaN or infinity'}."
        )
    return np.array(np.broadcast_to(f_ext, (steps, nv)))


def _check(
    mechanism: Mechanism, q0: np.ndarray, v0: np.ndarray, h: float, steps: int, mu: np.ndarray, epsilon: np.ndarray
) -> None:
    nv, p = mechanism.nv, len(mechanism.pairs)
    for name, value in (("q0", q0), ("v0", v0)):
        if value.shape != (nv,) or not np.isfinite(value).all():
            raise UserError(f"A simulation must start from {nv} finite numbers; {name} is {value}.")
    if not 0.0 < h < np.inf or steps < 1:
        raise UserError(f"A simulation needs a time step above 0 and at least one step; got {h} s, {steps}.")
    for name, value, most in (("mu", mu, np.inf), ("epsilon", epsilon, 1.0)):
        if value.shape not in ((), (p,)) or not ((value >= 0) & (value <= most) & (value < np.inf)).all():
            raise UserError(
                f"{name} must be one number or one for each of the {p} contact pairs, at least 0"
                f"{'' if most == np.inf else ' and at most 1'}; got {value}."
            )
    phi = mechanism.contacts(q0).phi
    if phi.min() < -MAX_START_DEPTH:
        raise UserError(
            f"The simulation starts {-phi.min():.3g} m deep in contact pair "
            f"{mechanism.pairs[int(phi.argmin())]!r}; start it above the surface."
        )
