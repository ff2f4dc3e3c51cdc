"""The thesis's program for m/I of a free body (eqs. 2.12, 2.13, 2.23, table 2.1), which takes noisy samples as true.

    minimise over m/I, c   Σ_k |v_{k+1} - v_k - h g - diag(1, 1, m/I) (J_n' c_n + J_t' c_t)_k|²
    subject to             c_n >= 0,  |c_t| <= μ c_n,  c_n = 0 off contact,  c_t = -sign(v_t) μ c_n if sliding,

with impulses per mass.  The samples fix gap, Jacobians and sliding velocity.  For each m/I, the program splits
into one convex problem of two unknowns per step, solved in closed form (projection on a plane cone), which leaves a
search over one number.  In each step one pair may act, the lowest at its end.  As the thesis softens the distance (its
approach 1), a gap or a sliding velocity within `TOLERANCE` standard deviations of zero counts as zero.

The thesis's three treatments of noise (section 2.3.2, step 4), for a body of known mass (`treated_ratio`):

    softened        eq. 2.13: contacts may act at a distance, at a cost
    complementary   eq. 2.14 with the dynamics as cost: every complementarity product has a cost
    projected       eq. 2.12 on states projected onto the contact manifold (`base_parameters.projection`)

Gaps and sliding velocities within three standard deviations of their noise count as zero; otherwise hardly any
contact would act.  Each program is solved to its global minimum (`programs.mode_qp`).  Eq. 2.14 as printed, with the
dynamics as a constraint, has no solution: in flight, the noisy spin changes without a torque.  For the same reason all
three underestimate the inertia: I times the noise of the change of spin is a misfit, which vanishes for I = 0.
"""

from typing import Literal

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.thesis.identify.base_parameters.projection import contact_tolerances, project_to_contact
from thesis_lib.thesis.identify.base_parameters.window import GAP_TOLERANCE, V_TOLERANCE, States, free_body_window
from thesis_lib.thesis.identify.programs.mode_qp import Program, solve_mode_qp
from thesis_lib.thesis.identify.segmentation import check_states

TOLERANCE = 3.0  # standard deviations within which a gap or a sliding velocity counts as zero
EXACT = 1e-9  # m, m/s: the same limit without noise, well above rounding
# range of m/I times the extent squared: 1 if all mass is at the extent, 100 if it is at a tenth of it
SEARCH = (0.01, 100.0)
Treatment = Literal["softened", "complementary", "projected"]
PROGRAMS: dict[Treatment, Program] = {"softened": "2.13", "complementary": "2.14 soft", "projected": "2.12"}
_GRID, _REFINEMENTS = 121, 6  # points per search; each refinement narrows it to the two cells around the best point


def plain_ratio(
    body: PlanarFreeBody, h: float, q: np.ndarray, v: np.ndarray, mu: float, sigma: np.ndarray | None = None
) -> float:
    """Estimate m/I in 1/m² by eq. 2.23; NaN if no sample is near contact.

    Only shape and gravity of `body` are used; `h` in s; `q`, `v` (m+1, 3) are noisy states, whose noise `sigma` (2, 3)
    sets the tolerances (None: exact data).

    Raises:
        UserError: the states cannot be a drop, or the friction coefficient is negative.
    """
    check_states(h, q, v)
    if not mu >= 0:
        raise UserError(f"The program of eq. 2.23 needs a friction coefficient of at least 0; got {mu}.")
    sigma = np.zeros((2, 3)) if sigma is None else np.asarray(sigma, dtype=float)
    free = h * body.gravity(q[0]) / body.mass
    ahead, J_n, J_t = _lowest_pair(body, h, q[:-1], v[:-1] + free)
    gap = np.maximum(ahead, 0.0)
    gap_std = np.sqrt(sigma[0, 1] ** 2 + (J_n[:, 2] * sigma[0, 2]) ** 2)
    near = gap <= TOLERANCE * gap_std + EXACT
    if not near.any():
        return np.nan
    J_n, J_t = J_n[near], J_t[near]
    b = (v[1:] - v[:-1] - free)[near]
    v_t = np.einsum("ki,ki->k", J_t, v[1:][near])
    v_t_std = np.sqrt(sigma[1, 0] ** 2 + (J_t[:, 2] * sigma[1, 2]) ** 2)
    slides = np.abs(v_t) > TOLERANCE * v_t_std + EXACT
    sign = np.where(slides, -np.sign(v_t), 0.0)

    low, high = np.log(np.array(SEARCH) / body.shape.extent**2)
    for _ in range(_REFINEMENTS):
        grid = np.linspace(low, high, _GRID)
        best = int(np.argmin(_cost(np.exp(grid), b, J_n, J_t, mu, sign)))
        low, high = grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)]
    return float(np.exp(grid[best]))


