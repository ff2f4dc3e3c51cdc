"""Recordings as rigs write them: intervals hold, colour and rounding are found where they are and nowhere else."""

import numpy as np
import pytest
from bouncing import ellipse_header, fly
from scipy.signal import lfilter
from scipy.stats import binom

from tests.datasets.written_recordings import CASES as RECORDINGS
from tests.datasets.written_recordings import NORMAL, Case, measure, recorded
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.datasets.flights.colour import slope_variance
from thesis_lib.datasets.flights.rounding import rounding_warning
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.detect import find_impacts, find_in_arrays
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import CAUSES, ELLIPSE_BODY, PROOF_RELEASE, RIG_NOISE, HiddenCauses
from thesis_lib.simulate.rig.tracker import Tracker
from thesis_lib.statistics.spread import robust_std

ASKED = 0.92, 0.97  # share of velocities within their 95 % interval
CHANCE = 1e-3  # one-sided, of a binomial count; errors of an impact are taken as independent in three of its six values
INDEPENDENT = 0.5
FOUND = 0.9  # share of the hits with 30 ms of flight on both sides
FALSE = 0.04  # share of used impacts with no true hit between their flights: weak ones that are taken at a wrong time
COLOUR = 0.3  # relative error from 200 flights, and from a spectrum of boxes that ends with waves of 40 samples
DROPS = 60


# one of each way of writing; python -m tests.datasets.written_recordings prints all thirty
TRIED = (
    *("plain, own noise", "100 Hz", "moving average 50 Hz", "Butterworth 30 Hz", "filtfilt 30 Hz", "low pass 3 ms"),
    *("Kalman smoother 30 Hz", "dropped frames", "outliers", "coarse digits", "x five times noisier", "AR(1) 10 ms"),
)


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIED)
def test_intervals_hold(name: str):
    parts = [measure(RECORDINGS[name], shape, 1e-3, DROPS, 1) for shape in ("ellipse", "square")]
    result = [e for part in parts for e in part[0]]
    assert len(result) == 2
    within = np.concatenate([np.abs(e.z) < NORMAL for e in result])
    n = int(INDEPENDENT * within.size)
    low, high = binom.ppf(CHANCE, n, ASKED[0]) / n, binom.ppf(1.0 - CHANCE, n, ASKED[1]) / n
    assert low < within.mean() < high
    assert sum(e.found for e in result) >= binom.ppf(CHANCE, sum(e.there for e in result), FOUND)
    assert sum(e.false for e in result) <= max(1, FALSE * sum(e.used for e in result))


@pytest.mark.parametrize("rate", [100.0, 250.0])
def test_unsmoothed_data_keep_guard_and_colour(rate: float):
    dataset = recorded(Case(rate), "square", 3e-4, 60, 3)
    found = find_impacts(dataset)
    assert found.guard == ArcSettings().guard
    np.testing.assert_array_equal(found.noise.colour, 1.0)
    assert not any("belong to no flight" in text for text in found.warnings)


@pytest.mark.slow
def test_air_drag_is_not_taken_for_slow_noise():
    hidden, rng = HiddenCauses(linear_drag=CAUSES["linear_drag"].size), np.random.default_rng(11)
    made = simulate_compliant_drops(ELLIPSE_BODY, PROOF_RELEASE, 80, hidden=hidden, noise=RIG_NOISE, rng=rng)
    found = find_impacts(Dataset("drag", made.header, made.trajectories))
    np.testing.assert_array_equal(found.noise.colour, 1.0)
    assert found.guard == ArcSettings().guard


@pytest.mark.slow
def test_smoothed_data_widen_the_guard_and_say_so():
    dataset = recorded(RECORDINGS["filtfilt 30 Hz"], "ellipse", 1e-3, 60, 4)
    found = find_impacts(dataset)
    # the filter's response to a corner ends within a period of the cutoff
    assert 0.25 / 30.0 < found.guard < 1.0 / 30.0
    assert any("The samples were smoothed" in text for text in found.warnings)
    # with that guard given there is no rounding left to be seen
    assert find_impacts(dataset, ArcSettings(guard=found.guard)).guard == found.guard


@pytest.mark.slow
@pytest.mark.parametrize("contact_time", [1e-3, 4e-3])
def test_a_long_contact_is_not_called_a_filter(contact_time: float):
    dataset = recorded(Case(1000.0), "ellipse", contact_time, 60, 6)
    assert not any("were smoothed" in text for text in find_impacts(dataset).warnings)


@pytest.mark.parametrize(
    ("touch_time", "told"),
    [
        (0.5e-3, "Corners at impacts are rounded"),
        (1.8e-3, "Contacts last about 3.6 ms. "),  # shorter than a sampling interval
        (6e-3, "Contacts last about 12 ms, several samples. "),
    ],
)
def test_rounding_is_a_filter_or_a_long_contact(touch_time: float, told: str):
    (text,) = rounding_warning(0.012, 1e-3, touch_time, 4e-3, None)
    assert text.startswith(told) and "Samples within 12 ms" in text
    assert rounding_warning(1e-3, 1e-3, touch_time, 4e-3, None) == ()


