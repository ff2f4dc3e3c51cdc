"""The contact LCP: its conditions, published values, and failures; Drake's solver is in `test_stepping`."""

import numpy as np
import pytest

from thesis_lib.simulate.stepping.lcp import LcpStatus, complementarity_residual, contact_lcp, solve_lcp_enumeration

RESIDUAL_TOL = 1e-9  # promised complementarity on dimensionless data; rounding leaves about 1e-14
AGREEMENT_TOL = 1e-9  # relative; both solvers are direct, conditioning of K (about 1e2) times rounding is 1e-14
PUBLISHED_TOL = 5e-7  # the reference values carry six digits on impulses below 1 N s


def inertia(r, k2, mass=1.0):
    """K (n, 2, 2) written out, independently of any Jacobian code."""
    r, k2 = np.asarray(r, float), np.asarray(k2, float)
    K_tt = (1 + r[:, 1] ** 2 / k2) / mass
    K_nn = (1 + r[:, 0] ** 2 / k2) / mass
    K_tn = -r[:, 0] * r[:, 1] / k2 / mass
    return np.stack([np.stack([K_tt, K_tn], -1), np.stack([K_tn, K_nn], -1)], -2)


def random_cases(n, seed=0):
    rng = np.random.default_rng(seed)
    k2, r = rng.uniform(0.02, 0.5, n), rng.uniform(-1, 1, (n, 2))
    v_c = np.stack([rng.uniform(-2, 2, n), -rng.uniform(0.05, 2, n)], axis=1)
    return inertia(r, k2), v_c, rng.uniform(0, 1.5, n), rng.uniform(0, 1, n)


def after(K, v_c, c):
    return v_c + np.einsum("nij,nj->ni", K, c)


def test_impulse_obeys_newton_coulomb_and_opposes_the_final_slip():
    K, v_c, mu, epsilon = random_cases(20_000, seed=1)
    out = contact_lcp(K, v_c, mu, epsilon)
    assert (out.status == LcpStatus.SOLVED).all() and out.residual.max() <= RESIDUAL_TOL
    (c_t, c_n), (v_t, v_n) = out.c.T, after(K, v_c, out.c).T
    np.testing.assert_allclose(v_n, -epsilon * v_c[:, 1], atol=AGREEMENT_TOL)
    assert (c_n > 0).all()
    assert (np.abs(c_t) <= mu * c_n + AGREEMENT_TOL).all()
    slides = np.abs(v_t) > AGREEMENT_TOL
    assert 0.1 < slides.mean() < 0.9  # both modes are exercised
    np.testing.assert_allclose(c_t[slides], (-np.sign(v_t) * mu * c_n)[slides], atol=AGREEMENT_TOL)


B = dict(r=(0.006, -0.031), k2=3.7e-4, mass=0.0364, v=(0.6, -2.5))
ROD = dict(r=(-np.sqrt(0.125), -np.sqrt(0.125)), k2=1 / 12, mass=1.0, v=(0.2, -1.0))


@pytest.mark.parametrize(
    ("case", "mu", "epsilon", "expected"),
    [
        (dict(r=(0.0, -0.05), k2=0.5 * 0.05**2, mass=1.0, v=(1.0, -2.0)), 0.2, 0.6, (-1 / 3, 3.2)),
        (dict(r=(0.0, -0.05), k2=0.5 * 0.05**2, mass=1.0, v=(1.0, -2.0)), 0.0, 0.6, (0.0, 3.2)),
        (B, 0.2, 0.6, (-0.0262975, 0.144737)),
        (B, 0.2, 0.0, (-0.0182592, 0.0912961)),
        (B, 0.0, 0.6, (0.0, 0.132690)),
        (ROD, 0.2, 0.6, (0.145455, 0.727273)),
        (ROD, 1.2, 0.6, (0.475, 0.925)),
        (ROD, 0.2, 0.0, (0.0909091, 0.454545)),
        ({**ROD, "v": (0.6, -1.0)}, 0.5, 0.9, (0.3375, 0.9625)),
    ],
)
def test_known_impulses(case, mu, epsilon, expected):
    K = inertia([case["r"]], [case["k2"]], case["mass"])
    out = contact_lcp(K, np.array([case["v"]]), mu, epsilon)
    np.testing.assert_allclose(out.c[0], expected, atol=PUBLISHED_TOL)


