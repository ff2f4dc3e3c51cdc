"""Contact space: compliance, energy ellipse, lines, admissible impulses, and the measured impulse."""

import numpy as np
import pytest

from thesis_lib.contact.slip_path import slip_path
from thesis_lib.contact.space import (
    admissible,
    contact_space,
    energy_ellipse,
    line_of_maximum_compression,
    line_of_sticking,
    measured_impulse,
    residual_couple,
    velocity_change,
    velocity_error,
)
from thesis_lib.extensions.impact_draws import reference_draw
from thesis_lib.mechanics.contact import Contact

ROUNDING = 1e-10  # relative: rounding times the condition of M_C for r/k up to 10
MASS, K_G = 0.0364, 0.0192


@pytest.fixture
def body(rng):
    """300 states of a real body: velocities, contact points, and matrices M (3, 3), J (300, 2, 3) written out."""
    v = rng.standard_normal((300, 3)) * [1.0, 1.0, 20.0]
    r = rng.uniform(-0.035, 0.035, (300, 2))
    J = np.zeros((300, 2, 3))
    J[:, 0], J[:, 1] = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    J[:, 0, 2], J[:, 1, 2] = -r[:, 1], r[:, 0]
    return v, r, np.diag([MASS, MASS, MASS * K_G**2]), J


