"""Features and targets: exact round trips, what they may depend on, and symmetries."""

from dataclasses import replace

import numpy as np
import pytest
from impacts_for_tests import K_G, MASS, made_impacts

from thesis_lib.contact.space import residual_couple
from thesis_lib.learners.features import features, impulse_of, velocity_after, velocity_map

ROUNDING = 1e-12


@pytest.fixture(scope="module")
def impacts():
    return made_impacts(50, noise=0.3)


def test_a_wrench_gives_the_velocity_back_exactly(impacts):
    wrench = impulse_of(impacts.dv, impacts, wrench=True)
    np.testing.assert_allclose(velocity_after(wrench, impacts), impacts.v_post, atol=ROUNDING)
    np.testing.assert_array_equal(wrench[:, 2], residual_couple(impacts.dv, impacts.r, mass=MASS, k_g=K_G))


def test_a_rigid_impulse_gives_back_what_an_impulse_can(impacts):
    rng = np.random.default_rng(0)
    c = 0.1 * rng.normal(size=(len(impacts), 2))
    moved = replace(impacts, v_post=velocity_after(c, impacts))
    np.testing.assert_allclose(impulse_of(moved.dv, moved, wrench=False), c, atol=ROUNDING)
    # and of any change it is the nearest in the kinetic metric: what is left is perpendicular to all impulses
    left = impacts.v_post - velocity_after(impulse_of(impacts.dv, impacts, wrench=False), impacts)
    A = velocity_map(impacts, wrench=False)
    np.testing.assert_allclose(np.einsum("nij,ni->nj", A, left * [1.0, 1.0, K_G**2]), 0.0, atol=1e-10)


def test_features_are_the_thesiss(impacts):
    x1, x2 = features(impacts, "X1"), features(impacts, "X2")
    M_c = np.array([[x1[:, 0], x1[:, 1]], [x1[:, 1], x1[:, 2]]])
    J = np.zeros((len(impacts), 2, 3))
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    J[:, 0, 2], J[:, 1, 2] = -impacts.r[:, 1], impacts.r[:, 0]
    inverse = np.diag([1.0 / MASS, 1.0 / MASS, 1.0 / (MASS * K_G**2)])
    np.testing.assert_allclose(np.moveaxis(M_c, -1, 0), np.linalg.inv(J @ inverse @ np.swapaxes(J, 1, 2)), rtol=1e-9)
    v_c = np.einsum("nij,nj->ni", J, impacts.v_pre)
    np.testing.assert_allclose(x1[:, 3:], v_c, atol=ROUNDING)
    np.testing.assert_allclose(x2, np.einsum("ijn,nj->ni", M_c, v_c), atol=ROUNDING)
    angle, size = features(impacts, "X2_polar").T
    np.testing.assert_allclose(np.stack([size * np.cos(angle), size * np.sin(angle)], 1), x2, atol=ROUNDING)
    np.testing.assert_array_equal(features(impacts, "X1_omega"), np.column_stack([x1, impacts.v_pre[:, 2]]))


@pytest.mark.parametrize("chosen", ["X1", "X2", "X2_polar", "X1_omega", "full"])
def test_features_know_nothing_of_the_outcome(impacts, chosen):
    blind = replace(impacts, v_post=np.full_like(impacts.v_post, np.nan))
    np.testing.assert_array_equal(features(blind, chosen), features(impacts, chosen))


def test_the_ten_inputs_of_the_contact_map_hold_all_that_x1_is_made_of(impacts):
    full = features(impacts, "full")
    assert full.shape == (len(impacts), 10)
    q, v, r, mass, inertia = np.split(full, [3, 6, 8, 9], axis=1)
    k_g = np.sqrt(inertia[0, 0] / mass[0, 0])
    again = replace(impacts, q=q, v_pre=v, r=r, mass=float(mass[0, 0]), k_g=float(k_g))
    np.testing.assert_allclose(features(again, "X1_omega"), features(impacts, "X1_omega"), rtol=1e-9)
    # unlike X1 it tells where along the surface the impact is, which contact does not depend on
    away = replace(impacts, q=impacts.q + [0.3, 0.0, 0.0])
    np.testing.assert_array_equal(features(away, "X1"), features(impacts, "X1"))
    assert (features(away, "full") != full).any(axis=0).tolist() == [True] + 9 * [False]
