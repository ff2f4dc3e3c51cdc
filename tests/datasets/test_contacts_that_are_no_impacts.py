"""Hits that stay down, contacts that last, energy that grows: each is said with its size; ordinary drops have none."""

import numpy as np
import pytest
from falling_disk import bounces, drops, growing, released, soft, stopping

from thesis_lib.datasets.format.validate import DatasetError
from thesis_lib.datasets.impacts.detect import find_impacts

SPEED = 0.06  # relative: the speed at which rebound ends lies between two hits of a sample of 30
DURATION = 0.1  # relative: a damped spring, and samples of a fifth of the contact


@pytest.mark.parametrize(("slowest", "rate", "epsilon"), [(1.0, 120.0, 0.5), (0.6, 240.0, 0.7)])
def test_hits_that_stay_down_are_counted_with_their_speeds(slowest: float, rate: float, epsilon: float):
    found = find_impacts(stopping(slowest, rate, epsilon))
    assert found.down is not None and found.down.speed == pytest.approx(slowest, rel=SPEED)
    assert found.down.highest <= slowest * (1.0 + SPEED) and found.down.epsilon == pytest.approx(epsilon, rel=SPEED)
    assert found.left_out["reason"].value_counts()["stays_down"] >= 20
    assert any("the body does not rebound" in text and "stays_down" in text for text in found.remarks)


def test_a_body_that_comes_to_rest_after_many_bounces_is_ordinary():
    found = find_impacts(stopping(0.03))
    assert found.down is None and not found.remarks and len(found.impacts) > 40


def test_putty_never_rebounds():
    found = find_impacts(stopping(100.0))
    assert not len(found.impacts) and found.low_pass is None
    assert any("stays down after each hit" in text for text in found.warnings)


@pytest.mark.parametrize(
    ("duration", "rate", "heights"), [(0.1, 100.0, (0.2, 0.8)), (0.025, 150.0, (0.2, 0.8)), (0.05, 240.0, (0.5, 0.5))]
)
def test_contacts_that_last_are_told_from_a_wrong_height(duration: float, rate: float, heights: tuple):
    found = find_impacts(soft(duration, rate, heights))
    assert found.soft is not None and found.soft.duration == pytest.approx(duration, rel=DURATION)
    assert "Contacts last about" in found.remarks[0]
    assert not any("surface.height" in text or "nan" in text for text in found.warnings)


def test_a_surface_that_is_stated_too_high_is_no_soft_contact_and_no_step():
    dataset = stopping(0.03)
    dataset.trajectories["y"] -= 0.02
    with pytest.raises(DatasetError, match=r"surface.height -0.0196\d* m instead of 0 m would close the gap"):
        find_impacts(dataset)


@pytest.mark.parametrize(("rate", "steps"), [(60.0, 1), (120.0, 2)])
def test_energy_that_grows_is_said_and_no_filter_is_blamed(rate: float, steps: int):
    found = find_impacts(growing(rate, steps))
    # v grows by g dt at each impact
    speed = np.median(np.abs(found.impacts.v_pre[:, 1]))
    assert found.gain == pytest.approx(2.0 * 9.81 / (rate * steps) / speed, rel=0.1)
    assert found.step == pytest.approx(1.0 / (rate * steps), rel=0.15)
    assert any("no impact law with ε ≤ 1 can do that" in text for text in found.remarks)
    assert found.low_pass is None and not any("surface.height" in text or "smoothed" in text for text in found.warnings)


def test_elastic_impacts_gain_nothing():
    rng = np.random.default_rng(5)
    state = released(16, rng, (0.3, 0.8), (-0.3, 0.3), 4.0)
    found = find_impacts(drops(state, bounces(1.0, 0.1), rate=120.0, duration=1.5, rng=rng))
    assert len(found.impacts) > 30 and found.gain == 0.0 and found.step == 0.0
