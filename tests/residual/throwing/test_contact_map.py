"""The contact map's parts: Student's t of what processes leave, ranges of speeds, features."""

import numpy as np
import pytest

from thesis_lib.thesis.residual.throwing.contact_map import contact_features, residual_unit, split, student


def t_rows(n: int, scale: np.ndarray, freedom: float, rng: np.random.Generator) -> np.ndarray:
    wide = np.sqrt(freedom / rng.chisquare(freedom, n)) if np.isfinite(freedom) else np.ones(n)
    return scale * rng.standard_normal((n, len(scale))) * wide[:, None]


@pytest.mark.parametrize("freedom", [3.0, 6.0, np.inf])
def test_student_finds_scales_and_tails(freedom):
    rng = np.random.default_rng(0)
    scales = [np.array([1.0, 0.5, 2.0]), np.array([0.3, 3.0, 1.0])]
    found, nu = student([t_rows(4000, s, freedom, rng) for s in scales])
    assert nu == pytest.approx(freedom, rel=0.4) or (nu >= 20.0 and np.isinf(freedom))
    for a, b in zip(found, scales):
        assert a == pytest.approx(b, rel=0.05)


def test_every_speed_has_one_range():
    speed = np.array([0.1, 1.6, 1.7, 5.0, 50.0])
    low, high = split(speed, [1.6, np.inf])
    assert low.tolist() == [0, 1] and high.tolist() == [2, 3, 4]


def test_features_tell_corners_apart_in_two_columns_and_scale_with_the_speed():
    q = np.array([[0.1, 0.0, 0.3]])
    v = np.array([[0.5, -2.0, 4.0]])
    one = contact_features(q, v, 0.02)
    next_corner = contact_features(q + [0.0, 0.0, np.pi / 2], v, 0.02)
    assert next_corner[0, :7] == pytest.approx(one[0, :7])
    assert np.linalg.norm(next_corner[0, 7:] - one[0, 7:]) == pytest.approx(np.sqrt(2.0))
    double = contact_features(q, 2.0 * v, 0.02)
    assert double[0, :5] == pytest.approx(one[0, :5]) and double[0, 5] == pytest.approx(one[0, 5] + np.log(2.0))
    assert residual_unit(2.0 * v, 0.02, 0.01) == pytest.approx(2.0 * residual_unit(v, 0.02, 0.01))
