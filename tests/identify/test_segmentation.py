"""Noise and impacts of a drop, from drops whose noise and impacts are known."""

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.noise_snr import add_noise
from thesis_lib.thesis.identify.mass_ratio.table_2_1 import make_drops
from thesis_lib.thesis.identify.segmentation import (
    check_states,
    flight_costs,
    impact_steps,
    noise_from_differences,
    without_gravity,
)

H, G = 5e-3, 9.81


def test_flight_costs_are_those_of_least_squares(rng):
    q, v = rng.normal(size=(12, 3)), rng.normal(size=(12, 3))
    sigma = rng.uniform(0.5, 2.0, (2, 3))
    cost = flight_costs(H, q, v, sigma)
    for a, b in ((0, 12), (3, 9), (5, 6)):
        k = np.arange(a, b)
        expected = 0.0
        for c in range(3):
            design = np.concatenate(
                [
                    np.column_stack([np.ones(len(k)), H * k]) / sigma[0, c],
                    np.column_stack([np.zeros(len(k)), np.ones(len(k))]) / sigma[1, c],
                ]
            )
            data = np.concatenate([q[k, c] / sigma[0, c], v[k, c] / sigma[1, c]])
            left = data - design @ np.linalg.lstsq(design, data, rcond=None)[0]
            expected += left @ left
        assert cost[a, b] == pytest.approx(expected, abs=1e-9)
    assert np.isinf(cost[4, 4])


@pytest.mark.parametrize("kind", ["block", "ellipse"])
def test_noise_and_impacts_are_found(kind, rng):
    drops = make_drops(kind, 20, rng)
    ratio = []
    for record, impacts in zip(drops.records, drops.impacts):
        noisy = add_noise(record, 30.0, rng)
        q, v = without_gravity(H, noisy.q, noisy.v, G)
        sigma = noise_from_differences(q, v)
        ratio.append(sigma / noisy.sigma)
        assert impact_steps(H, q, v, sigma).tolist() == impacts.steps.tolist()
    # one drop's median deviation spreads by 1.2 / √270 = 7 %, the mean of 120 by less than 1 %
    np.testing.assert_allclose(np.mean(ratio), 1.0, atol=0.03)


def test_no_impact_is_found_in_flight(rng):
    k = np.arange(100)[:, None]
    q, v = H * k * np.array([1.0, 2.0, 3.0]), np.ones((100, 1)) * np.array([1.0, 2.0, 3.0])
    noisy = q + 0.1 * rng.normal(size=q.shape), v + 0.1 * rng.normal(size=v.shape)
    assert len(impact_steps(H, *noisy, noise_from_differences(*noisy))) == 0


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (lambda q, v: (H, q[:5], v[:5]), "at least"),
        (lambda q, v: (H, q[:, :2], v), "shape"),
        (lambda q, v: (0.0, q, v), "time step"),
        (lambda q, v: (H, np.where(np.arange(20)[:, None] == 7, np.nan, q), v), "sample 7"),
    ],
)
def test_unusable_states_are_refused(spoil, text):
    with pytest.raises(UserError, match=text):
        check_states(*spoil(np.zeros((20, 3)), np.zeros((20, 3))))