FILTERS = {  # name of the recording and its cutoff in Hz
    "moving average 50 Hz": 37.0,
    "moving average, 1000 Hz": 63.0,
    "Butterworth 30 Hz": 30.0,
    "Butterworth 100 Hz, 1000 Hz": 100.0,
    "filtfilt 60 Hz": 60.0,
    "Kalman smoother 30 Hz": 30.0,
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "contact_time"), [*zip(FILTERS, (1e-3, 3e-3) * 3)])
def test_a_filter_is_measured_whatever_its_kind(name: str, contact_time: float):
    dataset = recorded(RECORDINGS[name], "ellipse", contact_time, 60, 905)
    low_pass = find_impacts(dataset).low_pass
    assert low_pass is not None
    value, std = low_pass.cutoff
    assert abs(value - FILTERS[name]) < 2.0 * std < 0.4 * value


def test_a_moving_average_lowers_falling_bodies_and_that_is_put_right():
    """Contacts without duration touch at a gap of 0; three samples averaged lower free fall by 52 µm."""
    n, interval = 3, 4e-3  # samples of the average, and seconds between them
    f = fly(ellipse_header(), np.random.default_rng(11), 60, position=1e-4, angle=1e-3)
    averaged = f.q.copy()
    for trial in np.unique(f.trial):
        rows = np.flatnonzero(f.trial == trial)
        averaged[rows[1:-1]] = (f.q[rows[:-2]] + f.q[rows[1:-1]] + f.q[rows[2:]]) / n
    found = find_in_arrays(f.trial, f.t, averaged, f.header)
    variance = (n**2 - 1) / 12.0 * interval**2
    low_pass = found.low_pass
    assert low_pass is not None and low_pass.moves_parabolas
    assert abs(low_pass.second_moment - variance) < 3.0 * low_pass.second_moment_std < 0.1 * variance
    gap = found.used_arcs["gap"].to_numpy()
    error = 1.25 * robust_std(gap - np.median(gap)) / np.sqrt(len(gap))
    assert abs(np.median(gap)) < 3.0 * error < 0.4 * (0.5 * 9.81 * variance)


@pytest.mark.slow
def test_smoothed_drops_are_adequate_with_the_contact_time_that_they_have():
    plain, smoothed = (
        recorded(case, "ellipse", 1e-3, 60, 906) for case in (Case(), RECORDINGS["moving average 50 Hz"])
    )
    judged = criticise_drops(smoothed, rng=np.random.default_rng(0))
    assert judged.verdict == "adequate"
    found, true = judged.ladder[-1][1], Drops(observe(plain)).fit("mirtich", ())
    assert found.values["tau"] > 10.0 * found.std["tau"]
    assert abs(found.values["tau"] - true.values["tau"]) < 3.0 * np.hypot(found.std["tau"], true.std["tau"])
    content = diagnosis(judged, np.random.default_rng(1))
    assert content["low_pass"]["cutoff"]["value"] == pytest.approx(37.0, rel=0.2)
    assert any(
        said.startswith("The samples were smoothed by a low-pass filter of about 3") for said in content["summary"]
    )


@pytest.mark.slow
def test_data_smoothed_beyond_their_flights_are_refused():
    dataset = recorded(Case(250.0, Tracker(filter="zero_phase_butterworth", cutoff=8.0)), "ellipse", 1e-3, 60, 5)
    with pytest.raises(UserError, match=r"leave the free flight: they are smoothed.* Write the data without a filter"):
        find_impacts(dataset)


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.9])
def test_colour_of_autoregressive_noise(rho: float):
    rng, n = np.random.default_rng(7), 25
    white = rng.standard_normal((200, 400, 3))
    noise = lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], white, axis=1)[:, -60:]
    t = np.arange(60.0)[:, None]
    flights = noise + rng.standard_normal((200, 1, 3)) * t + rng.standard_normal((200, 1, 3)) * t**2
    c = np.arange(n) - (n - 1) / 2.0
    c /= c @ c
    R = rho ** np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    np.testing.assert_allclose(slope_variance([flights, flights[:, 20:]], n), c @ R @ c, rtol=COLOUR)


def test_colour_of_filtered_noise_is_that_before_the_filter():
    rng, n = np.random.default_rng(8), 25
    white = rng.standard_normal((200, 64, 3))
    mean = sum(white[:, k : k + 60] for k in range(5)) / 5.0  # gain 1 at the low frequencies of a slope
    c = np.arange(n) - (n - 1) / 2.0
    np.testing.assert_allclose(slope_variance([mean], n), 1.0 / (c @ c), rtol=COLOUR)


def test_exact_samples_have_no_rounding():
    f = fly(ellipse_header(), np.random.default_rng(9), 60, position=0.0, angle=0.0)
    assert find_in_arrays(f.trial, f.t, f.q, f.header).guard == ArcSettings().guard
