"""What a tracker writes: gains and delays of its filters, noise with memory, lost poses, digits."""

import numpy as np
import pytest
from falling import RIG as NOISE

from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, CompliantContact
from thesis_lib.simulate.rig.smoothing import low_pass, smoothed
from thesis_lib.simulate.rig.tracker import Tracker

RATE = 250.0  # Hz
CUTOFF = 30.0
FILTERS = ("moving_average", "butterworth", "zero_phase_butterworth", "kalman_smoother")
GAIN = (
    0.02  # a bilinear transform and a Kalman gain in discrete time are near the continuous formula at an eighth of f_s
)
AVERAGE = 0.15  # the number of poses in a mean is odd
EXACT = 1e-9  # rounding
BLURRED = 1e-3  # of a parabola's curvature: what is left of a transient from the ends
SAMPLING = 0.05  # relative error of a standard deviation or a share, from 12,000 values


def inner(q: np.ndarray) -> np.ndarray:
    """The middle half of the samples, away from the ends."""
    return q[:, q.shape[1] // 4 : -q.shape[1] // 4]


def record(**settings) -> np.ndarray:
    """What is written of a body at rest, (40, 300, 3)."""
    poses = np.zeros((40, 300 * settings.get("frames", 1), 3))
    return Tracker(**settings).record(poses, NOISE, RATE, np.random.default_rng(5))


@pytest.mark.parametrize("kind", FILTERS)
def test_gain_at_the_cutoff(kind: str):
    t = np.arange(1000) / RATE
    for frequency, gain in ((1.0, 1.0), (CUTOFF, np.sqrt(0.5))):
        wave = np.exp(2j * np.pi * frequency * t)[None, :, None] * np.ones(3)
        out = smoothed(wave.real, kind, CUTOFF, RATE) + 1j * smoothed(wave.imag, kind, CUTOFF, RATE)
        measured = np.abs(inner(out)).mean()
        assert measured == pytest.approx(gain, abs=AVERAGE if kind == "moving_average" else GAIN)


@pytest.mark.parametrize("kind", FILTERS)
def test_flights_stay_parabolas(kind: str):
    t = np.arange(500) / RATE
    parabola = np.stack([0.3 * t, -4.905 * t**2, 1.0 - 8.0 * t], axis=1)[None]
    out = smoothed(parabola, kind, CUTOFF, RATE)
    np.testing.assert_allclose(
        inner(np.diff(out, 2, axis=1)), inner(np.diff(parabola, 2, axis=1)), atol=BLURRED * 9.81 / RATE**2
    )
    # a second-order Butterworth filter that runs forwards only is late by √2/ω_c, ω_c that of the bilinear transform
    late = (inner(parabola - out)[..., 0] / 0.3).mean()
    expected = np.sqrt(0.5) / (RATE * np.tan(np.pi * CUTOFF / RATE)) if kind == "butterworth" else 0.0
    assert late == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("kind", FILTERS)
def test_ends_of_recordings_are_kept(kind: str):
    poses = np.random.default_rng(0).standard_normal((3, 60, 3))
    poses[1, 40:] = np.nan
    out = smoothed(poses, kind, CUTOFF, RATE)
    np.testing.assert_array_equal(np.isnan(out), np.isnan(poses))
    alone = smoothed(poses[1:2, :40], kind, CUTOFF, RATE)
    np.testing.assert_allclose(out[1:2, :40], alone, atol=EXACT)


def test_a_median_leaves_a_straight_line_and_takes_a_wrong_pose_out():
    line = np.arange(60.0)[None, :, None] * np.array([1.0, -2.0, 0.5])
    wrong = line.copy()
    wrong[0, 30] += 100.0
    np.testing.assert_allclose(smoothed(line, "median", CUTOFF, RATE), line, atol=1e-9)
    off = np.abs(smoothed(wrong, "median", CUTOFF, RATE) - line)
    assert off.max() <= 4.0 and np.count_nonzero(off.max(axis=2)) <= 20


def test_low_pass_is_exact_for_a_ramp_and_decays_after_a_corner():
    T, t = 3e-3, np.linspace(0.0, 0.1, 401)
    corner = np.maximum(t - 0.05, 0.0)
    poses = np.stack([2.0 * t, corner, 0.0 * t], axis=1)[None]
    out = low_pass(poses, t, np.array([[2.0, 0.0, 0.0]]), T)[0]
    np.testing.assert_allclose(out[:, 0], 2.0 * (t - T), atol=EXACT)
    after = t[t >= 0.05] - 0.05
    np.testing.assert_allclose(out[t >= 0.05, 1], after - T * (1.0 - np.exp(-after / T)), atol=EXACT)


def test_noise_is_white_or_remembers():
    for settings, rho in (({}, 0.0), ({"correlation_time": 0.01}, np.exp(-0.4))):
        out = record(**settings)
        assert out.std((0, 1)) / [3e-4, 3e-4, 3e-3] == pytest.approx(np.ones(3), rel=SAMPLING)
        assert (out[:, 1:] * out[:, :-1]).mean() / (out**2).mean() == pytest.approx(rho, abs=SAMPLING)
    wanders = record(wander=2.0)
    assert (wanders[:, 10:] * wanders[:, :-10]).mean() > 0.6 * (wanders**2).mean()
    assert record(noise_factors=(1.0, 5.0, 1.0)).std((0, 1)) / record().std((0, 1)) == pytest.approx([1.0, 5.0, 1.0])


def test_a_filter_leaves_of_white_noise_what_it_passes():
    white, filtered = record(), record(filter="moving_average", cutoff=37.0)  # a mean of three
    assert filtered.std() / white.std() == pytest.approx(np.sqrt(1.0 / 3.0), rel=SAMPLING)


def test_lost_poses_outliers_and_digits():
    assert np.isnan(record(dropped=0.2)[..., 0]).mean() == pytest.approx(0.2, rel=SAMPLING)
    lost = np.isnan(record(bursts=0.5, burst_length=8)[..., 0])
    assert set(lost.sum(1)) == {0, 8} and (np.abs(np.diff(lost * 1, axis=1)).sum(1) <= 2).all()
    assert (np.abs(record(outliers=0.03)[..., 0]) > 6 * 3e-4).mean() == pytest.approx(0.03 * 0.764, rel=0.2)
    coarse = record(position_step=1e-3, angle_step=0.01)
    np.testing.assert_allclose(coarse / [1e-3, 1e-3, 0.01], np.round(coarse / [1e-3, 1e-3, 0.01]), atol=EXACT)
    assert record(frames=4).shape == (40, 300, 3)


def test_a_tracker_changes_what_is_written_and_nothing_else():
    def drop(tracker: Tracker | None):
        contact = CompliantContact(contact_time=1e-3, steps=40)
        chosen = {"contact": contact, "noise": NOISE, "rng": np.random.default_rng(1)}
        return simulate_compliant_drops(ELLIPSE_BODY, PROOF_RELEASE, 4, tracker=tracker, **chosen)

    plain, filtered = drop(None), drop(Tracker(frames=2, filter="butterworth"))
    slow = drop(Tracker(time_constant=2e-3))
    for other in (filtered, slow):
        np.testing.assert_allclose(other.impacts["vy_post"], plain.impacts["vy_post"], atol=1e-6)
        np.testing.assert_allclose(other.trajectories["t"], plain.trajectories["t"])
        assert np.abs(other.trajectories["y"] - plain.trajectories["y"]).max() > 1e-3
    assert plain.header.noise == NOISE and filtered.header.noise is None
