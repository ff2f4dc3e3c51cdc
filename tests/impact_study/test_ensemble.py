"""Ensemble parameters: what was put in comes out, and the standard errors are honest."""

from dataclasses import replace

import numpy as np
import pytest
from known_truth import falling_ellipses

from thesis_lib.coefficients import ensemble
from thesis_lib.coefficients.cost import misfit, misfit_table, target_of
from thesis_lib.coefficients.ensemble import MU_MAX, TOLERANCE, fit_ensemble
from thesis_lib.contact import LAWS, SIX_LAWS

MU, EPSILON = 0.1237, 0.5461  # not on any grid line
EXACT = 1e-5  # ten boxes of the last grid
NOISE = 0.05  # m/s, kinetic
STANDARD_ERRORS = 3.0  # one case in 370
COVERED = (0.87, 1.0)  # of 80 intervals of ±2 standard errors: expected 0.95, less three binomial errors
SPREAD = (0.7, 1.35)  # of 80 errors over their standard errors: 1, give or take three times 8 % and the bootstrap's 7 %
REPLICATES = 100


@pytest.mark.parametrize("metric", ["impulse", "velocity"])
@pytest.mark.parametrize("name", LAWS)
def test_exact_recovery_without_noise(name, metric, rng):
    target = target_of(falling_ellipses(rng, 60, law=name, mu=MU, epsilon=EPSILON))
    fit = fit_ensemble(LAWS[name], target, metric)
    assert abs(fit.mu - MU) < EXACT and abs(fit.epsilon - EPSILON) < EXACT
    assert fit.cost < 1e-6 and fit.n == 60 and fit.n_failed == 0 and fit.at_bound == ()
    assert np.isnan(fit.mu_std)


def test_bootstrap_standard_errors_are_those_of_repeated_experiments():
    z = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        impacts = falling_ellipses(rng, 80, law="anitescu_potra_newton", mu=MU, epsilon=EPSILON, noise=NOISE)
        fit = fit_ensemble(LAWS["anitescu_potra_newton"], target_of(impacts), "impulse", bootstrap=REPLICATES, rng=rng)
        z += [(fit.mu - MU) / fit.mu_std, (fit.epsilon - EPSILON) / fit.epsilon_std]
    assert COVERED[0] <= np.mean(np.abs(z) < 2.0) <= COVERED[1]
    assert SPREAD[0] <= np.std(z) <= SPREAD[1]


def test_no_point_of_a_dense_grid_is_better(rng):
    mu, epsilon = (a.ravel() for a in np.meshgrid(np.linspace(0, 0.4, 81), np.linspace(0.2, 0.9, 71)))
    for name in SIX_LAWS:
        truth = falling_ellipses(rng, 40, law="mirtich", mu=0.2, epsilon=0.6, noise=0.2)
        target = target_of(truth)
        fit = fit_ensemble(LAWS[name], target, "velocity")
        best = misfit_table(LAWS[name], target, mu, epsilon, "velocity").mean(axis=1).min()
        assert fit.cost <= best + 1e-9, name


def test_cost_is_the_mean_misfit_at_the_best_parameters(rng):
    target = target_of(falling_ellipses(rng, 50, law="mirtich", mu=0.2, epsilon=0.6, noise=0.1))
    fit = fit_ensemble(LAWS["whittaker"], target, "impulse")
    direct = misfit(LAWS["whittaker"], target, fit.mu, fit.epsilon, "impulse").mean()
    assert fit.cost == pytest.approx(direct, rel=1e-12)


class TestBootstrap:
    def test_copies_within_a_trial_add_no_information(self, rng):
        single = falling_ellipses(rng, 100, law="wang_mason", mu=MU, epsilon=EPSILON, noise=NOISE)
        single = replace(single, trial=np.arange(100))
        copies = single.select(np.repeat(np.arange(100), 4))
        law = LAWS["wang_mason"]

        def spread(impacts, trials):
            stream = np.random.default_rng(1)
            fit = fit_ensemble(law, target_of(impacts), "impulse", trials=trials, bootstrap=REPLICATES, rng=stream)
            return np.array([fit.mu_std, fit.epsilon_std])

        alone = spread(single, single.trial)
        np.testing.assert_allclose(spread(copies, copies.trial), alone, rtol=0.02)  # steps of the last grid
        # taken for independent, four copies would halve the standard error (to the bootstrap's own 10 %)
        np.testing.assert_allclose(spread(copies, None), alone / 2, rtol=0.4)
        assert np.all(spread(copies, None) < 0.8 * alone)