def test_mirror_and_scale():
    K, v_c, mu, epsilon = random_cases(2000, seed=3)
    out = contact_lcp(K, v_c, mu, epsilon)
    flip = np.array([-1.0, 1.0])
    mirrored = contact_lcp(K * np.outer(flip, flip), v_c * flip, mu, epsilon)
    np.testing.assert_allclose(mirrored.c, out.c * flip, atol=AGREEMENT_TOL)
    # c is homogeneous in v and in 1/K: grams and kilometres make no difference to what is solved
    scaled = contact_lcp(K * 1e6, v_c * 1e-4, mu, epsilon)
    assert (scaled.status == LcpStatus.SOLVED).all()
    np.testing.assert_allclose(scaled.c * 1e10, out.c, rtol=AGREEMENT_TOL, atol=AGREEMENT_TOL)


def test_limits():
    K, v_c, _, epsilon = random_cases(2000, seed=4)
    frictionless = contact_lcp(K, v_c, 0.0, epsilon).c
    np.testing.assert_allclose(frictionless[:, 0], 0.0, atol=AGREEMENT_TOL)
    np.testing.assert_allclose(frictionless[:, 1], -(1 + epsilon) * v_c[:, 1] / K[:, 1, 1])
    # plastic and rough: the contact stops, unless that would take an impulse that pulls
    pushes = np.linalg.solve(K, -v_c[:, :, None])[:, 1, 0] > 0.0
    assert 0.5 < pushes.mean() < 1.0
    rough = contact_lcp(K, v_c, 1e6, 0.0)
    np.testing.assert_allclose(after(K, v_c, rough.c)[pushes], 0.0, atol=AGREEMENT_TOL)
    assert (rough.c[:, 1] > 0.0).all()


def test_separating_and_resting_contacts_get_no_impulse():
    K, v_c, mu, epsilon = random_cases(500, seed=5)
    v_c[:, 1] *= -1.0
    v_c[:100, 1] = 0.0  # with much friction, some of these could also jam: two solutions
    v_c[:5] = 0.0
    out = contact_lcp(K, v_c, mu, epsilon)
    assert (out.status == LcpStatus.SOLVED).all()
    np.testing.assert_allclose(out.c, 0.0, atol=AGREEMENT_TOL)


def test_failures_keep_their_row_and_their_status():
    M = np.array([[[2.0]], [[-1.0]], [[np.nan]], [[1.0]]])
    q = np.array([[-4.0], [-1.0], [-1.0], [np.inf]])
    z, status = solve_lcp_enumeration(M, q)
    assert status.tolist() == [
        LcpStatus.SOLVED,
        LcpStatus.NO_SOLUTION,
        LcpStatus.INVALID_INPUT,
        LcpStatus.INVALID_INPUT,
    ]
    np.testing.assert_array_equal(z, [[2.0], [np.nan], [np.nan], [np.nan]])
    K, v_c, mu, epsilon = random_cases(3, seed=8)
    v_c[1, 0] = np.nan
    out = contact_lcp(K, v_c, mu, epsilon)
    assert out.status.tolist() == [LcpStatus.SOLVED, LcpStatus.INVALID_INPUT, LcpStatus.SOLVED]
    assert np.isnan(out.c[1]).all() and np.isnan(out.residual[1]) and np.isfinite(out.c[[0, 2]]).all()


def test_general_lcp_of_any_small_size():
    rng = np.random.default_rng(9)
    for k in (1, 2, 3, 6):
        A = rng.normal(size=(200, k, k))
        M = A @ np.swapaxes(A, 1, 2) + 0.1 * np.eye(k)  # positive definite: exactly one solution
        truth = rng.uniform(0.1, 1, (200, k)) * rng.integers(0, 2, (200, k))
        slack = rng.uniform(0.1, 1, (200, k)) * (truth == 0)
        q = slack - np.einsum("nij,nj->ni", M, truth)
        z, status = solve_lcp_enumeration(M, q)
        assert (status == LcpStatus.SOLVED).all()
        np.testing.assert_allclose(z, truth, atol=AGREEMENT_TOL)
        assert complementarity_residual(M, q, z).max() <= RESIDUAL_TOL
        # and the residual sees an error of any component
        assert complementarity_residual(M, q, z + 1e-6).min() > RESIDUAL_TOL
