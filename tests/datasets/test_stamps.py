"""Time stamps of arrival are told from those of exposure, by the flights, and put right."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bouncing import Flights, ellipse_header, fly

from thesis_lib.datasets.format.samples import ArcSettings, make_samples, sampling_period
from thesis_lib.datasets.impacts.detect import find_in_arrays
from thesis_lib.datasets.samples.stamps import exposure_times, times_of_pictures
from thesis_lib.datasets.sources.logs import convert
from thesis_lib.datasets.sources.tables.options import Reading
from thesis_lib.datasets.sources.tables.rig_options import RigOptions

PERIOD = 4e-3
LATE = 2e-3  # s, mean of the delays; half a period
SHIFT = 0.3e-3  # s; a trial's rows move together by its least delay, which is LATE over the number of rows
MISPLACED = 1e-3  # share of rows that are late by a whole interval beside a loss, or before the end of a trial
CLOSE = 2e-4  # relative; a mean of 100 slopes through 150 rows each has 1e-4
LOOSE = 0.02  # relative; a period that lets late rows be counted
OF_A_LOG = 5e-4  # relative; 0.3 ms over 0.6 s, since all trials of `fly` are rounded alike


def arrival(t: np.ndarray, trial: np.ndarray, rng: np.random.Generator, late: float = LATE) -> np.ndarray:
    """Stamps of rows that come late, in order, one at a time."""
    stamps = t + rng.exponential(late, len(t))
    for one in np.unique(trial):
        rows = trial == one
        stamps[rows] = np.maximum.accumulate(stamps[rows]) + 1e-9 * np.arange(rows.sum())
    return stamps


@pytest.fixture(scope="module")
def flights() -> Flights:
    return fly(ellipse_header(), np.random.default_rng(5), 100)


def restored(flights: Flights, t: np.ndarray, rows: np.ndarray | slice = slice(None), **header: object):
    given = ellipse_header(**header)
    samples = make_samples(flights.trial[rows], t[rows], flights.q[rows], given, ArcSettings())
    return samples, *exposure_times(samples, given, ArcSettings())


def errors(made, flights: Flights) -> np.ndarray:
    """Times less those of the pictures, less the median of each trial; pictures are told by their exact poses."""
    off = []
    for one in np.unique(made.trial):
        rows, of = made.trial == one, flights.trial == one
        picture = np.abs(made.q[rows][:, None, :] - flights.q[of][None]).sum(axis=2).argmin(axis=1)
        late = made.t[rows] - flights.t[of][picture]
        off.append(late - np.median(late))
    return np.concatenate(off)


def test_stamps_of_a_clock_stay_as_they_are(flights: Flights) -> None:
    for t in (
        flights.t,
        np.round(flights.t, 3),
        flights.t + 2e-5 * np.random.default_rng(2).standard_normal(len(flights.t)),
    ):
        samples, made, said = restored(flights, t)
        assert made is samples and said == ""
    kept = np.random.default_rng(3).random(len(flights.t)) > 0.05  # lost pictures alone do not make stamps of arrival
    samples, made, said = restored(flights, flights.t, kept)
    assert made is samples and said == ""


@pytest.mark.parametrize("rate", [250.0, None, 249.0])
def test_delays_are_taken_out(flights: Flights, rate: float | None) -> None:
    stamps = arrival(flights.t, flights.trial, np.random.default_rng(7))
    samples, made, said = restored(flights, stamps, rate=rate)
    assert "those of arrival, not of exposure" in said and len(made) == len(samples)
    assert np.abs(samples.t - flights.t).max() > 2 * PERIOD
    assert np.abs(errors(made, flights)).max() < CLOSE * 150 * PERIOD
    # and the time in flight is right, so that gravity is
    inside = made.trial[1:] == made.trial[:-1]
    assert np.median(np.diff(made.t)[inside]) == pytest.approx(PERIOD, rel=CLOSE)
    if rate is not None:  # a stated rate that is off by more than the stamps allow gives way to theirs
        assert (f"clock of {rate:g} Hz" in said) == (rate == 250.0)


def test_digits_that_were_cut_off_are_restored() -> None:
    """Pictures at 120 Hz with stamps in milliseconds: 8, 9 and 8 ms apart."""
    at_120 = fly(ellipse_header(rate=120.0), np.random.default_rng(5), 100, samples=75)
    _, made, said = restored(at_120, np.floor(1e3 * at_120.t) / 1e3, rate=120.0)
    assert "are rounded to 1 ms" in said and "with more digits" in said and "arrival" not in said
    assert np.abs(errors(made, at_120)).max() < CLOSE * 75 / 120.0


def test_lost_pictures_are_counted(flights: Flights) -> None:
    rng = np.random.default_rng(8)
    kept = rng.random(len(flights.t)) > 0.02
    some = Flights(flights.header, flights.trial[kept], flights.t[kept], flights.q[kept], *[flights.exact] * 6)
    stamps = arrival(some.t, some.trial, rng)
    samples, made, said = restored(some, stamps)
    assert "rows are left out: they come first after lost pictures, or late from before them" in said
    assert 0.95 < len(made) / len(samples) < 1.0
    # nearly all rows stand at their pictures; those near the end of a trial may miss one
    assert np.mean(np.abs(errors(made, some)) < SHIFT) > 0.97


@pytest.mark.parametrize("late", [0.0, 0.6e-3])
def test_losses_lie_where_the_stamps_have_them_if_rows_are_little_late(late: float) -> None:
    """Up to the last row of a trial, and beyond the end of a part of a long recording; no row is left out."""
    rng = np.random.default_rng(8)
    at_240 = fly(ellipse_header(rate=240.0), np.random.default_rng(5), 60)
    kept = rng.random(len(at_240.t)) > 0.02
    some = Flights(at_240.header, at_240.trial[kept], at_240.t[kept], at_240.q[kept], *[at_240.exact] * 6)
    stamps = np.round(arrival(some.t, some.trial, rng, late), 4 if late else 3)  # some are equal
    samples, made, said = restored(some, stamps, rate=240.0)
    assert ("rounded to 1 ms" in said) == (late == 0.0) and "left out" not in said and len(made) == len(samples)
    assert np.mean(np.abs(errors(made, some)) > 0.5 / 240.0) < MISPLACED
    part = np.cumsum(np.r_[True, np.diff(samples.trial) != 0] | (np.arange(len(samples)) % 50 == 0))
    found = times_of_pictures(replace(samples, trial=part, run=samples.trial), 240.0)
    assert found is not None and found[0].all()
    assert np.mean(np.abs(errors(replace(samples, t=found[1]), some)) > 0.5 / 240.0) < MISPLACED


@pytest.mark.parametrize("digits", [3, 9])
def test_equal_stamps_of_a_planar_log_are_put_apart(tmp_path, flights: Flights, digits: int) -> None:
    """Or nearly equal ones, with all digits."""
    stamps = np.round(arrival(flights.t, flights.trial, np.random.default_rng(8), 1e-3), digits)
    log = pd.DataFrame(np.c_[flights.trial, stamps, flights.q], columns=["trial", "t", "x", "y", "theta"])
    assert 0 < np.sum(np.abs(np.diff(stamps)) < 1e-6) < 0.1 * len(log)
    log.to_csv(tmp_path / "log.csv", index=False)
    made = convert([tmp_path / "log.csv"], "out", RigOptions(flights.header.body.shape), Reading())
    assert any("those of arrival" in note for note in made.notes) and made.dataset.trajectories is not None
    assert np.abs(made.dataset.trajectories["t"] - flights.t).max() < SHIFT


@pytest.mark.parametrize("rate", [120.0, 240.0, 300.0])
@pytest.mark.parametrize("lost", [0.0, 0.05])
def test_rate_of_a_planar_log_in_milliseconds_is_that_of_the_camera(tmp_path, rate: float, lost: float) -> None:
    """A median step reads 125, 250 and 333 Hz; the picture numbers that follow hide two thirds of the impacts."""
    made = fly(ellipse_header(rate=rate), np.random.default_rng(5), 60, samples=int(0.6 * rate))
    kept = np.random.default_rng(1).random(len(made.t)) > lost
    columns = np.c_[made.trial, np.round(made.t, 3), made.q][kept]
    pd.DataFrame(columns, columns=["trial", "t", "x", "y", "theta"]).to_csv(tmp_path / "log.csv", index=False)
    read = convert([tmp_path / "log.csv"], "out", RigOptions(made.header.body.shape), Reading()).dataset
    assert read.rate == pytest.approx(rate, rel=OF_A_LOG)


@pytest.mark.parametrize("lost", [0.0, 0.2, 0.35])
def test_lost_frames_leave_the_sampling_period_alone(lost: float) -> None:
    """Stamps to the last digit, and in whole milliseconds; steps over four rows read 158 and 133 Hz instead of 200."""
    for rate, digits in ((200.0, 9), (240.0, 3)):
        kept = np.random.default_rng(4).random(2000) >= lost
        t = np.round(np.arange(2000) / rate, digits)[kept]
        assert 1.0 / sampling_period(t, np.arange(2000)[kept] // 500) == pytest.approx(rate, rel=OF_A_LOG)


@pytest.mark.parametrize("stamps", ["pairs", "fours", "late"])
def test_sampling_period_is_not_that_within_a_burst_of_rows(stamps: str) -> None:
    """Rows that arrive two or four at a time, 0.1 ms apart, before a pause of 10 s; and rows late by half a frame."""
    row, rng = np.arange(2000), np.random.default_rng(4)
    many = {"pairs": 2, "fours": 4, "late": 1}[stamps]
    t = PERIOD * (row - row % many) + 1e-4 * (row % many) + 10.0 * (row >= 1000)
    t = arrival(t, 0 * row, rng) if many == 1 else t
    # pairs that begin and end in the middle have more long steps than short ones
    assert sampling_period(t[1:-1], 0 * row[1:-1]) == pytest.approx(PERIOD, rel=LOOSE)


def test_pictures_that_were_taken_at_odd_times_stay_where_they_are() -> None:
    """The stamps of a camera that is triggered by software are irregular, and right."""
    fast = fly(ellipse_header(rate=1000.0), np.random.default_rng(5), 100, samples=600)
    rng = np.random.default_rng(1)
    rows = []
    for one in np.unique(fast.trial):
        of = np.flatnonzero(fast.trial == one)
        at = np.cumsum(rng.integers(2, 7, len(of)))
        rows.append(of[at[at < len(of)]])
    samples, made, said = restored(fast, fast.t, np.concatenate(rows))
    assert made is samples and said == ""


def test_impacts_are_found_again_and_the_reason_is_said(flights: Flights) -> None:
    stamps = arrival(flights.t, flights.trial, np.random.default_rng(9))
    found = find_in_arrays(flights.trial, stamps, flights.q, flights.header)
    exact = find_in_arrays(flights.trial, flights.t, flights.q, flights.header)
    assert len(found.impacts) == pytest.approx(len(exact.impacts), rel=0.02)
    assert any("those of arrival" in warning for warning in found.warnings)
    np.testing.assert_allclose(found.noise.sigma, exact.noise.sigma, rtol=0.05)
    assert not any("those of arrival" in warning for warning in exact.warnings)


def test_a_body_at_rest_says_nothing() -> None:
    header = ellipse_header()
    rng = np.random.default_rng(4)
    trial = np.repeat(np.arange(50), 100)
    t = np.tile(np.arange(100) * PERIOD, 50)
    q = [0.1, 0.037, 0.2] + rng.standard_normal((len(t), 3)) * [3e-4, 3e-4, 3e-3]
    samples = make_samples(trial, arrival(t, trial, rng), q, header, ArcSettings())
    assert exposure_times(samples, header, ArcSettings()) == (samples, "")
    few = samples.select(np.arange(10))
    assert exposure_times(few, header, ArcSettings()) == (few, "")
