"""Each law against an independent implementation: event-driven integration, LCP solver, convex solver, mode table."""

import numpy as np
import pytest
from impact_integration import coulomb_impact, coulomb_rate, integrate_all, viscous_impact
from scipy.integrate import solve_ivp

from thesis_lib.contact import LAWS
from thesis_lib.extensions.impact_draws import ImpactDraws, reference_draw
from thesis_lib.mechanics.contact import Contact
from thesis_lib.simulate.stepping.contact_modes import by_drake

# relative to the contact speed before impact (impulses are of its order, m = 1)
EVENTS = 1e-9  # bisection is exact to rounding; slow slip that nearly sticks amplifies it
RUNGE_KUTTA = 1e-8  # integration at rtol = 1e-10, steps and event location included
LEMKE = 1e-9  # Lemke's pivots are exact to rounding times the condition of the basis
SOLVER = 1e-10  # interior point tolerance in the objective; much below, some problems make no progress
CLARABEL = 1e-4  # its square root, times 10 for objectives that are flat in one direction


def assert_agree(draw: ImpactDraws, ours: np.ndarray, other: np.ndarray, tolerance: float) -> None:
    error = np.linalg.norm(ours - other, axis=1) / draw.speed
    assert error.max() <= tolerance, (error.max(), np.argmax(error), np.mean(error > tolerance))


# ------------------------------------------------------------------- path-wise laws: event-driven integration


@pytest.mark.parametrize("from_rest", [False, True])
@pytest.mark.parametrize("name, work", [("wang_mason", False), ("mirtich", True)])
def test_path_laws_against_event_driven_integration(name, work, from_rest, draw):
    if from_rest:  # v_t = 0, and ε = 0 or 1: events that coincide with the start or the end of a phase
        draw = draw[:2000]
        falling = np.stack([np.zeros(2000), draw.space.v_n, np.zeros(2000)], axis=-1)
        draw = ImpactDraws(falling, draw.r, draw.mu, np.round(draw.epsilon))
        assert np.all(draw.space.v_t == 0.0)
    other = integrate_all(draw.space, draw.mu, draw.epsilon, coulomb_impact, work=work)
    assert_agree(draw, draw.resolve(LAWS[name]).impulse, other, EVENTS)


def test_the_event_integration_against_runge_kutta(rng):
    # checks the checker: the same equations by solve_ivp, which knows nothing of constant rates
    draw = reference_draw(rng, 40)
    s = draw.space
    for i in range(len(draw.mu)):
        v_t, v_n, K_tt, K_nn, K_tn = (float(a[i]) for a in (s.v_t, s.v_n, s.K_tt, s.K_nn, s.K_tn))
        mu, epsilon = float(draw.mu[i]), float(draw.epsilon[i])
        c_t, c_n = coulomb_impact(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon, work=True)
        state, direction, p = [v_t, v_n, 0.0, 0.0], np.sign(v_t), 0.0
        compression_work = 0.0
        while p < c_n:
            f, direction = coulomb_rate(direction, K_tt, K_tn, mu)

            def rates(_, y, f=f, a=K_tn + K_tt * f, b=K_nn + K_tn * f):
                return [a, b, f, y[1]]

            def slip_ends(_, y, d=direction):
                return y[0] if d else 1.0

            slip_ends.terminal, slip_ends.direction = True, -direction or 0.0
            leg = solve_ivp(rates, (p, c_n), state, events=slip_ends, rtol=1e-10, atol=1e-13, max_step=0.1)
            compression_work = min(compression_work, leg.y[3].min())
            vertex = leg.y[3, -1] - leg.y[1, -1] ** 2 / (2 * (K_nn + K_tn * f))  # minimum of W between steps
            if leg.y[1, 0] < 0.0 < leg.y[1, -1]:
                compression_work = min(compression_work, vertex)
            p, state, direction = leg.t[-1], leg.y[:, -1], 0.0
        assert abs(state[2] - c_t) <= RUNGE_KUTTA * draw.speed[i]
        assert abs(state[3] - (1 - epsilon**2) * compression_work) <= RUNGE_KUTTA * draw.speed[i] ** 2


def test_published_mirtich_against_runge_kutta(rng):
    draw = reference_draw(rng, 200)
    other = integrate_all(draw.space, draw.mu, draw.epsilon, viscous_impact)
    assert_agree(draw, draw.resolve(LAWS["mirtich_as_published"]).impulse, other, RUNGE_KUTTA)


# ------------------------------------------------------------------------------- Anitescu-Potra: Drake's LCP


def lemke(M: np.ndarray, q: np.ndarray) -> np.ndarray:
    """z of w = M z + q ≥ 0, z ≥ 0, zᵀ w = 0 by Drake's Lemke solver, verified."""
    z = by_drake("MobyLcpSolver", M, q)
    assert z is not None
    w = M @ z + q
    scale = np.abs(q).max()
    assert z.min() >= -LEMKE * scale and w.min() >= -LEMKE * scale and abs(z @ w) <= LEMKE * scale**2
    return z


def contact_lcp(K_tt, K_nn, K_tn, mu) -> np.ndarray:
    """Matrix of the problem in (c_n, β₁, β₂, λ), c_t = β₂ − β₁."""
    return np.array(
        [[K_nn, -K_tn, K_tn, 0.0], [-K_tn, K_tt, -K_tt, 1.0], [K_tn, -K_tt, K_tt, 1.0], [mu, -1.0, -1.0, 0.0]]
    )


def rows(draw: ImpactDraws):
    s: Contact = draw.space
    return zip(s.v_t, s.v_n, s.K_tt, s.K_nn, s.K_tn, draw.mu, draw.epsilon)


