"""Double hits: against small time steps, and what learning from them does to learned impulses."""

from dataclasses import replace

import numpy as np
import pytest
from throws_for_tests import BODY, RIG

from thesis_lib.contact import LAWS
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.learners.bases import LawBase
from thesis_lib.learners.gaussian_process import GaussianProcessSettings
from thesis_lib.learners.learners import ImpulseLearner
from thesis_lib.thesis.residual.dice.models import hit_again
from thesis_lib.thesis.residual.throwing.belief import covariance_root
from thesis_lib.thesis.residual.throwing.flight import fly
from thesis_lib.thesis.residual.throwing.propagation import LearnedImpact
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings
from thesis_lib.thesis.residual.throwing.throw import LawImpact, state_at

LAW = LawImpact(LAWS["mirtich"], 0.15, 0.45, RIG.k_g)
WITHIN = 0.03


def impacts(n: int, tilt: float, seed: int = 0) -> Impacts:
    """Impacts of a square up to `tilt` (rad) from lying flat."""
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-tilt, tilt, n)
    v = np.column_stack([rng.normal(0, 0.3, n), rng.uniform(-1.0, -0.3, n), rng.normal(0, 3.0, n)])
    r, _ = BODY.lowest(theta)
    q = np.column_stack([np.zeros(n), -r[:, 1], theta])
    index = np.arange(n)
    made = Impacts(trial=index, impact=index, q=q, v_pre=v, v_post=v, r=r, k_g=RIG.k_g)
    return made.select(v[:, 1] + r[:, 0] * v[:, 2] < -0.1)


def test_second_hits_are_those_of_small_time_steps():
    given = impacts(400, np.pi / 4)
    n = len(given)
    _, after, _ = LAW(given.q, given.v_pre, given.r, np.zeros(n, bool))
    _, corner = BODY.lowest(given.q[:, 2])
    first = np.full(n, -1)
    for t in np.arange(1e-4, WITHIN, 1e-4):
        q, _ = fly(BODY, given.q, after, np.full(n, t))
        r, lowest = BODY.lowest(q[:, 2])
        below = (q[:, 1] + r[:, 1] < 0.0) & (first < 0)
        first[below] = lowest[below]
    expected = (first >= 0) & (first != corner)
    found = hit_again(BODY, LAW, given, WITHIN)
    assert 0.1 < expected.mean() < 0.9
    assert np.mean(found != expected) < 0.01  # hits within the last step


def test_flat_landings_are_double_hits_and_landings_on_a_corner_are_not():
    flat, steep = impacts(200, np.radians(1.0)), impacts(400, np.pi / 4)
    steep = steep.select(np.abs(steep.q[:, 2]) > np.radians(35.0))
    assert hit_again(BODY, LAW, flat, WITHIN).mean() > 0.6
    assert hit_again(BODY, LAW, steep, WITHIN).mean() < 0.05


def test_a_measured_height_does_not_matter():
    given = impacts(200, np.pi / 4)
    lifted = replace(given, q=given.q + [0.0, 0.002, 0.0])
    np.testing.assert_array_equal(hit_again(BODY, LAW, given, WITHIN), hit_again(BODY, LAW, lifted, WITHIN))


@pytest.mark.slow
def test_without_double_hits_fewer_learned_impulses_are_infeasible():
    # a law makes every hit; what is measured is the velocity after all hits within 20 ms
    settings = ThrowSettings()
    given = impacts(500, np.pi / 4, seed=1)
    span = np.full(len(given), 0.02)
    _, v = state_at(BODY, given.q, given.v_pre, span, LAW, settings)
    v[:, 1] += BODY.gravity * span
    known = np.isfinite(v).all(axis=1)
    given = replace(given.select(known), v_post=v[known])
    alone = given.select(~hit_again(BODY, LAW, given, WITHIN))
    rate = {}
    new = impacts(500, np.pi / 4, seed=2)
    for name, some in (("all", given), ("alone", alone)):
        settings = GaussianProcessSettings(device="cpu")
        learner = ImpulseLearner("X1", True, LawBase("mirtich", 0.15, 0.45), True, settings=settings)
        contact = LearnedImpact(BODY, LAW, trained=learner.fit(some, np.random.default_rng(0)), slowest=0.12)
        at = new.q, new.v_pre, new.r
        mean, cov, took = contact.distribution(*at, np.zeros(len(new), bool))
        noise = np.random.default_rng(0).standard_normal(mean.shape)
        drawn = mean + np.einsum("nij,nj->ni", covariance_root(cov), noise)
        rate[name] = 1.0 - contact.feasible(*at, drawn, took).mean()
    assert rate["alone"] < 0.5 * rate["all"]