def test_velocity_and_compliance_from_the_jacobian(body):
    v, r, M, J = body
    space = contact_space(v, r, mass=MASS, k_g=K_G)
    np.testing.assert_allclose(np.stack([space.v_t, space.v_n], 1), np.einsum("nij,nj->ni", J, v), atol=1e-13)
    K = J @ np.linalg.inv(M) @ np.swapaxes(J, 1, 2)
    for value, (i, j) in ((space.K_tt, (0, 0)), (space.K_nn, (1, 1)), (space.K_tn, (0, 1))):
        np.testing.assert_allclose(value, K[:, i, j], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(space.det, np.linalg.det(K), rtol=ROUNDING)
    np.testing.assert_allclose(space.M_c, np.linalg.inv(K), rtol=1e-9, atol=1e-12)


def test_impulse_velocity_round_trip(draw, rng):
    c = rng.standard_normal((2, len(draw.mu)))
    back = draw.space.impulse_to(*draw.space.velocity_after(*c))
    np.testing.assert_allclose(back, c, rtol=0, atol=ROUNDING * draw.speed.max())


def test_alpha_is_the_share_of_kinetic_energy_that_can_change(rng):
    # kinetic energy of the body after minus before = ½ v_Cᵀ M_C v_C (α − 1)
    draw = reference_draw(rng, 500)
    c_t, c_n = rng.standard_normal((2, 500))
    v_post = draw.v_pre + velocity_change(c_t, c_n, draw.r, mass=1.0, k_g=1.0)
    change = 0.5 * np.sum(v_post**2 - draw.v_pre**2, axis=1)
    space = draw.space
    energy = space.energy(space.v_t, space.v_n)
    np.testing.assert_allclose(0.5 * energy * (space.alpha(c_t, c_n) - 1.0), change, rtol=1e-9, atol=1e-10)
    v_c = np.stack([space.v_t, space.v_n], 1)
    np.testing.assert_allclose(energy, np.einsum("ni,nij,nj->n", v_c, space.M_c, v_c), rtol=1e-9)
    assert np.all(space.alpha(*space.impulse_to(0.0, 0.0)) < ROUNDING)


@pytest.mark.parametrize("alpha", [1.0, 0.25])
def test_energy_ellipse(alpha, rng):
    draw = reference_draw(rng, 100)
    space, ellipse = draw.space, energy_ellipse(draw.space)
    np.testing.assert_array_equal(ellipse.centre, np.stack(space.impulse_to(0.0, 0.0), -1))
    assert np.all(ellipse.semi_axes[:, 0] >= ellipse.semi_axes[:, 1])
    outline = ellipse.outline(alpha, points=60)
    assert outline.shape == (100, 60, 2)
    levels = np.stack([space.alpha(outline[:, i, 0], outline[:, i, 1]) for i in range(60)], 1)
    np.testing.assert_allclose(levels, alpha, rtol=1e-9)
    # the farthest point of the ellipse lies along the major axis
    far = np.linalg.norm(outline - ellipse.centre[:, None], axis=2)
    np.testing.assert_allclose(far[:, 0], np.sqrt(alpha) * ellipse.semi_axes[:, 0], rtol=1e-9)
    assert np.all(far <= far[:, :1] * (1 + ROUNDING))
    # level 1 passes through no impulse at all
    assert np.allclose(space.alpha(np.zeros(100), np.zeros(100)), 1.0, rtol=0, atol=ROUNDING)


def test_lines(draw, rng):
    space, speed = draw.space, draw.speed
    c = np.abs(rng.standard_normal(len(speed))) * speed
    v_t, _ = space.velocity_after(line_of_sticking(space, c), c)
    _, v_n = space.velocity_after(c, line_of_maximum_compression(space, c))
    scale = speed * (1.0 + space.K_tt + space.K_nn)
    assert np.all(np.abs(v_t) <= 1e-12 * scale) and np.all(np.abs(v_n) <= 1e-12 * scale)
    # both lines meet in the stick impulse
    stick_t, stick_n = space.impulse_to(0.0, 0.0)
    np.testing.assert_allclose(line_of_sticking(space, stick_n), stick_t, rtol=0, atol=1e-8 * speed.max())


def test_admissible_is_the_three_conditions(draw, rng):
    space = draw.space
    c_t, c_n = 2.0 * rng.standard_normal((2, len(draw.mu))) * draw.speed
    v_n = space.velocity_after(c_t, c_n)[1]
    expected = (c_n >= 0.0) & (v_n >= 0.0) & (space.alpha(c_t, c_n) <= 1.0)
    ours = admissible(space, c_t, c_n)
    assert 0.01 < expected.mean() < 0.9
    np.testing.assert_array_equal(ours, expected)


@pytest.mark.parametrize(
    "c, v, allowed",
    [
        ((0.0, 1.0), (0.0, -1.0), True),  # plastic
        ((0.0, 2.0), (0.0, -1.0), True),  # elastic: exactly on the ellipse
        ((0.0, 2.0 + 1e-6), (0.0, -1.0), False),  # gains energy
        ((0.0, 1.0 - 1e-6), (0.0, -1.0), False),  # penetrates
        ((-0.5, 1.0), (0.2, -1.0), True),  # spins back: no condition on friction
        ((0.0, -1e-6), (0.0, 0.0), False),  # pulls
    ],
)
def test_admissible_edges(c, v, allowed):
    # a mass point: M_C = identity
    space = contact_space(np.array([[*v, 0.0]]), np.zeros((1, 2)), mass=1.0, k_g=1.0)
    assert admissible(space, np.array([c[0]]), np.array([c[1]]))[0] == allowed


def test_velocity_change_is_the_jacobian_transposed(body, rng):
    _, r, M, J = body
    c = rng.standard_normal((300, 2))
    dv = velocity_change(c[:, 0], c[:, 1], r, mass=MASS, k_g=K_G)
    np.testing.assert_allclose(dv @ M, np.einsum("nji,nj->ni", J, c), rtol=1e-12, atol=1e-12)


def test_measured_impulse_is_the_least_squares_one(body, rng):
    # equation 3.7 in the kinetic metric, by a generic solver, row by row
    dv, r, M, J = body
    found = np.stack(measured_impulse(dv, r, mass=MASS, k_g=K_G), 1)
    metric = np.diag([1.0, 1.0, K_G])
    for i in range(len(dv)):
        A = metric @ np.linalg.inv(M) @ J[i].T
        expected = np.linalg.lstsq(A, metric @ dv[i], rcond=None)[0]
        np.testing.assert_allclose(found[i], expected, rtol=1e-9, atol=1e-12)
        left = dv[i] - np.linalg.inv(M) @ J[i].T @ found[i]
        couple = residual_couple(dv[i : i + 1], r[i : i + 1], mass=MASS, k_g=K_G)[0]
        # what is left is a pure couple in this metric
        error = velocity_error(left, K_G)
        assert error == pytest.approx(abs(couple) / (MASS * np.hypot(K_G, np.linalg.norm(r[i]))), rel=1e-9)


def test_residual_couple_of_an_added_couple(body, rng):
    _, r, M, _ = body
    c, tau = rng.standard_normal((300, 2)), 1e-3 * rng.standard_normal(300)
    dv = velocity_change(c[:, 0], c[:, 1], r, mass=MASS, k_g=K_G)
    dv[:, 2] += tau / M[2, 2]
    np.testing.assert_allclose(residual_couple(dv, r, mass=MASS, k_g=K_G), tau, rtol=0, atol=1e-14)


def test_velocity_error_counts_spin_by_the_radius_of_gyration():
    assert velocity_error(np.array([3.0, 4.0, 0.0]), 0.02) == pytest.approx(5.0)
    assert velocity_error(np.array([[0.0, 0.0, 50.0]]), 0.02)[0] == pytest.approx(1.0)


def test_rows_can_be_selected(draw):
    rows = np.array([3, 1, 4])
    some = draw.space[rows]
    for name in ("v_t", "v_n", "K_tt", "K_nn", "K_tn", "det"):
        np.testing.assert_array_equal(getattr(some, name), getattr(draw.space, name)[rows])


def test_what_holds_after_the_first_slip_is_the_friction_of_that_time():
    # a jam: to stick, the point needs c_t = -0.6 c_n
    space = Contact.planar(*(np.full(2, a) for a in (0.5, -1.0, 1.0, 2.0, 0.6)))
    before, after = np.array([0.9, 0.3]), np.array([0.3, 0.9])
    with np.errstate(all="ignore"):  # a slip that never ends
        path = slip_path(space, before, after)
    np.testing.assert_allclose(path.slope, -before)
    np.testing.assert_allclose(path.slope2, [-0.3, -0.6])  # slides on where friction has become too weak, else sticks
