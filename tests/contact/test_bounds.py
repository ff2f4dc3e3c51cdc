"""Post-hoc bounds: exact projection on the admissible impulses, and the best of several laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thesis_lib.contact import LAWS
from thesis_lib.contact.bounds import best_impulse, best_post_hoc, irb_bound
from thesis_lib.contact.space import (
    admissible,
    contact_space,
    measured_impulse,
    residual_couple,
    velocity_change,
    velocity_error,
)
from thesis_lib.extensions.impact_draws import reference_draw, reference_draw_in_space
from thesis_lib.mechanics.contact import contact_at
from thesis_lib.mechanics.contact import velocity_change as velocity_change_in_space
from thesis_lib.mechanics.space import SPACE

ROUNDING = 1e-9  # relative to the contact speed, condition of M_C included
SOLVER = 1e-6  # error in m/s of an interior point solution at tolerance 1e-12 in its square


@pytest.fixture
def measured(rng):
    """2000 impacts whose measured outcome is a law's, disturbed until many leave the admissible set."""
    draw = reference_draw(rng, 2000)
    spread = rng.choice([0.05, 0.3, 2.0], (2000, 1)) * draw.speed[:, None]
    v_post = draw.resolve(LAWS["wang_mason"]).v_post + spread * rng.standard_normal((2000, 3))
    return draw, v_post


def bound_of(draw, v_post):
    return irb_bound(draw.v_pre, v_post, draw.r, mass=1.0, k_g=1.0)


def test_bound_is_admissible_and_consistent(measured):
    draw, v_post = measured
    bound = bound_of(draw, v_post)
    c_t, c_n = bound.impulse.T
    assert np.all(admissible(draw.space, c_t, c_n, tolerance=ROUNDING))
    expected = draw.v_pre + velocity_change(c_t, c_n, draw.r, mass=1.0, k_g=1.0)
    np.testing.assert_allclose(bound.v_post, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(bound.error, velocity_error(v_post - bound.v_post, 1.0), rtol=0, atol=1e-12)


def test_every_side_of_the_admissible_set_is_met(measured):
    # guards the other tests: interior, ellipse, maximum compression, no pull and corners all occur
    draw, v_post = measured
    space, (c_t, c_n) = draw.space, bound_of(draw, v_post).impulse.T
    on_ellipse = np.abs(space.alpha(c_t, c_n) - 1.0) < ROUNDING
    on_compression = np.abs(space.velocity_after(c_t, c_n)[1]) < ROUNDING * draw.speed
    no_push = np.abs(c_n) < ROUNDING * draw.speed
    for side in (
        ~on_ellipse & ~on_compression & ~no_push,
        on_ellipse & ~on_compression & ~no_push,
        on_compression & ~on_ellipse & ~no_push,
        no_push & ~on_compression & ~on_ellipse,
        on_ellipse & on_compression,
        no_push & on_compression,
        no_push & on_ellipse,
    ):
        assert side.sum() >= 5, side.sum()


def test_bound_equals_a_generic_cone_program(measured):
    from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

    draw, v_post = measured
    bound, space = bound_of(draw, v_post), draw.space
    solver, options = ClarabelSolver(), SolverOptions()
    for key in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(solver.solver_id(), key, 1e-12)
    for i in range(200):
        x, y = draw.r[i]
        J = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])  # M = identity
        dv, v_c = v_post[i] - draw.v_pre[i], J @ draw.v_pre[i]
        L = np.linalg.cholesky(J @ J.T)
        program = MathematicalProgram()
        c, distance = program.NewContinuousVariables(2), program.NewContinuousVariables(1)
        program.AddLinearCost(distance[0])
        # |Δv − Jᵀ c| ≤ distance, and energy: |L⁻¹ (v_C + K c)| ≤ |L⁻¹ v_C|
        program.AddLorentzConeConstraint(np.concatenate([distance, dv - J.T @ c]))
        after = np.linalg.solve(L, v_c) + L.T @ c
        program.AddLorentzConeConstraint(np.concatenate([[np.linalg.norm(np.linalg.solve(L, v_c))], after]))
        program.AddBoundingBoxConstraint(0.0, np.inf, c[1])
        program.AddLinearConstraint((J @ J.T)[1], -v_c[1], np.inf, c)
        result = solver.Solve(program, None, options)
        assert abs(result.get_optimal_cost() - bound.error[i]) <= SOLVER * draw.speed[i], i
        np.testing.assert_allclose(
            velocity_error(dv - J.T @ result.GetSolution(c), 1.0), bound.error[i], rtol=0, atol=10 * SOLVER
        )
    assert np.all(space.v_n[:200] < 0.0)


