"""Projection of measured states onto the contact manifold (thesis section 2.3.2, approach 3, figure 2-5).

Noise and discretisation leave a contact at a small gap, where eq. 2.12 allows no force.  A step whose expected gap is
below a tolerance is treated as contact, and its pose is moved to the nearest touching pose by Newton steps

    q ← q − W⁻¹ J_n' (J_n W⁻¹ J_n')⁻¹ φ(q)

for all its closed contacts at once.  If the sliding velocity at the end of the step is below a tolerance, the
velocity is projected likewise to J_t v = 0, and the contact sticks exactly.  W (diagonal) weights rotation against
translation: 1 for metres, a squared length for radians.  Contacts that cannot all be closed are closed in the
least-squares sense.
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.scenes import NoisyMotion
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.thesis.identify.base_parameters.window import ContactWindow, States, expected_gap

# Newton steps; three or four are enough for a body unless contacts contradict each other
ITERATIONS = 20
CLOSED = 1e-12  # m, gap at which the Newton steps end
GAP_SIGMAS = 3.0  # gaps of this many sigmas of their noise count as contact


@dataclass(frozen=True)
class ProjectedRecord(States):
    """States projected onto the contact manifold."""

    closed: np.ndarray  # (m, p) contacts that were projected

    def touching(self, window: ContactWindow) -> ContactWindow:
        """Return a window of these states in which the gap of all projected contacts is set to zero."""
        return replace(window, gap=np.where(self.closed, 0.0, window.gap))


def project_to_contact(
    states: States, body: PlanarFreeBody, *, gap_tolerance: float, v_tolerance: float, metric: np.ndarray
) -> ProjectedRecord:
    """Project poses with contact onto touching poses, and velocities that nearly stick onto sticking velocities.

    Gaps and Jacobians of `states` are recomputed.  `gap_tolerance` and `v_tolerance` (m, m/s) are a few standard
    deviations of the noise of gap and sliding velocity, `metric` (3,) is the diagonal of W.

    Raises:
        UserError: states are not finite.
    """
    q, v = np.array(states.q, dtype=float), np.array(states.v, dtype=float)
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        raise UserError("poses or velocities are not finite: repair or cut the record before projecting it")
    W_inverse = 1.0 / metric
    steps = len(states.f_ext)
    contacts = body.contacts_of(q[:steps])
    a_free = body.gravity(q[0]) / body.mass
    closed = expected_gap(contacts.phi, contacts.J_n, v[:steps], a_free, states.h, gap_tolerance) == 0.0
    for k in np.flatnonzero(closed.any(axis=1)):
        for _ in range(ITERATIONS):
            at = body.contacts_of(q[k][None])
            phi, J_n = at.phi[0, closed[k]], at.J_n[0, closed[k]]
            if np.abs(phi).max() <= CLOSED:
                break
            q[k] -= _shortest(J_n, phi, W_inverse)
    contacts = body.contacts_of(q[:steps])
    v_t = np.einsum("kpv,kv->kp", contacts.J_t, v[1 : steps + 1])
    sticks = closed & (np.abs(v_t) <= v_tolerance)
    for k in np.flatnonzero(sticks.any(axis=1)):
        v[k + 1] -= _shortest(contacts.J_t[k, sticks[k]], v_t[k, sticks[k]], W_inverse)
    return ProjectedRecord(states.h, q, v, states.f_ext, contacts.phi, contacts.J_n, contacts.J_t, closed)


def _shortest(J: np.ndarray, value: np.ndarray, W_inverse: np.ndarray) -> np.ndarray:
    """Shortest δ in the metric with J δ = value, or the least-squares δ if there is no solution."""
    return W_inverse * (J.T @ np.linalg.lstsq((J * W_inverse) @ J.T, value, rcond=1e-10)[0])


def contact_tolerances(body: PlanarFreeBody, sigma: np.ndarray) -> tuple[float, float]:
    """`GAP_SIGMAS` standard deviations of a gap in m and of a sliding velocity in m/s, from the noise `sigma` (2, 3).

    The gap changes with y and r θ, the velocity of the touching point with v_x and r ω; r is the largest of the body.
    """
    reach = body.shape.extent
    gap, slip = (GAP_SIGMAS * float(np.hypot(sigma[i, 1 - i], reach * sigma[i, 2])) for i in (0, 1))
    return gap, slip


def project_motion(motion: NoisyMotion) -> ProjectedRecord:
    """Project the noisy states of a motion onto the contact manifold in the kinetic metric.

    The tolerances use the true noise level, which an estimator cannot use: for figures, not for estimates.
    """
    body = motion.body
    states = States.of(body, motion.record.h, motion.observed.q, motion.observed.v, motion.record.f_ext)
    inertias = np.diag(body.mass_matrix(motion.record.q[0]))
    gap, slip = contact_tolerances(body, motion.observed.sigma)
    return project_to_contact(states, body, gap_tolerance=gap, v_tolerance=slip, metric=inertias / body.mass)
