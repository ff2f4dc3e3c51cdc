"""Motions for the tests of chapter 2's simulation; each is checked in every step."""

import numpy as np

from thesis_lib.simulate.mechanisms.motions import block, disk, ellipse, rod
from thesis_lib.simulate.stepping.contact_modes import TOUCH, V_REBOUND
from thesis_lib.simulate.stepping.lcp import LcpStatus
from thesis_lib.simulate.stepping.multibody import Mechanism
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate

RESIDUAL_TOL = 1e-9  # promised complementarity of every step, dimensionless; rounding leaves about 1e-15
BALANCE_TOL = 1e-9  # N s; momentum balance of every step, of impulses up to 10 N s
CLOSING_TOL = 1e-12  # m; rounding of gaps of some metres
REBOUND_TOL = 1e-9  # m/s; rounding, of two contacts that are solved together
SLIDES = 1e-9  # m/s; a contact that sticks moves by rounding
EDGE_TOL = 1e-7  # N
MU, EPSILON, G, H = 0.7, 0.6, 9.81, 5e-3

BODIES = {"block": block(), "ellipse": ellipse(), "disk": disk(), "rod": rod()}  # of 1 kg; sizes of 0.5 to 2 m


def balance(mechanism: Mechanism, record: SimulatedMotion) -> np.ndarray:
    """M (v⁺ - v) - h (g + f_ext - C v + J' c) of each step, (m, nv) in N s."""
    M = np.array([mechanism.mass_matrix(q) for q in record.q[:-1]])
    force = np.array([mechanism.gravity(q) - mechanism.bias(q, v) for q, v in zip(record.q[:-1], record.v[:-1])])
    force += record.f_ext + contact_force(record)
    return np.einsum("kij,kj->ki", M, np.diff(record.v, axis=0)) - record.h * force


def contact_force(record: SimulatedMotion) -> np.ndarray:
    """J_n' c_n + J_t' c_t, (m, nv) in N, N m."""
    return np.einsum("kpi,kp->ki", record.J_n, record.c_n) + np.einsum("kpi,kp->ki", record.J_t, record.c_t)


def checked(mechanism, q, v, steps, mu=MU, epsilon=EPSILON, h=H, torque=None, **options) -> SimulatedMotion:
    """Simulate, and hold every step to complementarity, the cone, Newton's restitution and the balance of momentum."""
    record = simulate(mechanism, np.array(q, float), np.array(v, float), torque, h, steps, mu, epsilon, **options)
    assert (record.status == LcpStatus.SOLVED).all()
    assert record.residual.max() <= RESIDUAL_TOL
    assert np.abs(balance(mechanism, record)).max() <= BALANCE_TOL
    assert (record.c_n >= 0.0).all()
    pressing, most = record.c_n > 0.0, np.broadcast_to(mu, record.c_n.shape) * record.c_n
    assert (np.abs(record.c_t) <= most + BALANCE_TOL).all()
    v_n, v_t = contact_velocity(record)
    slides = pressing & (np.abs(v_t) > SLIDES)
    assert np.abs(record.c_t + np.sign(v_t) * most)[slides].max(initial=0.0) <= EDGE_TOL
    rebound = -epsilon * np.einsum("kpi,ki->kp", record.J_n, record.v[:-1])
    fast = pressing & (rebound > V_REBOUND)
    assert np.abs(v_n - rebound)[fast].max(initial=0.0) <= REBOUND_TOL
    # forces act only where the gap would close within the step, φ(q + h v_free) <= 0, or was closed before
    M = np.array([mechanism.mass_matrix(q) for q in record.q[:-1]])
    v_free = record.v[1:] - h * np.linalg.solve(M, contact_force(record)[:, :, None])[:, :, 0]
    closing = np.minimum(mechanism.contacts_of(record.q[:-1] + h * v_free).phi, record.phi - TOUCH)
    assert closing[pressing].max(initial=0.0) <= CLOSING_TOL
    return record


def drops(name, n, seed=0):
    """Initial states (q, v), each (n, 3), of a body well above the surface."""
    rng = np.random.default_rng(seed)
    body = BODIES[name]
    q = np.stack([np.zeros(n), rng.uniform(0.2, 1.0, n), rng.uniform(-np.pi, np.pi, n)], axis=1)
    q[:, 1] -= body.contacts_of(q * [1, 0, 1]).phi.min(axis=1)
    return q, rng.uniform([-2, -1, -4], [2, 0, 4], (n, 3))


def contact_velocity(record: SimulatedMotion) -> tuple[np.ndarray, np.ndarray]:
    """J_n v⁺ and J_t v⁺, each (m, p) in m/s, with J at the start of the step."""
    return tuple(np.einsum("kpi,ki->kp", J, record.v[1:]) for J in (record.J_n, record.J_t))


def limit_cycle(wheel: RimlessWheel) -> tuple[float, float]:
    """Angular velocities (ω⁻, ω⁺) in rad/s before and after each step of steady rolling.

    On spokes that neither slip nor rebound, a step from one to the next conserves the angular momentum about the new
    tip, and the hub falls by 2 l sin(π/n) sin γ:

        ω⁺ = r ω⁻,   r = (I + m l² cos(2π/n)) / (I + m l²),      ω⁻² (1 - r²) = 4 m g l sin(π/n) sin γ / (I + m l²)
    """
    ml2, half = wheel.mass * wheel.length**2, np.pi / wheel.spokes
    ratio = (wheel.inertia + ml2 * np.cos(2.0 * half)) / (wheel.inertia + ml2)
    energy = 4.0 * wheel.mass * wheel.g * wheel.length * np.sin(half) * np.sin(wheel.slope)
    before = -np.sqrt(energy / (wheel.inertia + ml2) / (1.0 - ratio**2))
    return float(before), float(ratio * before)
