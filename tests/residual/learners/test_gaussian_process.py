"""Gaussian processes: against scikit-learn, recovery of known hyperparameters, devices."""

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.learners import gaussian_process
from thesis_lib.learners.gaussian_process import SAME, SAME_TRAINED, GaussianProcessSettings, fit_gaussian_process
from thesis_lib.learners.marginal_likelihood import objective, search

EXACT = 1e-6  # of the outputs' spread: exact methods differ by rounding only


def _data(n: int = 60, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n, 3)) * [1.0, 5.0, 0.1] + [0.0, 2.0, -1.0]
    Y = np.stack([np.sin(2.0 * X[:, 0]) + 0.2 * X[:, 1], X[:, 1] ** 2], axis=1)
    return X, Y + 0.05 * rng.normal(size=Y.shape)


@pytest.fixture(scope="module")
def process():
    return fit_gaussian_process(*_data(), np.random.default_rng(1), GaussianProcessSettings(device="cpu"))


def _sklearn(process, output):
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    kernel = ConstantKernel(process.signal[output]) * RBF(process.lengthscale[output])
    noise = process.noise[output] / process.weight[:, output]
    return GaussianProcessRegressor(kernel, alpha=noise, optimizer=None).fit(process.x, process.y[:, output])


def test_predictions_and_likelihood_are_those_of_scikit_learn(process):
    X, _ = _data(n=40, seed=3)
    mean, variance = process.predict(X)
    _, noisy = process.predict(X, noise=True)
    z = (X - process.x_mean) / process.x_scale
    for i in range(2):
        theirs = _sklearn(process, i)
        assert process.log_likelihood[i] == pytest.approx(theirs.log_marginal_likelihood_value_, rel=1e-7)
        other, std = theirs.predict(z, return_std=True)
        scale = process.y_scale[i]
        np.testing.assert_allclose(mean[:, i], process.y_mean[i] + scale * other, atol=EXACT * scale)
        np.testing.assert_allclose(variance[:, i], (scale * std) ** 2, atol=EXACT * scale**2)
    np.testing.assert_allclose(noisy - variance, np.broadcast_to(process.noise * process.y_scale**2, noisy.shape))


def test_gradient_is_that_of_differences():
    import torch
    from scipy.optimize import approx_fprime

    rng = np.random.default_rng(5)
    x, y = torch.as_tensor(rng.normal(size=(30, 4))), torch.as_tensor(rng.normal(size=30))
    y, theta = (y, torch.as_tensor(rng.uniform(0.2, 1.0, 30)), True), rng.normal(scale=0.5, size=6)
    _, gradient = objective(theta, x, *y)
    np.testing.assert_allclose(gradient, approx_fprime(theta, lambda t: objective(t, x, *y)[0], 1e-6), atol=1e-3)


def test_the_search_ends_at_least_as_high_as_scikit_learns():
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    settings = GaussianProcessSettings(device="cpu", prior=False, restarts=3, robust_rounds=0)
    process = fit_gaussian_process(*_data(), np.random.default_rng(1), settings)
    for i in range(2):
        kernel = ConstantKernel(1.0, (1e-3, 1e3)) * RBF([1.0] * 3, (0.05, 100.0)) + WhiteKernel(0.1, (1e-6, 4.0))
        theirs = GaussianProcessRegressor(kernel, alpha=0.0, n_restarts_optimizer=2, random_state=0)
        theirs.fit(process.x, process.y[:, i])
        assert process.log_likelihood[i] > theirs.log_marginal_likelihood_value_ - 0.05


def test_known_hyperparameters_are_recovered():
    rng = np.random.default_rng(2)
    x = rng.normal(size=(300, 2))
    length, noise = np.array([0.7, 3.0]), 0.05
    z = x / length
    K = np.exp(-0.5 * ((z[:, None] - z[None]) ** 2).sum(-1))
    y = np.linalg.cholesky(K + 1e-10 * np.eye(300)) @ rng.normal(size=300)
    y += np.sqrt(noise) * rng.normal(size=300)
    found = fit_gaussian_process(x, y[:, None], rng, centred=False)
    in_units = found.lengthscale[0] * found.x_scale
    np.testing.assert_allclose(in_units, length, rtol=0.25)
    assert found.noise[0] * found.y_scale[0] ** 2 == pytest.approx(noise, rel=0.25)


def test_priors_keep_a_few_measurements_of_noise_from_being_learned_by_heart():
    left = {}
    for prior in (True, False):
        settings, left[prior] = GaussianProcessSettings(device="cpu", prior=prior), []
        for seed in range(20):
            rng = np.random.default_rng(seed)
            X, Y = rng.normal(size=(12, 5)), rng.normal(size=(12, 1))
            found = fit_gaussian_process(X, Y, rng, settings, centred=False)
            left[prior].append(np.mean(found.predict(rng.normal(size=(100, 5)))[0] ** 2))
    # the truth is zero
    assert np.mean(left[True]) < 0.6 * np.mean(left[False])


def test_wild_measurements_do_not_decide():
    rng = np.random.default_rng(0)
    X = rng.uniform(-2.0, 2.0, (150, 2))
    truth = np.sin(X[:, :1])
    Y = truth + 0.05 * rng.normal(size=truth.shape)
    wild = rng.choice(150, size=6, replace=False)
    Y[wild] += 6.0
    new = rng.uniform(-2.0, 2.0, (200, 2))
    error, found = {}, {}
    for rounds in (0, 2):
        settings = GaussianProcessSettings(device="cpu", robust_rounds=rounds)
        found[rounds] = fit_gaussian_process(X, Y, np.random.default_rng(0), settings)
        error[rounds] = np.abs(found[rounds].predict(new)[0] - np.sin(new[:, :1])).mean()
    assert error[2] < 0.5 * error[0]
    assert (found[2].weight[wild] < 0.5).all()
    # and Gaussian noise is left alone
    clean = fit_gaussian_process(X, truth + 0.05 * rng.normal(size=truth.shape), np.random.default_rng(0))
    assert np.mean(clean.weight < 1.0) < 0.02


