"""Feasible velocities: projection against a generic optimiser, coordinates, the range of training."""

from dataclasses import replace

import numpy as np
import pytest
from impacts_for_tests import K_G, MASS, made_impacts

from thesis_lib.contact.space import velocity_error
from thesis_lib.learners.feasible import feasible, from_latent, project, to_latent
from thesis_lib.learners.features import impulse_of, velocity_after

SAME = 1e-9


@pytest.fixture(scope="module")
def wild():
    """Impacts whose outcomes are mostly not feasible."""
    return made_impacts(200, seed=1, noise=1.5)


def _reached(impacts, wrench):
    """Outcomes that a wrench (all) or a point impulse reaches."""
    return velocity_after(impulse_of(impacts.dv, impacts, wrench=wrench), impacts)


@pytest.mark.parametrize("wrench", [False, True])
def test_projections_are_feasible_idempotent_and_leave_the_feasible_alone(wild, wrench):
    v = _reached(wild, wrench)
    before = feasible(wild.v_pre, v, wild.r, K_G)
    assert 0.1 < before.mean() < 0.9
    near = project(wild.v_pre, v, wild.r, K_G, wrench=wrench)
    assert feasible(wild.v_pre, near, wild.r, K_G).all()
    np.testing.assert_array_equal(near[before], v[before])
    np.testing.assert_allclose(project(wild.v_pre, near, wild.r, K_G, wrench=wrench), near, atol=SAME)
    assert (velocity_error(near - v, K_G)[~before] > 0.0).all()
    if not wrench:  # still reached by an impulse through the contact point
        np.testing.assert_allclose(_reached(replace(wild, v_post=near), False), near, atol=1e-8)


@pytest.mark.parametrize("wrench", [False, True])
def test_projections_are_nearest(wild, wrench):
    from scipy.optimize import minimize

    v = _reached(wild, wrench)
    near = project(wild.v_pre, v, wild.r, K_G, wrench=wrench)
    ours = velocity_error(near - v, K_G)
    for i in np.flatnonzero(~feasible(wild.v_pre, v, wild.r, K_G))[:25]:
        one = wild.select([i])
        scale = MASS * np.array([1.0, 1.0, K_G])[: 3 if wrench else 2]

        def after(c, one=one, scale=scale):
            return velocity_after(scale * c[None], one)[0]

        limits = [
            {"type": "ineq", "fun": lambda c, after=after, r=one.r[0]: after(c)[1] + r[0] * after(c)[2]},
            {
                "type": "ineq",
                "fun": lambda c, after=after, one=one: (
                    velocity_error(one.v_pre[0], K_G) ** 2 - velocity_error(after(c), K_G) ** 2
                ),
            },
        ]
        start = impulse_of(near[i : i + 1] - one.v_pre, one, wrench=wrench)[0] / scale
        found = minimize(
            lambda c, after=after, i=i: velocity_error(after(c) - v[i], K_G) ** 2,
            0.9 * start,
            constraints=limits,
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 300},
        )
        assert ours[i] == pytest.approx(np.sqrt(found.fun), abs=1e-4)


@pytest.mark.parametrize("axes", [2, 3])
def test_every_latent_is_feasible(wild, axes):
    s = 4.0 * np.random.default_rng(0).normal(size=(len(wild), axes))
    assert feasible(wild.v_pre, from_latent(wild.v_pre, s, wild.r, K_G), wild.r, K_G).all()


@pytest.mark.parametrize("wrench", [False, True])
def test_coordinates_of_the_feasible_set_go_there_and_back(wild, wrench):
    s = np.random.default_rng(0).uniform(-3.0, 3.0, (len(wild), 3 if wrench else 2))  # beyond lies the margin
    v = from_latent(wild.v_pre, s, wild.r, K_G)
    np.testing.assert_allclose(to_latent(wild.v_pre, v, wild.r, K_G, wrench=wrench), s, atol=1e-7)