def test_bound_in_space_equals_a_generic_cone_program(rng):
    from pydrake.solvers import ClarabelSolver, MathematicalProgram

    draw = reference_draw_in_space(rng, 100)
    at, solver = draw.space, ClarabelSolver()
    dv = -draw.v_pre.T * rng.uniform(0.2, 2.5, 100) + 0.3 * rng.standard_normal((6, 100)) * draw.speed
    c = best_impulse(at, dv)
    left = dv - velocity_change_in_space(c, at.r, at.mobility)
    error = np.sqrt((left[:3] ** 2).sum(axis=0) + np.einsum("in,nij,jn->n", left[3:], draw.inertia, left[3:]))
    for i in range(100):
        # √M, so that the length of √M Δv is the kinetic norm
        root = np.block([[np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), np.linalg.cholesky(draw.inertia[i]).T]])
        W = np.stack([velocity_change_in_space(e, at.r[:, i], at.mobility[:, :, i]) for e in np.eye(3)], axis=1)
        L, K_n = np.linalg.cholesky(at.K[:, :, i]), at.K[2, :, i]
        program = MathematicalProgram()
        x, distance = program.NewContinuousVariables(3), program.NewContinuousVariables(1)
        program.AddLinearCost(distance[0])
        A = np.block([[np.zeros((1, 3)), np.ones((1, 1))], [-root @ W, np.zeros((6, 1))]])
        program.AddLorentzConeConstraint(A, np.append(0.0, root @ dv[:, i]), np.append(x, distance))
        before = np.linalg.solve(L, at.v[:, i])
        A = np.concatenate([np.zeros((1, 3)), L.T])
        program.AddLorentzConeConstraint(A, np.append(np.linalg.norm(before), before), x)
        program.AddBoundingBoxConstraint(0.0, np.inf, x[2])
        program.AddLinearConstraint(K_n[None], [-at.v_n[i]], [np.inf], x)
        assert solver.Solve(program).get_optimal_cost() == pytest.approx(error[i], abs=1e-4 * draw.speed[i])
    energy = at.energy(*at.velocity_after(*c)) / at.energy(*at.v)
    assert (np.abs(energy - 1.0) < 1e-9).sum() > 10 and (energy < 0.99).sum() > 10


def test_the_plane_embedded_in_space_has_the_same_bound(measured):
    draw, v_post = measured
    n, dv = len(draw.r), v_post - draw.v_pre
    bound, zero = bound_of(draw, v_post), np.zeros(len(draw.r))
    r, v, ahead = (np.stack([a[:, 0], zero, a[:, 1]]) for a in (draw.r, draw.v_pre, dv))
    spin, turned = (np.stack([zero, -a[:, 2], zero]) for a in (draw.v_pre, dv))  # y points away: θ turns about −y
    mobility = np.repeat(np.diag([2.0, 1.0, 0.5])[:, :, None], n, axis=2)
    c = best_impulse(contact_at(SPACE, v, spin, r, mobility), np.concatenate([ahead, turned]))
    np.testing.assert_allclose(c, [bound.impulse[:, 0], zero, bound.impulse[:, 1]], rtol=0, atol=1e-9)


def test_an_admissible_point_impulse_is_explained_exactly(draw):
    out = draw.resolve(LAWS["mirtich"])
    bound = bound_of(draw, out.v_post)
    assert np.all(bound.error <= ROUNDING * draw.speed)
    np.testing.assert_allclose(bound.impulse, out.impulse, rtol=0, atol=1e-9 * draw.speed.max())


def test_only_the_couple_is_left_when_the_measured_impulse_is_admissible(measured):
    draw, v_post = measured
    dv = v_post - draw.v_pre
    c_t, c_n = measured_impulse(dv, draw.r, mass=1.0, k_g=1.0)
    inside = admissible(draw.space, c_t, c_n, tolerance=0.0)
    couple = residual_couple(dv, draw.r, mass=1.0, k_g=1.0)
    alone = np.abs(couple) / np.sqrt(1.0 + np.sum(draw.r**2, axis=1))
    error = bound_of(draw, v_post).error
    assert 200 < inside.sum() < 1800
    np.testing.assert_allclose(error[inside], alone[inside], rtol=1e-9, atol=ROUNDING)
    assert np.all(error[~inside] >= alone[~inside] - ROUNDING)
    assert np.median(error[~inside] - alone[~inside]) > 0.01