def test_anitescu_potra_newton_against_lemke(rng):
    draw = reference_draw(rng, 3000)
    other = []
    for v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon in rows(draw):
        q = np.array([(1.0 + epsilon) * v_n, -v_t, v_t, 0.0])
        z = lemke(contact_lcp(K_tt, K_nn, K_tn, mu), q)
        other.append((z[2] - z[1], z[0]))
    assert_agree(draw, draw.resolve(LAWS["anitescu_potra_newton"]).impulse, np.array(other), LEMKE)


def test_anitescu_potra_poisson_against_lemke(rng):
    draw = reference_draw(rng, 2000)
    few = reference_draw(rng, 1000)
    # with strong friction too: μ |K_tn| > K_nn, where friction might press the contact down
    draw = ImpactDraws(
        np.concatenate([draw.v_pre, few.v_pre]),
        np.concatenate([draw.r, few.r]),
        np.concatenate([draw.mu, 4.0 * few.mu]),
        np.concatenate([draw.epsilon, few.epsilon]),
    )
    assert np.mean(draw.mu * np.abs(draw.space.K_tn) > draw.space.K_nn) > 0.1
    other, published, pressed = [], [], 0
    for v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon in rows(draw):
        M = contact_lcp(K_tt, K_nn, K_tn, mu)
        z = lemke(M, np.array([v_n, -v_t, v_t, 0.0]))
        c = np.array([z[2] - z[1], z[0]])
        published.append((c[0], (1.0 + epsilon) * c[1]))
        # decompression: N = ε c_n^c + x, 0 ≤ x ⊥ v_n⁺ ≥ 0
        given = epsilon * c[1]
        v_t, v_n = v_t + K_tt * c[0] + K_tn * (c[1] + given), v_n + K_tn * c[0] + K_nn * (c[1] + given)
        z = lemke(M, np.array([v_n, -v_t, v_t, mu * given]))
        pressed += z[0] > 1e-6
        other.append(c + [z[2] - z[1], given + z[0]])
    assert_agree(draw, draw.resolve(LAWS["anitescu_potra_poisson"]).impulse, np.array(other), LEMKE)
    law = LAWS["anitescu_potra_poisson_as_published"]
    assert_agree(draw, draw.resolve(law).impulse, np.array(published), LEMKE)
    assert pressed == 0  # the law's closed form relies on it


# ------------------------------------------------------------------------- Drumwright-Shell: convex solver


@pytest.mark.parametrize("name", ["drumwright_shell", "drumwright_shell_as_published"])
def test_drumwright_shell_against_a_convex_solver(name, rng):
    from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

    draw = reference_draw(rng, 300)
    solver, options = ClarabelSolver(), SolverOptions()
    for key in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(solver.solver_id(), key, SOLVER)
    other = []
    for v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon in rows(draw):
        program = MathematicalProgram()
        c = program.NewContinuousVariables(2)
        program.AddQuadraticCost(np.array([[K_tt, K_tn], [K_tn, K_nn]]), np.array([v_t, v_n]), c)
        constraints = np.array([[K_tn, K_nn], [-1.0, mu], [1.0, mu]])  # v_n⁺ ≥ 0, |c_t| ≤ μ c_n
        program.AddLinearConstraint(constraints, np.array([-v_n, 0.0, 0.0]), np.full(3, np.inf), c)
        if not name.endswith("as_published"):
            program.AddLinearConstraint(np.array([[0.0, 1.0]]), [-np.inf], [-v_n / K_nn], c)
        result = solver.Solve(program, None, options)
        assert result.is_success()
        other.append(result.GetSolution(c) * [1.0, 1.0 + epsilon])
    assert_agree(draw, draw.resolve(LAWS[name]).impulse, np.array(other), CLARABEL)


# -------------------------------------------------------------------------- Wang-Mason: table of five modes


def test_wang_mason_against_the_five_modes(draw):
    S0, C0, B1, B2, B3 = draw.space.v_t, draw.space.v_n, draw.space.K_tt, draw.space.K_nn, -draw.space.K_tn
    mu, e, s = draw.mu, draw.epsilon, np.sign(draw.space.v_t)
    Pd, Pq, mu_s = (B2 + s * mu * B3) * s * S0, (mu * B1 + s * B3) * -C0, np.abs(B3 / B1)
    slide_n = -(1 + e) * C0 / (B2 + s * mu * B3)
    stick_n = -(1 + e) * (B1 * C0 + B3 * S0) / (B1 * B2 - B3**2)
    with np.errstate(all="ignore"):
        reverse_n = -(1 + e) / (B2 - s * mu * B3) * (C0 + 2 * s * mu * B3 * S0 / (B3 + s * mu * B1))
        back = 2 * S0 / (B3 + s * mu * B1)
    slides = Pd > (1 + e) * Pq
    ends, compresses = ~slides & (Pd > Pq), Pd < Pq
    modes = {  # mode: (impacts, c_n, c_t)
        "sliding": (slides, slide_n, -s * mu * slide_n),
        "C-sticking": (compresses & (mu > mu_s), stick_n, (B3 * stick_n - S0) / B1),
        "R-sticking": (ends & (mu > mu_s), slide_n, (B3 * slide_n - S0) / B1),
        "C-reversed": (compresses & (mu < mu_s), reverse_n, s * mu * (reverse_n - back)),
        "R-reversed": (ends & (mu < mu_s), slide_n, s * mu * (slide_n - back)),
    }
    assert sum(mode[0].sum() for mode in modes.values()) == len(mu)
    ours = draw.resolve(LAWS["wang_mason"]).impulse
    for name, (impacts, c_n, c_t) in modes.items():
        assert impacts.sum() > 100, name
        error = np.hypot(ours[impacts, 0] - c_t[impacts], ours[impacts, 1] - c_n[impacts])
        assert np.max(error / draw.speed[impacts]) <= EVENTS, name