class TestFailedSolves:
    def failing(self, target, above: float):
        """Whittaker, but with no solution for μ > `above` in every fourth impact of `target`."""
        law, lost_v_t = LAWS["whittaker"], target.space.v_t[::4]

        def impulse(space, mu, epsilon):
            c_t, c_n = law.impulse(space, mu, epsilon)
            lost = np.isin(space.v_t, lost_v_t) & (mu > above)
            return np.where(lost, np.nan, c_t), np.where(lost, np.nan, c_n)

        return replace(law, impulse=impulse)

    def test_they_are_counted(self, rng):
        target = target_of(falling_ellipses(rng, 40, law="whittaker", mu=MU, epsilon=EPSILON))
        fit = fit_ensemble(self.failing(target, -1.0), target, "impulse")
        assert fit.n_failed == 10 and fit.n == 40
        assert abs(fit.mu - MU) < EXACT

    @pytest.mark.parametrize("cells", [1, 40 * 7, 40 * 440])
    def test_the_grid_in_pieces_gives_the_same(self, rng, monkeypatch, cells):
        target = target_of(falling_ellipses(rng, 40, law="mirtich", mu=MU, epsilon=EPSILON, noise=0.2))
        failing = self.failing(target, MU + 0.1)
        whole = fit_ensemble(failing, target, "impulse")
        monkeypatch.setattr(ensemble, "CELLS", cells)
        pieces = fit_ensemble(failing, target, "impulse")
        assert (pieces.mu, pieces.epsilon) == (whole.mu, whole.epsilon)
        assert pieces.cost == pytest.approx(whole.cost, rel=1e-12) and pieces.n_failed == whole.n_failed

    def test_they_do_not_make_parameters_attractive(self, rng):
        """Where a fourth has no solution, the sum over the others is smaller; it must not win."""
        target = target_of(falling_ellipses(rng, 40, law="mirtich", mu=MU, epsilon=EPSILON, noise=0.2))
        whole = fit_ensemble(LAWS["whittaker"], target, "impulse")
        failing = self.failing(target, whole.mu + 0.02)
        fit = fit_ensemble(failing, target, "impulse")
        # steps of the last grid
        assert (fit.mu, fit.epsilon) == pytest.approx((whole.mu, whole.epsilon), abs=EXACT)
        assert fit.n_failed == 0
        beyond = misfit(failing, target, whole.mu + 0.03, whole.epsilon, "impulse")
        assert np.nansum(beyond) < whole.n * whole.cost


class TestBounds:
    @pytest.mark.parametrize(
        ("mu", "epsilon", "named"), [(0.0, 0.5, ("mu",)), (0.1, 1.0, ("epsilon",)), (0.0, 0.0, ("mu", "epsilon"))]
    )
    def test_parameters_at_the_edge_are_named(self, rng, mu, epsilon, named):
        target = target_of(falling_ellipses(rng, 30, law="wang_mason", mu=mu, epsilon=epsilon))
        fit = fit_ensemble(LAWS["wang_mason"], target, "impulse")
        assert fit.at_bound == named
        assert fit.mu == pytest.approx(mu, abs=EXACT) and fit.epsilon == pytest.approx(epsilon, abs=EXACT)

    def test_the_box_is_respected(self, rng):
        """Outcomes with more rebound than any ε ≤ 1 gives, and reversed friction, which no μ gives."""
        impacts = falling_ellipses(rng, 30, law="wang_mason", mu=0.2, epsilon=1.0)
        pushed = replace(impacts, v_post=impacts.v_pre + 1.2 * impacts.dv * [-1.0, 1.0, 1.0])
        fit = fit_ensemble(LAWS["wang_mason"], target_of(pushed), "impulse")
        assert 0.0 <= fit.mu <= MU_MAX and 0.0 <= fit.epsilon <= 1.0 and "epsilon" in fit.at_bound
        assert TOLERANCE < EXACT


def test_nothing_to_identify_from(rng):
    target = target_of(falling_ellipses(rng, 4, law="mirtich", mu=0.1, epsilon=0.5))
    with pytest.raises(ValueError, match="no impacts"):
        fit_ensemble(LAWS["mirtich"], target[np.array([], dtype=int)], "impulse")
    with pytest.raises(ValueError, match="rng"):
        fit_ensemble(LAWS["mirtich"], target, "impulse", bootstrap=5)
