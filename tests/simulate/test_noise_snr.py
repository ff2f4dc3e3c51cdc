"""Noise of a signal-to-noise ratio: its variance, its independence, and what is refused."""

import numpy as np
import pytest
from motions import BODIES, checked, drops

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.simulate.stepping.stepping import simulate

FALL = checked(BODIES["ellipse"], *(x[0] for x in drops("ellipse", 1)), 300)


@pytest.mark.parametrize("snr_db", [40.0, 10.0])
def test_variance_over_that_of_the_noise_is_the_ratio_in_every_channel(snr_db):
    rng, many = np.random.default_rng(0), 200
    noise = [(noisy.q - FALL.q, noisy.v - FALL.v) for noisy in (add_noise(FALL, snr_db, rng) for _ in range(many))]
    for i, signal in enumerate((FALL.q, FALL.v)):
        found = np.concatenate([pair[i] for pair in noise]).var(axis=0)
        wanted = signal.var(axis=0) / 10 ** (snr_db / 10)
        # the standard error of a variance from n samples is sqrt(2 / n) of it
        assert np.abs(found / wanted - 1).max() < 5 * np.sqrt(2 / (many * len(signal)))


def test_sigma_is_that_of_the_noise_and_channels_are_independent():
    noisy = add_noise(FALL, 20.0, np.random.default_rng(1))
    standard = np.concatenate([(noisy.q - FALL.q) / noisy.sigma[0], (noisy.v - FALL.v) / noisy.sigma[1]], axis=1)
    assert np.abs(np.corrcoef(standard.T) - np.eye(6)).max() < 5 / np.sqrt(len(standard))
    assert standard.std() == pytest.approx(1.0, abs=0.1)


def test_no_noise_and_what_does_not_move():
    assert np.array_equal(add_noise(FALL, np.inf, np.random.default_rng(0)).q, FALL.q)
    straight = simulate(BODIES["disk"], [0, 50, 0], [1, 0, 0], None, 5e-3, 50, 0.5, 0.5)
    noisy = add_noise(straight, 20.0, np.random.default_rng(0))
    assert np.array_equal(noisy.q[:, 2], straight.q[:, 2]) and noisy.sigma[0, 0] > 0


def test_what_is_refused():
    with pytest.raises(UserError, match="dB"):
        add_noise(FALL, np.nan, np.random.default_rng(0))
    broken = FALL.window(0, 300)
    broken.v[10:] = np.nan
    with pytest.raises(UserError, match="not solved"):
        add_noise(broken, 20.0, np.random.default_rng(0))
