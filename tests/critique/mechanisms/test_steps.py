"""From samples to steps: second order in h, interpolation exact for cubics, and contacts between samples."""

import numpy as np
import pytest

from thesis_lib.critique.mechanisms.steps import interpolation, may_touch, rule_of


def errors_of(velocities: str, h: float) -> np.ndarray:
    """Largest errors of q, v, v̇ at one instant of a sine sampled every h seconds."""
    t = h * np.arange(-10, 11)
    q, v = np.sin(3.0 * t)[:, None], 3.0 * np.cos(3.0 * t)[:, None]
    rule, k = rule_of(velocities, h), np.array([10])
    at = 0.5 * h if velocities == "measured" else 0.0
    true = np.sin(3.0 * at), 3.0 * np.cos(3.0 * at), -9.0 * np.sin(3.0 * at)
    return np.array([abs(rule.of(s, q, v, k)[0, 0] - x) for s, x in zip((rule.q, rule.v, rule.a), true)])


@pytest.mark.parametrize("velocities", ["measured", "derived"])
def test_steps_of_continuous_motion_are_of_second_order(velocities):
    coarse, fine = errors_of(velocities, 0.02), errors_of(velocities, 0.01)
    assert (fine <= 0.26 * coarse + 1e-12).all() and coarse.max() > 1e-5


def test_steps_of_a_time_stepping_simulation_are_exact():
    h, rng = 0.01, np.random.default_rng(0)
    a = rng.standard_normal((20, 2))
    v = np.concatenate([np.zeros((1, 2)), h * np.cumsum(a, axis=0)])
    rule, k = rule_of("time_stepping", h), np.arange(20)
    assert np.abs(rule.of(rule.a, v, v, k) - a).max() < 1e-12
    assert (rule.kernel(5) == 1.0).all()


def test_a_second_difference_sees_the_mean_of_two_constant_forces():
    """A unit mass under forces that are constant from sample to sample: what `derived` calls f is its acceleration."""
    h, rng = 0.01, np.random.default_rng(1)
    f = rng.standard_normal(30)
    q, v = [0.0], [0.0]
    for force in f:
        q.append(q[-1] + h * v[-1] + 0.5 * h * h * force)
        v.append(v[-1] + h * force)
    rule, k = rule_of("derived", h), np.arange(5, 25)
    a = rule.of(rule.a, np.array(q)[:, None], np.array(v)[:, None], k)[:, 0]
    known = sum(w * f[k + j] for j, w in rule.f)
    # exact to the share of the kernel: an impulse between samples counts by its instant
    assert np.abs(a - known).max() < 1e-9


@pytest.mark.parametrize("shift", [-1.3, -0.4, 0.25, 2.0])
def test_interpolation_is_exact_for_cubics(shift):
    x = np.arange(12.0)
    W = interpolation(12, shift)
    assert np.abs(W @ (x**3 - 2.0 * x) - ((x + shift) ** 3 - 2.0 * (x + shift))).max() < 1e-9
    assert np.abs(W.sum(axis=1) - 1.0).max() < 1e-12


def test_a_bounce_between_samples_counts_as_contact():
    # falls and rises by 4 mm a sample, and is never sampled within the margin of 1 mm
    phi = np.array([10.0, 6.0, 2.0, 3.0, 7.0, 11.0])[:, None] * 1e-3
    touching = may_touch(phi, np.full_like(phi, 1e-3))[:, 0]
    assert touching.tolist() == [False, True, True, True, False]
