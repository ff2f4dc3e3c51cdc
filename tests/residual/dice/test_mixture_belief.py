"""Gaussian-mixture beliefs of throws: exact flights, moments against particles, calibration of right beliefs."""

from dataclasses import replace

import numpy as np
import pytest
from throws_for_tests import HALF, RIG, throws

from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.residual.dice.data import MeasuredContacts, ThrowReleases
from thesis_lib.residual.dice.fit import DiceModel
from thesis_lib.residual.dice.mixture_belief import first_contact_scores, first_contact_summary, fly_gaussian, propagate
from thesis_lib.residual.dice.models import Thrower
from thesis_lib.residual.dice.settings import DiceStudySettings
from thesis_lib.residual.learners.bases import LawBase
from thesis_lib.residual.learners.gaussian_process import GaussianProcessSettings
from thesis_lib.residual.learners.learners import ImpulseLearner
from thesis_lib.residual.throwing.belief import covariance_root
from thesis_lib.residual.throwing.flight import first_touch, fly
from thesis_lib.residual.throwing.propagation import LearnedImpact, Sampled, ScatteredLaw
from thesis_lib.residual.throwing.settings import ThrowSettings
from thesis_lib.residual.throwing.throw import state_at

MODEL = DiceModel(HALF, 0.0, 0.0, RIG.k_g, "mirtich", 0.15, 0.45, 9.81, d_theta=-0.03, c_v=0.4, c_w=0.6)
BODY, LAW = MODEL.body, MODEL.impact
SCATTER = np.diag([0.05, 0.08, 0.002]) ** 2
MICRO = ThrowSettings().micro
START = np.diag([1e-4, 1e-4, 1e-3, 3e-3, 3e-3, 3e-2]) ** 2


def samples(q, v, count, rng):
    """Starts (n, count, 3) each about q and v (n, 3)."""
    s = np.hstack([q, v])[:, None] + rng.standard_normal((len(q), count, 6)) @ covariance_root(START[None])[0].T
    return s[..., :3], s[..., 3:]


def test_a_gaussian_flies_as_its_samples_do_and_back():
    rng = np.random.default_rng(0)
    root = 0.1 * rng.normal(size=(6, 6))
    mean, cov = rng.normal(size=(1, 6)), (root @ root.T)[None]
    t = np.array([0.3])
    end, spread = fly_gaussian(BODY, mean, cov, t)
    s = mean + rng.standard_normal((200_000, 6)) @ root.T
    flown = np.hstack(fly(BODY, s[:, :3], s[:, 3:], np.full(len(s), 0.3)))
    assert end[0] == pytest.approx(flown.mean(0), abs=5e-3)
    assert spread[0] == pytest.approx(np.cov(flown.T), abs=0.01 * np.abs(spread).max())
    for one, other in zip(fly_gaussian(BODY, end, spread, -t), (mean, cov)):
        assert one == pytest.approx(other)


def test_before_the_first_touch_the_belief_is_free_flight():
    q, v = throws(5)
    t, _ = first_touch(BODY, q, v)
    rng = np.random.default_rng(0)
    q_s, v_s = samples(q, v, 7, rng)
    belief = propagate(BODY, q_s, v_s, ScatteredLaw(BODY, LAW, relative=SCATTER), 0.5 * t, MICRO, rng)
    flown = np.hstack(fly(BODY, q_s.reshape(-1, 3), v_s.reshape(-1, 3), np.repeat(0.5 * t, 7)))
    assert belief.mean.reshape(-1, 6) == pytest.approx(flown)
    assert not belief.cov.any() and belief.sample == pytest.approx(belief.mean)


@pytest.mark.parametrize("after", [0.02, 0.25])
def test_moments_are_those_of_independently_thrown_particles(after):
    q, v = throws(1)
    q[0, 2], v[0, 2] = 0.6, 1.0  # lands on one corner; 0.25 s later it has hit again
    contact = ScatteredLaw(BODY, LAW, relative=SCATTER)
    t, _ = first_touch(BODY, q, v)
    span = t + after
    rng = np.random.default_rng(0)
    belief = propagate(BODY, *samples(q, v, 4000, rng), contact, span, MICRO, rng)
    assert (belief.cov[0, :, 3, 3] > 0.0).mean() > 0.95
    mean = belief.mean[0].mean(0)
    std = np.sqrt(np.einsum("mii->i", belief.cov[0]) / 4000 + belief.mean[0].var(0))
    q_s, v_s = (x[0] for x in samples(q, v, 20_000, np.random.default_rng(1)))
    settings, until = ThrowSettings(max_contacts=100), np.full(len(q_s), span[0])
    end = np.hstack(state_at(BODY, q_s, v_s, until, contact, settings, np.random.default_rng(2)))
    end = end[np.isfinite(end).all(1)]
    assert mean == pytest.approx(end.mean(0), abs=0.1 * end.std(0).max())
    if after < 0.1:  # later a Gaussian also holds what would have hit once more
        assert std == pytest.approx(end.std(0), rel=0.1, abs=2e-3)
    assert belief.sample[0].std(0) == pytest.approx(end.std(0), rel=0.1, abs=2e-3)