def test_units_do_not_matter(measured):
    draw, v_post = measured
    mass, length = 0.0364, 0.0192
    scale = np.array([1.0, 1.0, 1.0 / length])
    other = irb_bound(draw.v_pre * scale, v_post * scale, draw.r * length, mass=mass, k_g=length)
    np.testing.assert_allclose(other.error, bound_of(draw, v_post).error, rtol=1e-9, atol=ROUNDING)


def test_head_on_impact_without_coupling():
    # r_x = 0: K_tn = 0, the two lines are parallel and have no crossing
    v, r = np.array([[0.0, -1.0, 0.0]]), np.array([[0.0, -0.5]])
    best = irb_bound(v, np.array([[0.0, 3.0, 0.0]]), r, mass=1.0, k_g=1.0)
    np.testing.assert_allclose(best.impulse, [[0.0, 2.0]], atol=1e-12)  # elastic at best
    assert best.error[0] == pytest.approx(2.0)
    worst = irb_bound(v, np.array([[0.0, -3.0, 0.0]]), r, mass=1.0, k_g=1.0)
    np.testing.assert_allclose(worst.impulse, [[0.0, 1.0]], atol=1e-12)  # plastic at least


ANY = st.one_of(st.sampled_from([0.0, 1.0, -1.0]), st.floats(-3.0, 3.0, allow_subnormal=False))


@settings(max_examples=200, deadline=None)
@given(st.tuples(ANY, ANY, ANY), st.tuples(ANY, ANY), st.one_of(st.just(-1.0), st.floats(-3.0, -1e-3)), ANY)
def test_degenerate_sets(dv, contact, v_n, v_t):
    """Symmetric states put the target on corners, on the centre, or on parallel lines."""
    v, r = np.array([[v_t, v_n, 0.0]]), np.array([contact])
    bound = irb_bound(v, v + dv, r, mass=1.0, k_g=1.0)
    space, scale = contact_space(v, r, mass=1.0, k_g=1.0), np.hypot(v_t, v_n)
    assert admissible(space, *bound.impulse.T, tolerance=ROUNDING)[0]
    # not worse than the plastic and elastic frictionless impacts, or the stick impulse if it pushes
    for c_t, c_n in ((0.0, -v_n / space.K_nn), (0.0, -2.0 * v_n / space.K_nn), space.impulse_to(0.0, 0.0)):
        if np.all(c_n >= 0.0):
            change = velocity_change(np.broadcast_to(c_t, 1), np.broadcast_to(c_n, 1), r, mass=1.0, k_g=1.0)
            assert bound.error[0] <= velocity_error(dv - change, 1.0)[0] + ROUNDING * (scale + 1.0)


@pytest.mark.parametrize("where", ["v_pre", "v_post", "r"])
@pytest.mark.parametrize("missing", [np.nan, np.inf])
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_missing_values_stay_missing_and_spare_the_others(where, missing, measured):
    draw, v_post = measured
    arrays = {"v_pre": draw.v_pre[:5].copy(), "v_post": v_post[:5].copy(), "r": draw.r[:5].copy()}
    whole = irb_bound(**arrays, mass=1.0, k_g=1.0)
    arrays[where][2, 1] = missing
    bound = irb_bound(**arrays, mass=1.0, k_g=1.0)
    others = np.arange(5) != 2
    for name in ("impulse", "v_post", "error"):
        assert not np.any(np.isfinite(getattr(bound, name)[2])), name
        np.testing.assert_array_equal(getattr(bound, name)[others], getattr(whole, name)[others])


def test_no_impacts():
    bound = irb_bound(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 2)), mass=1.0, k_g=1.0)
    assert bound.impulse.shape == (0, 2) and bound.error.shape == (0,)


def test_best_post_hoc_picks_the_least(rng):
    errors = rng.exponential(size=(100, 6))
    best, error = best_post_hoc(errors)
    np.testing.assert_array_equal(error, errors.min(axis=1))
    np.testing.assert_array_equal(errors[np.arange(100), best], error)
    errors[7, best[7]] = np.nan  # a failed solve loses to any law that has an answer
    again, _ = best_post_hoc(errors)
    assert again[7] == np.argsort(errors[7])[0]
    errors[[3, 9]] = [np.nan] * 5 + [np.inf]
    with pytest.raises(ValueError, match="2 impacts have no finite error from any law"):
        best_post_hoc(errors)
