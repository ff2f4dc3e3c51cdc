"""Top-down step: windows, components, and abstractions of pushes."""

from itertools import product

import numpy as np
import pytest
from pushes_for_tests import make_samples

from thesis_lib.jenga.learners.learner import FEATURES, push_groups, step_features, windows
from thesis_lib.jenga.learners.mixture import fit_mixture, log_beta, log_normal, merge, names_of, push_posterior
from thesis_lib.jenga.learners.settings import MixtureSettings, PushWindowSettings

SETTINGS = MixtureSettings()


def _pushes(words_of_kind, counts, rng, length=12):
    """Features (n, 5) of pushes whose windows are drawn from the words (5,) of their kind in turn; kind per window."""
    features, push, kind = [], [], []
    for number, k in enumerate(np.repeat(np.arange(len(words_of_kind)), counts)):
        words = np.array(words_of_kind[k])
        steps = words[np.arange(length) * len(words) // length]
        features.append(steps + 0.15 * rng.normal(size=steps.shape))
        push += [number] * length
        kind += [k] * length
    return np.concatenate(features), np.array(push), np.array(kind)


def test_windows_are_those_of_their_own_push_and_have_one_row_per_sample() -> None:
    samples, _ = make_samples(120, np.random.default_rng(0))
    settings = PushWindowSettings(depth=5)
    features = windows(samples, settings)
    assert features.shape == (120, len(FEATURES))
    for rows in push_groups(samples):
        np.testing.assert_allclose(features[rows], windows(samples.select(rows), settings), atol=1e-9)
    one = windows(samples, PushWindowSettings(depth=1))
    np.testing.assert_allclose(
        one, step_features(samples.state, samples.next_state, 1.0, settings.force_scale), atol=1e-9
    )


def test_window_of_five_steps_is_their_mean() -> None:
    samples, _ = make_samples(200, np.random.default_rng(1))
    rows = next(rows for rows in push_groups(samples) if len(rows) >= 8)
    steps = windows(samples, PushWindowSettings(depth=1))[rows[3:8]]
    window = windows(samples, PushWindowSettings(depth=5))[rows[7]]
    # changes telescope only where the next state is read once: it is in these pushes
    np.testing.assert_allclose(window, steps.mean(axis=0), atol=1e-9)


def test_kinds_of_pushes_with_words_of_their_own_are_found() -> None:
    rng = np.random.default_rng(2)
    words = [[[0, 0, 0, 0, 0]], [[3, 0, 0, 0, 0]], [[0, 3, 3, 0, 0]]]
    features, push, kind = _pushes(words, [5, 4, 4], rng)
    mixture = fit_mixture(features, push, SETTINGS, rng)
    assert len(mixture.topics) == 3
    found = mixture.resp.argmax(axis=1)
    assert all(len(set(found[kind == k])) == 1 for k in range(3))
    np.testing.assert_allclose(np.sort(mixture.shares), np.sort([4, 4, 5]) / 13, atol=0.04)


def test_of_windows_that_overlap_each_says_a_part_of_what_a_window_alone_says() -> None:
    """The same windows with half of the evidence each: words of an abstraction weigh less against the prior, and the
    likelihood of a push is the root of the product of its windows' densities."""
    rng = np.random.default_rng(12)
    features, push, _ = _pushes([[[0, 0, 0, 0, 0], [5, 0, 0, 0, 0]], [[0, 0, 0, 0, 0], [0, 5, 0, 0, 0]]], [6, 6], rng)
    words = []
    for overlap in (1.0, 2.0):
        settings = SETTINGS.model_copy(update={"overlap": overlap})
        mixture = fit_mixture(features, push, settings, np.random.default_rng(0))
        of_push = mixture.resp[::12]
        expected = np.exp(mixture.log_density(features).reshape(12, 12, 2).sum(axis=1) / overlap) * mixture.shares
        np.testing.assert_allclose(of_push, expected / expected.sum(axis=1, keepdims=True), atol=1e-9)
        members = 12 * of_push.round().sum(axis=0)[:, None]  # windows of each abstraction
        prior = settings.topic_prior
        words.append(overlap * (mixture.topics * (members / overlap + prior) - prior * mixture.weights))
    np.testing.assert_allclose(words[1], words[0], atol=1e-6)
    np.testing.assert_allclose(words[0].sum(axis=1), 72.0)


def test_abstractions_may_share_a_word() -> None:
    """Hard and stuck blocks begin alike: one component in both, two abstractions nevertheless."""
    rng = np.random.default_rng(3)
    start = [0, 0, 0, 0, 0]
    features, push, kind = _pushes([[start, [4, 0, 0, 0, 0]], [start, [0, 4, 0, 0, 0]]], [5, 5], rng)
    mixture = fit_mixture(features, push, SETTINGS, rng)
    assert len(mixture.topics) == 2
    found = mixture.resp.argmax(axis=1)
    assert len(set(found[kind == 0])) == 1 and set(found[kind == 0]) != set(found[kind == 1])
    shared = np.abs(mixture.means * mixture.spread + mixture.centre).max(axis=1).argmin()
    assert (mixture.topics[:, shared] > 0.3).all()


def icl(counts: np.ndarray, prior: np.ndarray, group: np.ndarray) -> float:
    """ICL (nats) of pushes with word counts (pushes, C), grouped by `group` (pushes,); prior (C,) is a."""
    member = np.eye(group.max() + 1)[group]
    m = member.sum(axis=0)
    words = (log_beta(prior + member.T @ counts) - log_beta(prior)).sum()
    return float(words + log_beta(0.5 + m) - log_beta(np.full(len(m), 0.5)))


def test_merging_ends_at_the_best_of_all_partitions() -> None:
    """Against every partition of six pushes (own labels, no greed)."""
    rng = np.random.default_rng(4)
    rates = np.array([[6.0, 0.2, 0.2], [0.2, 6.0, 0.2], [0.3, 0.3, 6.0]])
    counts = rng.poisson(rates[[0, 0, 1, 1, 1, 2]]).astype(float)
    prior = np.full(3, 0.7)
    group = merge(counts, prior, MixtureSettings(min_abstractions=1))
    values = []
    for labels in product(range(6), repeat=6):
        if all(label <= max(labels[:i], default=-1) + 1 for i, label in enumerate(labels)):
            values.append(icl(counts, prior, np.array(labels)))
    assert icl(counts, prior, group) == pytest.approx(max(values), abs=1e-9)
    assert icl(counts, prior, group) > icl(counts, prior, np.arange(6)) + 1.0


def test_limits_of_the_number_of_abstractions_hold() -> None:
    counts = np.eye(8) * 20.0
    prior = np.full(8, 0.2)
    assert merge(counts, prior, SETTINGS).max() + 1 == SETTINGS.max_abstractions
    alike = np.ones((8, 8))
    assert merge(alike, prior, SETTINGS).max() + 1 == SETTINGS.min_abstractions


def test_posterior_of_a_push_is_bayes() -> None:
    rng = np.random.default_rng(5)
    log_like, push = rng.normal(size=(7, 3)), np.array([0, 0, 0, 1, 1, 2, 2])
    shares = np.array([0.5, 0.3, 0.2])
    resp = push_posterior(log_like, push, shares)
    joint = shares * np.exp(log_like[:3].sum(axis=0))
    np.testing.assert_allclose(resp[:3], np.tile(joint / joint.sum(), (3, 1)))


def test_normal_density_against_scipy() -> None:
    from scipy.stats import multivariate_normal

    rng = np.random.default_rng(6)
    x, mean, root = rng.normal(size=(4, 3)), rng.normal(size=(2, 3)), rng.normal(size=(2, 3, 3))
    cov = root @ root.transpose(0, 2, 1) + 0.1 * np.eye(3)
    expected = np.column_stack([multivariate_normal(m, s).logpdf(x) for m, s in zip(mean, cov)])
    np.testing.assert_allclose(log_normal(x, mean, cov), expected)


def test_density_of_named_features_is_the_marginal() -> None:
    """Integrating the joint density over the other features, by quadrature over one of two."""
    rng = np.random.default_rng(7)
    features = rng.normal(size=(60, 5)) * [1.0, 0.01, 0.01, 1.0, 0.01]
    mixture = fit_mixture(features, np.repeat(np.arange(12), 5), SETTINGS, rng)
    grid = np.linspace(-8, 8, 400)
    point = np.zeros((len(grid), 5))
    point[:, FEATURES.index("lag")] = mixture.centre[3] + mixture.spread[3] * grid
    joint = np.exp(mixture.log_density(point, ("force", "lag")))
    integral = np.trapezoid(joint, grid, axis=0)
    np.testing.assert_allclose(integral, np.exp(mixture.log_density(point[:1], ("force",)))[0], rtol=1e-3)


def test_names_follow_from_what_is_seen() -> None:
    look = {
        "force": np.array([0.01, 0.2, 0.9, 2.5, 1.2, 3.0]),
        "move": np.array([0.0, 0.95, 0.9, 0.1, 0.8, 0.0]),
        "drag": np.array([0.0, 0.0, 0.02, 0.05, 0.7, 0.0]),
    }
    expected = ["no block", "easy move", "hard move", "no move 1", "drags tower", "no move 2"]
    assert names_of(look) == expected
