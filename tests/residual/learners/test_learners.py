"""Learned contact models: recovery of known contacts, uncertainty, frames of effects, and limits."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from impacts_for_tests import made_impacts, saved_model
from known_truth import K_G, MASS, with_outcome

from thesis_lib.contact.bounds import irb_bound
from thesis_lib.contact.space import velocity_error
from thesis_lib.learners.bases import AugmentedBase, LawBase
from thesis_lib.learners.feasible import feasible
from thesis_lib.learners.features import velocity_after
from thesis_lib.learners.gaussian_process import GaussianProcessSettings
from thesis_lib.learners.learners import FeasibleLearner, ImpulseLearner, LawLearner, learners
from thesis_lib.thesis.residual.throwing.belief import through_dynamics

LAW = "anitescu_potra_newton"
FAST = GaussianProcessSettings(restarts=1, iterations=40, device="cpu")
ALL = learners(LAW, FAST)


def _error(prediction, impacts):
    return velocity_error(impacts.v_post - prediction.v_post, impacts.k_g).mean()


@pytest.fixture(scope="module")
def noisy():
    """Wang-Mason with a couple: no rigid law explains it."""
    terms = {"law": "wang_mason", "couple": 0.5, "noise": 0.02}
    return made_impacts(250, seed=0, **terms), made_impacts(300, seed=1, **terms)


@pytest.fixture(scope="module")
def trained(noisy):
    rng = np.random.default_rng(0)
    return {name: learner.fit(noisy[0], rng) for name, learner in ALL.items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", ALL)
def test_every_learner_says_what_it_must(name, trained, noisy):
    _, test = noisy
    out = trained[name].predict(test)
    n, q = len(test), out.impulse.shape[1]
    assert q == (3 if "wrench" in name else 2)
    assert out.v_post.shape == (n, 3)
    # v⁺ is that of the impulse, the covariance is one, and nothing after impact is looked at
    np.testing.assert_allclose(velocity_after(out.impulse, test), out.v_post, atol=1e-9)
    if isinstance(trained[name], ImpulseLearner):
        covariance = trained[name].predict(test, covariance=True).covariance
        assert covariance.shape == (n, q, q) and (np.linalg.eigvalsh(covariance) > -1e-12).all()
    np.testing.assert_array_equal(out.feasible, feasible(test.v_pre, out.v_post, test.r, K_G))
    assert feasible(test.v_pre, out.v_projected, test.r, K_G).all()
    blind = replace(test, v_post=np.full_like(test.v_post, np.nan))
    np.testing.assert_array_equal(trained[name].predict(blind).v_post, out.v_post)


def test_a_couple_is_learned_by_wrenches_and_by_nothing_else(trained, noisy):
    _, test = noisy
    error = {name: _error(model.predict(test), test) for name, model in trained.items()}
    bound = irb_bound(test.v_pre, test.v_post, test.r, mass=MASS, k_g=K_G).error.mean()
    rigid = [name for name in error if "wrench" not in name]
    wrench = [name for name in error if "wrench" in name]
    assert min(error[name] for name in rigid) > bound
    assert max(error[name] for name in wrench) < 0.7 * bound


def test_a_residual_on_the_right_law_is_nothing():
    train, test = made_impacts(80, seed=2, noise=0.02), made_impacts(200, seed=3)
    for name in ("residual_rigid", "residual_wrench"):
        model = ALL[name].fit(train, np.random.default_rng(0))
        law = LawLearner(LawBase(LAW)).fit(train, np.random.default_rng(0))
        # with 80 impacts and 0.02 m/s of noise; the data-driven model of the same impacts is far behind
        assert _error(model.predict(test), test) < 0.01
        assert _error(law.predict(test), test) < 0.01
        alone = ALL[name.replace("residual", "rigid" if "rigid" in name else "wrench")[:6].rstrip("_") + "_x1"]
        assert _error(alone.fit(train, np.random.default_rng(0)).predict(test), test) > 0.02


def test_learned_parameters_find_friction_that_changes():
    """μ rises with the speed of slip: one μ fails, learned ones follow."""
    from thesis_lib.contact.space import contact_space

    def impacts(n, seed):
        one = made_impacts(n, seed)
        slip = np.abs(contact_space(one.v_pre, one.r, mass=MASS, k_g=K_G).v_t)
        return with_outcome(one, LAW, 0.05 + 0.3 * slip / (1.0 + slip), 0.5)

    train, test = impacts(200, 4), impacts(200, 5)
    learned = ALL["law_parameters"].fit(train, np.random.default_rng(0)).predict(test)
    fixed = LawLearner(LawBase(LAW)).fit(train, np.random.default_rng(0)).predict(test)
    assert _error(learned, test) < 0.5 * _error(fixed, test)


@pytest.mark.parametrize("name", ["wrench_x1_omega", "residual_wrench"])
def test_standard_deviations_mean_what_they_say(name, trained, noisy):
    _, test = noisy
    out = trained[name].predict(test, covariance=True, noise=True)
    std = np.sqrt(np.einsum("nii->ni", through_dynamics(out.jacobian, out.covariance)))
    inside = np.abs(test.v_post - out.v_post) <= 1.96 * std
    # 95 % within a binomial interval of 300 impacts, and what the linearisation costs
    assert 0.90 <= inside.mean() <= 0.99


def test_samples_of_the_feasible_learner_need_no_projection(trained, noisy):
    from thesis_lib.learners.feasible import from_latent
    from thesis_lib.learners.features import features

    _, test = noisy
    for name in ("feasible_rigid", "feasible_wrench"):
        model = trained[name]
        mean, variance = model.process.predict(features(test, model.feature_set), noise=True)
        drawn = mean + 5.0 * np.sqrt(variance) * np.random.default_rng(0).normal(size=mean.shape)
        assert feasible(test.v_pre, from_latent(test.v_pre, drawn, test.r, K_G), test.r, K_G).all()


EFFECTS = [
    {},
    {"mirrored_rotation.mirrored": 1.0},
    {"com_offset.c_x": 2e-3, "com_offset.c_y": -1e-3},
    {"angle_offset.d_theta": 0.1, "wrong_inertia.d_I": 0.2},
]


@pytest.mark.parametrize("effects", EFFECTS)
def test_frames_go_there_and_back(effects):
    base, impacts = AugmentedBase(saved_model(effects)), made_impacts(60, noise=0.3)
    seen = base.seen(impacts)
    np.testing.assert_allclose(base.measured(impacts, seen.v_post), impacts.v_post, atol=1e-9)


@pytest.mark.parametrize("effects", EFFECTS)
def test_data_of_an_effect_are_explained_by_the_law_with_it_and_learned_on_it(effects):
    """Impacts made with an effect: the base with it is exact, and a residual on it leaves it so."""
    base = AugmentedBase(saved_model(effects))

    def with_effect(n, seed):
        one = made_impacts(n, seed)
        return replace(one, v_post=base.predict(one))

    train, test = with_effect(60, 0), with_effect(100, 1)
    rng = np.random.default_rng(0)
    assert _error(LawLearner(base).fit(train, rng).predict(test), test) < 1e-9
    residual = ImpulseLearner("X1", True, base, True, settings=FAST).fit(train, rng).predict(test)
    assert _error(residual, test) < 1e-6
    # and the seen frame is the one in which no couple is left
    plain = ImpulseLearner("X1", False, base, False, settings=FAST).fit(train, rng)
    assert np.median(velocity_error(test.v_post - plain.predict(test).v_post, K_G)) < 0.15


def test_the_jacobian_maps_impulses_to_measured_velocities():
    base, impacts = AugmentedBase(saved_model(EFFECTS[2])), made_impacts(60, noise=0.1)
    model = ImpulseLearner("X1", True, base, True, settings=FAST).fit(impacts, np.random.default_rng(0))
    out = model.predict(impacts)
    step = 1e-3 * MASS * np.array([1.0, -0.5, 0.01])
    seen = base.seen(impacts)
    moved = base.measured(impacts, velocity_after(out.impulse + step, seen))
    np.testing.assert_allclose(moved - out.v_post, np.einsum("nij,j->ni", out.jacobian, step), atol=1e-9)


@dataclass(frozen=True)
class Unsolvable(LawBase):
    """A law that has no solution for the impact of trial 3."""

    def fit(self, impacts):
        return Unsolvable(self.law, 0.1, 0.5)

    def predict(self, impacts):
        return np.where((impacts.trial == 3)[:, None], np.nan, super().predict(impacts))


def test_a_law_without_a_solution_is_nan_and_not_zero():
    train = made_impacts(40, noise=0.05)
    model = ImpulseLearner("X1", False, Unsolvable(LAW), True, settings=FAST).fit(train, np.random.default_rng(0))
    assert len(model.process.x) == 39
    out = model.predict(train)
    np.testing.assert_array_equal(np.isnan(out.v_post).any(axis=1), train.trial == 3)
    assert not out.feasible[3]


def test_too_few_impacts_are_refused():
    with pytest.raises(ValueError, match="two"):
        FeasibleLearner("X1", False, settings=FAST).fit(made_impacts(1), np.random.default_rng(0))