def treated_ratio(
    treatment: Treatment, body: PlanarFreeBody, h: float, q: np.ndarray, v: np.ndarray, mu: float, sigma: np.ndarray
) -> float:
    """Estimate m/I in 1/m², within `SEARCH`, from noisy states q, v (m+1, 3) with noise `sigma` (2, 3).

    Shape, mass and gravity of `body` are used, its inertia is not; h in s.
    """
    states = States.of(body, h, q, v, np.zeros((len(q) - 1, 3)))
    reach = body.shape.extent
    gap, slip = contact_tolerances(body, sigma)
    if treatment == "projected":
        # the unknown inertia is replaced by that of a uniform disk of this extent
        metric = np.array([1.0, 1.0, 0.5 * reach**2])
        states = project_to_contact(states, body, gap_tolerance=gap, v_tolerance=slip, metric=metric)
        window = states.touching(free_body_window(states, mu, body))
    else:
        tolerances = {"gap_tolerance": max(gap, GAP_TOLERANCE), "v_tolerance": max(slip, V_TOLERANCE)}
        window = free_body_window(states, mu, body, **tolerances)
    window = window.fix({"m": body.mass})
    inertia = float(solve_mode_qp(window, PROGRAMS[treatment]).theta[0])
    low, high = np.array(SEARCH) / reach**2
    return float(np.clip(body.mass / inertia if inertia > 0.0 else high, low, high))


def impact_least_squares(body: PlanarFreeBody, h: float, q: np.ndarray, v: np.ndarray, steps: np.ndarray) -> float:
    """Estimate m/I in 1/m² by least squares of Δω on r_x Δv_y - r_y Δv_x at known impact steps (J,); NaN if J = 0.

    Eq. 2.23 reduces to this for known contact steps, free friction and Δω alone.  Noise in the regressor biases the
    slope towards zero.
    """
    check_states(h, q, v)
    if not len(steps):
        return np.nan
    free = h * body.gravity(q[0]) / body.mass
    _, J_n, J_t = _lowest_pair(body, h, q[steps], v[steps] + free)
    change = v[steps + 1] - v[steps] - free
    lever = J_n[:, 2] * change[:, 1] + J_t[:, 2] * change[:, 0]
    return float(lever @ change[:, 2] / (lever @ lever))


def _lowest_pair(
    body: PlanarFreeBody, h: float, q: np.ndarray, v_free: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least gap (s,) in m after s free steps (the time stepper acts below 0), and J_n, J_t (s, 3) of that pair."""
    contacts = body.contacts_of(q)
    ahead = contacts.phi + h * np.einsum("kpi,ki->kp", contacts.J_n, v_free)
    at = np.arange(len(q)), ahead.argmin(axis=1)
    return ahead[at], contacts.J_n[at], contacts.J_t[at]


def _cost(
    ratio: np.ndarray, b: np.ndarray, J_n: np.ndarray, J_t: np.ndarray, mu: float, sign: np.ndarray
) -> np.ndarray:
    """Cost Σ_k min_c |b - A c|² (r,) for trial ratios (r,), up to Σ |b|², with A = diag(1, 1, m/I) J'.

    `b` (s, 3): velocity changes beyond gravity in s steps near contact; `sign` (s,) of c_t where sliding, else 0.
    """
    weight = np.stack([np.ones_like(ratio), np.ones_like(ratio), ratio], axis=1)[:, None, :]
    A_t, A_n = weight * J_t, weight * J_n
    tt, nn, tn = (A_t**2).sum(-1), (A_n**2).sum(-1), (A_t * A_n).sum(-1)
    bt, bn = (A_t * b).sum(-1), (A_n * b).sum(-1)
    # explained part of |b|² on each edge of the cone, c = s (±μ, 1) with s >= 0
    edges = []
    for side in (1.0, -1.0):
        along, square = bn + side * mu * bt, nn + 2.0 * side * mu * tn + mu**2 * tt
        edge = np.maximum(along, 0.0) ** 2 / square
        edges.append(np.where((sign == 0.0) | (sign == side), edge, 0.0))
    explained = np.maximum(*edges)
    # and inside the cone, for sticking
    det = tt * nn - tn**2
    with np.errstate(divide="ignore", invalid="ignore"):
        c_t, c_n = (nn * bt - tn * bn) / det, (tt * bn - tn * bt) / det
    inside = (sign == 0.0) & (det > 0) & (c_n >= 0) & (np.abs(c_t) <= mu * c_n)
    explained = np.where(inside, c_t * bt + c_n * bn, explained)
    return -explained.sum(axis=1)