def test_each_contact_widens_the_belief_of_a_throw():
    q, v = throws(1)
    rng = np.random.default_rng(0)
    contact = ScatteredLaw(BODY, LAW, relative=SCATTER)
    width = [
        propagate(BODY, *samples(q, v, 300, rng), contact, np.array([span]), MICRO, rng).sample[0, :, 0].std()
        for span in (0.0, 0.15, 0.4)
    ]
    assert 10.0 * width[0] < width[1] < 0.5 * width[2]


def measured(n, scatter):
    """Held-out throws and first contacts that a scattered law makes, measured with noise, in different orders."""
    rng = np.random.default_rng(5)
    q, v = throws(n, seed=3)
    t, _ = first_touch(BODY, q, v)
    span = t + 0.015
    contact = ScatteredLaw(BODY, LAW, relative=scatter)
    q_end, v_end = state_at(BODY, q, v, span, contact, ThrowSettings(max_contacts=60), rng)
    turn = [0.0, 0.0, MODEL.d_theta]
    state, end = (
        np.hstack(x) + rng.multivariate_normal(np.zeros(6), START, n) for x in ((q + turn, v), (q_end + turn, v_end))
    )
    index = np.arange(n)
    states = state[:, :3], state[:, 3:], end[:, :3], end[:, 3:]
    contacts = MeasuredContacts(index, index >= 0, *states, span, last_hit=np.zeros(len(index)))
    releases = ThrowReleases(index, state[:, :3], state[:, 3:], np.tile(START, (n, 1, 1)), end[:, :3], {}, np.ones(3))
    good = np.isfinite(end).all(1)
    return releases.select(rng.permutation(n)), contacts.select(good)


@pytest.mark.slow
def test_a_right_belief_is_calibrated_and_scores_best():
    releases, contacts = measured(250, SCATTER)
    throwers = [
        Thrower(name, MODEL, ScatteredLaw(BODY, LAW, relative=factor**2 * SCATTER), Sampled(BODY, LAW, draws=1))
        for name, factor in (("right", 1.0), ("narrow", 0.3), ("wide", 3.0))
    ]
    rng = np.random.default_rng(0)
    scores = first_contact_scores(throwers, releases, contacts, DiceStudySettings(), rng)
    table = first_contact_summary(scores, 200, rng).set_index(["model", "belief", "quantity"])
    value = table["value"].unstack("quantity")
    right = value.loc["right", "mixture"]
    for level in (50, 80, 95):
        row = table.loc["right", "mixture", f"coverage_{level}"]
        assert abs(row["value"] - level / 100) <= 0.03 or row["low"] <= level / 100 <= row["high"]
    for belief in ("mixture", "particles"):
        part = value.xs(belief, level="belief")
        assert part["log_score"].idxmax() == "right"
        assert part["log_score_median"].idxmax() != "wide"
        assert part["crps_velocity"].idxmin() == "right"
    assert value.loc[("narrow", "mixture"), "coverage_80"] < 0.6
    assert value.loc[("wide", "mixture"), "coverage_80"] > 0.9
    # what the Gaussians of the components are for: the particles must guess their kernels
    assert right["log_score"] > value.loc[("right", "particles"), "log_score"]
    assert right["crps_velocity"] == pytest.approx(value.loc[("right", "particles"), "crps_velocity"], rel=0.1)
    assert len(scores) == 3 * 2 * len(contacts)


def test_throws_outside_the_range_of_training_are_flagged():
    q, v = throws(300, seed=1)
    at, u = (x for x in fly(BODY, q, v, first_touch(BODY, q, v)[0]))
    r, _ = BODY.lowest(at[:, 2])
    index = np.arange(len(q))
    known = Impacts(trial=index, impact=index, q=at, v_pre=u, v_post=u, r=r, k_g=RIG.k_g)
    known = replace(known, v_post=LAW(at, u, r, np.zeros(len(q), bool), np.random.default_rng(0))[1])
    learner = ImpulseLearner(
        "X1", True, LawBase("mirtich"), True, settings=GaussianProcessSettings(restarts=1, device="cpu")
    )
    trained = learner.fit(known, np.random.default_rng(0))
    rng = np.random.default_rng(0)
    flagged = {}
    for name, factor in (("like training", 1.0), ("faster", 2.0)):
        q, v = throws(40, seed=2)
        v = v * factor
        t, _ = first_touch(BODY, q, v)
        contact = LearnedImpact(BODY, LAW, trained=trained)
        belief = propagate(BODY, *samples(q, v, 5, rng), contact, t + 1e-3, MICRO, rng)
        flagged[name] = belief.out_of_range.mean()
        assert (contact.tally.out_of_range > 0) == (flagged[name] > 0)
    assert flagged["like training"] < 0.2 and flagged["faster"] > 0.9
