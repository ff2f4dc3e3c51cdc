"""Pictures that repeat the previous one are told from bodies at rest and from coarse digits, and left out."""

from collections.abc import Callable

import numpy as np
import pytest
from bouncing import Flights, ellipse_header, fly
from rolling import Rig, roll

from thesis_lib.datasets.format.samples import ArcSettings, make_samples
from thesis_lib.datasets.impacts.detect import find_in_arrays
from thesis_lib.datasets.samples.copies import without_copies

RATE = 120.0
NOISE = 3e-4  # m, of `fly`
FOUND = 0.98  # share of the copies that are found; the others are of slow bodies, or stand in the first row
CLOSE = 0.12  # relative; the noise is known to 10 %
SHARE = 0.9  # of the impacts used without copies


@pytest.fixture(scope="module")
def flights() -> Flights:
    return fly(ellipse_header(rate=RATE), np.random.default_rng(3), 40, samples=140)


def repeated(flights: Flights, copy: np.ndarray, digits: int) -> np.ndarray:
    """Poses in which the rows `copy` (mask) hold what the row before holds, with so many digits."""
    q = np.round(flights.q, digits)
    for i in np.flatnonzero(copy[1:] & (np.diff(flights.trial) == 0)) + 1:
        q[i] = q[i - 1]
    return q


PATTERNS: dict[str, Callable[[int], np.ndarray]] = {
    "every fifth": lambda n: np.arange(n) % 5 == 4,
    "every second": lambda n: np.arange(n) % 2 == 1,
    "two of three": lambda n: np.arange(n) % 3 > 0,
    "four of five": lambda n: np.arange(n) % 5 > 0,
    "two of five": lambda n: np.floor(np.arange(n) * 0.6) == np.floor((np.arange(n) - 1) * 0.6),
    "now and then": lambda n: np.random.default_rng(0).random(n) < 0.05,
    "in a row": lambda n: np.convolve(np.random.default_rng(0).random(n) < 0.02, np.ones(2))[:n] > 0.0,
}


@pytest.mark.parametrize("digits", [3, 5])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_copies_are_left_out(flights: Flights, pattern: str, digits: int) -> None:
    copy = PATTERNS[pattern](len(flights.t)) & np.r_[False, np.diff(flights.trial) == 0]
    q = repeated(flights, copy, digits)
    samples = make_samples(flights.trial, flights.t, q, flights.header, ArcSettings())
    kept, said = without_copies(samples)
    assert "repeat the previous one" in said and "as lost frames" in said
    held = pattern in ("now and then", "in a row")
    assert ("holds its last pose" in said and "nothing to do" in said) == held
    assert ("video converted" in said and "Export the pictures" in said) == (not held)
    stays = np.isin(samples.trial * 1e3 + samples.t, kept.trial * 1e3 + kept.t)
    assert (~stays[copy]).mean() > FOUND
    assert stays[~copy].mean() > FOUND


def test_the_share_is_said_and_impacts_and_noise_are_those_without_copies(flights: Flights) -> None:
    q = repeated(flights, PATTERNS["every fifth"](len(flights.t)), 5)
    found = find_in_arrays(flights.trial, flights.t, q, flights.header)
    whole = find_in_arrays(flights.trial, flights.t, flights.q, flights.header)
    assert found.warnings[0].startswith("20 % of the pictures")
    assert "120 pictures a second made of 96" in found.warnings[0]
    assert found.noise.position == pytest.approx(NOISE, rel=CLOSE)
    assert len(found.impacts) > SHARE * len(whole.impacts)
    # without spoiled rows hardly any false hit is left
    assert len(found.arcs) == pytest.approx(len(whole.arcs), rel=0.05)
    assert not any("repeat" in text for text in whole.warnings)


def test_pictures_that_were_shown_late_get_the_times_at_which_they_were_taken() -> None:
    """A camera of 96 Hz, written at 120 Hz: each picture is shown late, by up to one of these."""
    taken = fly(ellipse_header(rate=96.0), np.random.default_rng(3), 40, samples=112)
    header, rows, times = ellipse_header(rate=RATE), [], []
    for trial in np.unique(taken.trial):
        of = np.flatnonzero(taken.trial == trial)
        t = np.arange(140) / RATE
        at = np.floor(t * 96.0 + 1e-9).astype(int)
        rows.append(of[at[at < len(of)]])
        times.append(t[at < len(of)])
    shown, t = np.concatenate(rows), np.concatenate(times)
    found = find_in_arrays(taken.trial[shown], t, taken.q[shown], header)
    assert "repeat the previous one" in found.warnings[0] and "those of arrival" in found.warnings[1]
    assert found.noise.position == pytest.approx(NOISE, rel=CLOSE)


@pytest.mark.parametrize("digit", [1e-6, 1e-3, 5e-3])
@pytest.mark.parametrize("noise", [0.0, 3e-4, 1e-3])
@pytest.mark.parametrize("rate", [25.0, 118.0])
def test_bodies_at_rest_and_coarse_digits_are_no_copies(digit: float, noise: float, rate: float) -> None:
    """A puck that stands still for seconds, is struck, and slows down until it stops."""
    rolled = roll(Rig(rate=rate, noise=noise), 60.0, np.random.default_rng(1))
    q = np.column_stack([digit * np.round(rolled.xy / digit), np.zeros(len(rolled.t))])
    samples = make_samples(np.zeros(len(q), int), rolled.t, q, rolled.header, ArcSettings())
    assert without_copies(samples) == (samples, "")


def test_coarse_digits_of_drops_are_no_copies(flights: Flights) -> None:
    for digits in (2, 3):
        q = np.round(flights.q, digits)
        samples = make_samples(flights.trial, flights.t, q, flights.header, ArcSettings())
        assert without_copies(samples) == (samples, "")