def test_more_data_than_hyperparameters_need(process):
    X, Y = _data(n=120, seed=7)
    settings = GaussianProcessSettings(device="cpu", hyperparameter_impacts=60)
    few = fit_gaussian_process(X[:60], Y[:60], np.random.default_rng(0), settings)
    more = fit_gaussian_process(X, Y, np.random.default_rng(0), settings, start=few)
    np.testing.assert_allclose(more.lengthscale * more.x_scale, few.lengthscale * few.x_scale)
    np.testing.assert_allclose(more.noise * more.y_scale**2, few.noise * few.y_scale**2)
    new, truth = _data(n=200, seed=8)
    worse, better = (np.abs(p.predict(new)[0] - truth).mean() for p in (few, more))
    assert better < worse


def test_a_longer_training_set_begins_with_the_weights_of_the_shorter(monkeypatch):
    X, Y = _data(n=120, seed=7)
    Y[::15] += 40.0
    settings = GaussianProcessSettings(device="cpu")
    few = fit_gaussian_process(X[:80], Y[:80], np.random.default_rng(0), settings)
    assert few.weight[:, 0].min() < 0.5
    used = []

    def watched(x, y, weight, *rest):
        used.append(weight.copy())
        return search(x, y, weight, *rest)

    monkeypatch.setattr(gaussian_process, "search", watched)
    fit_gaussian_process(X, Y, np.random.default_rng(0), settings, start=few)
    np.testing.assert_array_equal(used[0][:80], few.weight[:, 0])
    np.testing.assert_array_equal(used[0][80:], 1.0)
    used.clear()  # other rows first: nothing is known of them
    fit_gaussian_process(X[::-1], Y[::-1], np.random.default_rng(0), settings, start=few)
    np.testing.assert_array_equal(used[0], 1.0)


def test_far_away_a_residual_returns_to_zero_and_another_to_the_mean():
    X, Y = _data()
    far = np.full((1, 3), 1e4)
    for centred, expected in ((False, np.zeros(2)), (True, Y.mean(axis=0))):
        found = fit_gaussian_process(X, Y, np.random.default_rng(0), centred=centred)
        short = np.minimum(found.lengthscale, 1.0)
        near = type(found)(**{**found.__dict__, "lengthscale": short})
        np.testing.assert_allclose(near.predict(far)[0][0], expected, atol=1e-9)


def test_a_feature_that_does_not_vary_is_no_trouble():
    X, Y = _data()
    X[:, 1] = 3.0
    assert np.isfinite(fit_gaussian_process(X, Y, np.random.default_rng(0)).predict(X)[0]).all()


@pytest.mark.parametrize("X", [np.zeros((3, 2)), np.full((3, 3), np.nan)])
def test_wrong_inputs_are_refused(process, X):
    with pytest.raises(ValueError, match="inputs must"):
        process.predict(X)


def test_without_a_gpu_auto_is_the_cpu_and_cuda_is_refused(monkeypatch, process):
    import torch

    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    found = fit_gaussian_process(*_data(), np.random.default_rng(1), GaussianProcessSettings(device="auto"))
    assert found.device == "cpu"
    np.testing.assert_array_equal(found.lengthscale, process.lengthscale)  # as the seeds are equal
    with pytest.raises(UserError, match="device: cuda is set, but no CUDA GPU"):
        fit_gaussian_process(*_data(), np.random.default_rng(1), GaussianProcessSettings(device="cuda"))


def test_rounding_moves_a_search_by_less_than_a_gpu_may():
    # the sums of a GPU run in another order; so do those of the same rows in another order
    X, Y = _data(n=150)
    order = np.random.default_rng(9).permutation(len(X))
    settings = GaussianProcessSettings(device="cpu")
    one, other = (fit_gaussian_process(X[i], Y[i], np.random.default_rng(1), settings) for i in (..., order))
    new, _ = _data(n=50, seed=3)
    for a, b in zip(one.predict(new), other.predict(new)):
        assert (a != b).any()
        np.testing.assert_allclose(a, b, atol=SAME_TRAINED * Y.std())


def test_a_gpu_gives_the_same(process):
    import torch

    if not torch.cuda.is_available():
        pytest.skip("no CUDA GPU here")
    X, Y = _data()
    new, _ = _data(n=300, seed=3)  # more than are predicted at a time
    known = type(process)(**{**process.__dict__, "device": "cuda"})
    settings = GaussianProcessSettings(device="cuda")
    found, again = (fit_gaussian_process(X, Y, np.random.default_rng(1), settings) for _ in range(2))
    assert found.device == "cuda"
    for noise in (False, True):
        expected = process.predict(new, noise=noise)
        for one, two, three, four in zip(
            expected, known.predict(new, noise=noise), found.predict(new, noise=noise), again.predict(new, noise=noise)
        ):
            np.testing.assert_allclose(two, one, atol=SAME * Y.std())
            np.testing.assert_allclose(three, one, atol=SAME_TRAINED * Y.std())
            np.testing.assert_allclose(four, three, atol=SAME * Y.std())


def test_means_alone_are_the_same_and_leave_out_what_variances_need(process, monkeypatch):
    X, _ = _data(n=300, seed=6)  # more than are predicted at a time
    expected, variance = process.predict(X)
    assert (variance > 0.0).all()
    monkeypatch.delattr(gaussian_process, "explained")
    mean, none = process.predict(X, variance=False)
    np.testing.assert_array_equal(mean, expected)
    assert np.isnan(none).all()
