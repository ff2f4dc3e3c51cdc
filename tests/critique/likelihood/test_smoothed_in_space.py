"""Samples in space that a filter smoothed, long contacts, attitudes that come late: what is left out, and the noise."""

import re
from functools import cache

import numpy as np
import pytest

from thesis_lib.critique.likelihood.in_space.hits import beside, observe_in_space
from thesis_lib.critique.likelihood.in_space.lag import lag_warning
from thesis_lib.simulate.tosses.drawn import NOTHING, SpaceCase, make
from thesis_lib.simulate.tosses.drawn_in_worlds import WorldsCase
from thesis_lib.simulate.tosses.example import simulate_tosses
from thesis_lib.simulate.tosses.own import OwnTosses


def seen(case, **drawn):
    """Its hits in our own simulator, with what is `drawn` in place of what the seed draws."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in drawn.items():
            patch.setitem(case.drawn, name, value)
        return observe_in_space(make(case, OwnTosses()), episodes=False)


def observed(**drawn):
    """The hits of a ball."""
    usual = {"tosses": 40, "rate": 240.0, "contact_time": 4e-4, "position": 2e-4, "rotation": 2e-3}
    return seen(SpaceCase("own", NOTHING, 5), **usual | drawn)


def undisturbed(seed, **drawn):
    """The hits of a body whose frames all come in time, and are not smoothed."""
    usual = {"irregular": 0.0, "dropped": 0.0, "bursts": 0.0, "flips": 0.0, "filter": "none", "tosses": 40}
    return seen(WorldsCase("own", NOTHING, seed), **usual | drawn)


@pytest.mark.slow
def test_noise_of_smoothed_samples_is_that_before_the_filter():
    # 50 Hz leave neighbours that differ by a fifth of the noise
    plain, smooth = observed(), observed(filter="zero_phase_butterworth", cutoff=50.0, irregular=0.0)
    cutoff, std = smooth.found.low_pass.cutoff
    assert abs(cutoff - 50.0) < 3.0 * std and any("low-pass filter" in text for text in smooth.found.warnings)
    assert not plain.found.warnings
    spread = [np.sqrt(np.median(np.einsum("nsii->nsi", o.cov)[:, 0, [1, 7]], axis=0)) for o in (plain, smooth)]
    assert np.all(spread[1] > 0.8 * spread[0]) and np.all(spread[1] < 2.0 * spread[0])  # velocity and spin
    assert len(smooth) > 0.7 * len(plain) and len(smooth.flights) > 0.7 * len(plain.flights)


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [{}, {"wrong_gravity.dg": 0.4}])
def test_a_moving_average_lowers_free_fall_and_a_median_does_not(hidden):
    rate = 120.0
    usual = {"rate": rate, "irregular": 0.0, "tosses": 60, "hidden": hidden}
    plain = observed(**usual)
    mean, median = (observed(filter=kind, cutoff=0.25 * rate, **usual) for kind in ("moving_average", "median"))
    assert plain.found.low_pass is None
    found, true = mean.found.low_pass, 2.0 / 3.0 / rate**2  # of three poses
    assert abs(found.second_moment - true) < 3.0 * found.second_moment_std < 0.2 * true
    assert not (median.found.low_pass and median.found.low_pass.moves_parabolas)
    if not hidden:  # arcs under a wrong gravity end elsewhere the further away they start
        height, smooth = (np.median(o.rig.gap(beside(o, 0))) for o in (plain, mean))
        assert abs(smooth - height) < 0.2 * 0.5 * plain.rig.gravity * true


@pytest.mark.slow
def test_a_path_that_sways_with_hardly_any_noise_is_not_smoothed():
    found = undisturbed(961, rate=230.0, position=2e-5, rotation=1e-4)
    assert not found.found.warnings and found.found.low_pass is None
    assert len(found) > 30  # of 40 tosses; 5 were left


@pytest.mark.slow
def test_drag_is_no_filter():
    """A light body curves its flights; samples within 80 ms of a hit were taken for smoothed, and the set refused."""
    found = undisturbed(3, rate=150.0, position=6e-5, rotation=2e-3, hidden={"quadratic_drag.c_q": 0.25})
    assert not found.found.warnings and len(found) > 45  # 51 without drag


@pytest.mark.slow
def test_a_flight_in_which_a_smoothed_ball_hits_again_is_not_used():
    # unseen hits in it let the ball rise up to twice as fast as it can
    seen = {"rate": 498.0, "position": 9e-5, "rotation": 5e-3, "epsilon": 0.5}
    found = observed(filter="kalman_smoother", cutoff=99.6, irregular=0.0, **seen)
    before, after = (beside(found, side).velocity[2] for side in (0, 1))
    fast = before < -0.3
    assert fast.sum() > 80 and np.max(-after[fast] / before[fast]) < 0.6


@pytest.mark.slow
def test_samples_within_a_long_contact_belong_to_no_flight():
    short, long = observed(rate=500.0), observed(rate=500.0, contact_time=3e-3)
    nearest = [np.abs(o.nodes).min(axis=(1, 2)) for o in (short, long)]
    assert np.quantile(nearest[0], 0.1) < 1.2e-3 < np.min(nearest[1])


@cache
def rolling(lag):
    """The hits of a ball whose attitudes come `lag` s late."""
    hidden = {"time_lag.lag": lag} if lag else {}
    made = simulate_tosses("ball", "sphere", hidden, drops=30, contact_time=5e-4)
    return observe_in_space(made, episodes=False)


@pytest.mark.slow
@pytest.mark.parametrize("lag", [8e-3, -8e-3])
def test_attitudes_that_come_late_are_taken_later_and_add_no_noise(lag):
    plain, late = rolling(0.0), rolling(lag)
    way = "behind" if lag > 0.0 else "ahead of"
    assert not plain.found.warnings
    assert any(re.match(rf"At hits orientations come (7|8)\.?\d* ms {way} pos", text) for text in late.found.warnings)
    nearest = [np.median(np.abs(o.nodes).min(axis=(1, 2))) for o in (plain, late)]
    assert nearest[0] < 3e-3 and nearest[1] < 6e-3  # half a frame, and one more beside a hit
    spread = [np.sqrt(np.median(np.einsum("nsii->nsi", o.cov)[:, 0, [1, 7]], axis=0)) for o in (plain, late)]
    assert np.all(spread[1] < 2.0 * spread[0]) and len(late) > 0.9 * len(plain)  # velocity and spin


def test_a_small_lead_of_attitudes_is_put_down_to_long_contacts() -> None:
    (long,) = lag_warning(-1.1e-3, 4e-3, shifted=True)
    assert "1.1 ms ahead of positions. Contacts of about 4 ms can cause that" in long and "shifted" in long
    for lag, lasts in ((-1.1e-3, 2e-3), (-4e-3, 4e-3), (1.1e-3, 4e-3)):  # short contacts, a long lead, and a lag
        (said,) = lag_warning(lag, lasts, shifted=False)
        assert "as if they had a separate clock" in said and "shifted" not in said


@pytest.mark.slow
def test_long_contacts_are_no_second_clock() -> None:
    found = observe_in_space(simulate_tosses("box", drops=20, seed=37, contact_time=5e-3), episodes=False).found
    assert all("clock" not in text for text in found.warnings) and "Contacts of about" in found.warnings[0]
