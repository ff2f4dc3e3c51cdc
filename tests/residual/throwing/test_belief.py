"""Covariances, and beliefs at rest against integrals and known shapes."""

import numpy as np
import pytest

from thesis_lib.thesis.residual.throwing.belief import RestBelief, covariance_root


def test_a_singular_covariance_has_a_root():
    cov = np.zeros((1, 6, 6))
    cov[0, 3:, 3:] = np.array([[2.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    root = covariance_root(cov)
    assert root @ np.swapaxes(root, 1, 2) == pytest.approx(cov)


def rest(n=400):
    rng = np.random.default_rng(4)
    face = rng.choice(4, n, p=[0.7, 0.2, 0.1, 0.0])
    return RestBelief(rng.normal(face * 1.0, 0.2), face, 4)


def test_the_belief_at_rest_is_a_distribution_over_sides_and_positions():
    belief = rest()
    x = np.linspace(-10, 12, 20_001)
    total = sum(p * np.trapezoid(belief.density(x, face), x) for face, p in enumerate(belief.face_probability))
    assert belief.face_probability.sum() == pytest.approx(1.0)
    assert total == pytest.approx(1.0, abs=1e-3)
    assert belief.most_likely_face == 0


@pytest.mark.parametrize("n", [1, 3, 400])
def test_how_finely_sides_are_counted_changes_no_probability(n: int):
    """The prior is worth one particle, whatever the number of sides: two sides read as one have their joint share."""
    fine = np.random.default_rng(6).choice(8, n, p=[0.6, 0.0, 0.2, 0.1, 0.1, 0.0, 0.0, 0.0])
    of_fine, of_coarse = (
        RestBelief(np.zeros(n), face, sides).face_probability for face, sides in ((fine, 8), (fine // 2, 4))
    )
    assert of_fine.reshape(4, 2).sum(axis=1) == pytest.approx(of_coarse)
    assert of_fine[np.bincount(fine, minlength=8) == 0].sum() < 1.0 / (n + 1.0)


def test_the_likelihood_is_highest_where_the_particles_are():
    belief = rest()
    likely, _ = belief.log_likelihood(0.0, 0)
    assert likely > belief.log_likelihood(1.0, 0)[0] and likely > belief.log_likelihood(0.0, 1)[0]
    assert np.isfinite(belief.log_likelihood(30.0, 3)[0])  # nothing is impossible


def test_a_right_belief_beats_a_wrong_one_on_average():
    rng = np.random.default_rng(5)
    x = rng.normal(size=300)
    scores = {}
    for spread in (0.3, 1.0, 3.0):
        particles = RestBelief(spread * rng.normal(size=400), np.zeros(400, int), 4)
        scores[spread] = np.mean([particles.log_likelihood(end, 0)[0] for end in x])
    assert scores[1.0] > max(scores[0.3], scores[3.0])
