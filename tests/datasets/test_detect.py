"""Detection and driver: all impacts found, none invented; noise; glitches; rest; records without impacts."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bouncing import Flights, ellipse_header, fly
from scipy.signal import lfilter

from thesis_lib.datasets.flights import noise
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import IMPACT_COLUMNS
from thesis_lib.datasets.format.samples import ArcSettings, make_samples
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_impacts, find_in_arrays
from thesis_lib.datasets.impacts.quality import REASONS
from thesis_lib.datasets.impacts.stays_down import landing_speeds
from thesis_lib.foundation.errors import UserError

FOUND = 0.99  # share of measurable impacts; the rest are weak ones with 6 to 9 samples on a side
MATCH = 4e-3  # s, one frame
NOISE = 0.1  # relative; 600 impacts give 2 %
SECONDS = 2.5  # CPU, for 2000 trials of 150 samples; measured 1.5 to 2 on one core
SAME = 1e-9  # m, rad, m/s: order of summation


@pytest.fixture(scope="module")
def flights() -> Flights:
    return fly(ellipse_header(), np.random.default_rng(21), 300)


@pytest.fixture(scope="module")
def found(flights: Flights) -> FoundImpacts:
    return find_in_arrays(flights.trial, flights.t, flights.q, flights.header)


def matched(f: Flights, trial: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index of the nearest true impact (n,), and whether it is within a frame."""
    index, off = f.nearest(trial, t)
    return index, off < MATCH


def test_finds_measurable_impacts_and_no_others(flights: Flights, found: FoundImpacts):
    index, true = matched(flights, found.impacts.trial, found.impacts.t)
    assert true.all()
    assert len(np.unique(index)) == len(index)
    measurable = np.flatnonzero((flights.room() >= 6).all(1))
    assert len(measurable) > 600
    assert np.isin(measurable, index).mean() >= FOUND
    assert set(found.left_out["reason"]) <= set(REASONS)
    assert len(found.arcs) == len(found.impacts) + len(found.left_out)
    # nothing invented among the left out, either
    assert matched(flights, found.left_out["trial"].to_numpy(), found.left_out["t"].to_numpy())[1].mean() > 0.9


def test_ordinals_count_all_hits_in_time(found: FoundImpacts):
    for _, rows in found.arcs.groupby("trial"):
        assert list(rows["impact"]) == list(range(len(rows))) and rows["t"].is_monotonic_increasing


def test_noise_is_estimated_from_the_arcs(found: FoundImpacts):
    estimate = found.noise
    assert estimate.source == "arcs" and estimate.contact_spread == 0.0 and not estimate.stray.any()
    assert estimate.position == pytest.approx(3e-4, rel=NOISE)
    assert estimate.angle == pytest.approx(3e-3, rel=NOISE)
    np.testing.assert_array_equal(estimate.colour, 1.0)
    np.testing.assert_allclose(found.impacts.r[:, 1], -(found.impacts.q[:, 1] - 0.012), atol=2e-3)


@pytest.mark.slow
def test_header_noise_is_compared_with_the_arcs():
    flights = fly(ellipse_header(), np.random.default_rng(23), 60)
    cases = ((3e-4, False, 3e-4), (3.4e-4, False, 3.4e-4), (4.2e-4, True, 3e-4), (1e-2, True, 3e-4))
    for position, warns, used in (*cases, (1.8e-4, True, 1.8e-4), (3e-6, True, 3e-4)):
        header = ellipse_header(noise={"position": position, "angle": 3e-3})
        found = find_in_arrays(flights.trial, flights.t, flights.q, header)
        assert any("dataset.yaml states" in text for text in found.warnings) is warns
        assert any("the value of the arcs is used" in text for text in found.warnings) is (used != position)
        assert found.noise.used[0] == pytest.approx(used, rel=NOISE)
        assert found.noise.used[2] == found.noise.stated[2] == 3e-3
        assert found.noise.position == pytest.approx(3e-4, rel=NOISE)
        assert matched(flights, found.impacts.trial, found.impacts.t)[1].mean() > 0.999


@pytest.mark.parametrize("memory", [0.0, 0.7])
def test_noise_that_is_stated_too_large_is_as_good_as_none(memory: float):
    """White or not: where samples scatter less than stated, impacts are those that the samples alone would give."""
    f = fly(ellipse_header(), np.random.default_rng(21), 60, position=0.0, angle=0.0)
    white = np.random.default_rng(22).normal(size=f.q.shape) * [3e-4, 3e-4, 3e-3]
    q = f.exact + lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white, axis=0)
    header = ellipse_header(noise={"position": 5.9e-4, "angle": 5.9e-3})
    doubled, unstated = (find_in_arrays(f.trial, f.t, q, h) for h in (header, f.header))
    np.testing.assert_allclose(doubled.noise.used, unstated.noise.used, rtol=SAME)
    np.testing.assert_allclose(doubled.impacts.cov, unstated.impacts.cov, rtol=SAME, atol=1e-18)
    assert sum("the value of the arcs is used" in text for text in doubled.warnings) == 3


@pytest.mark.parametrize(("slower", "impacts", "doubted"), [(1.0, 100, True), (1.6, 100, False), (1.0, 3, False)])
def test_stated_noise_may_hold_errors_slower_than_an_arc_and_what_few_arcs_do_not_show(
    monkeypatch: pytest.MonkeyPatch, slower: float, impacts: int, doubted: bool
):
    monkeypatch.setattr(noise, "_colour_of_flights", lambda *_: (np.full(3, slower), 50))
    sigma = np.array([3e-4, 3e-4, 3e-3])
    estimate = noise.NoiseEstimate(3e-4, 3e-3, sigma, 1.4 * sigma, "arcs", stated=1.4 * sigma)
    fits = SimpleNamespace(flying=SimpleNamespace(n_side=np.full((impacts, 2), 8)))
    assert noise.overstated(estimate, fits, None, None, 1e-3).all() == doubted


def test_order_of_trials_and_of_rows_is_indifferent(flights: Flights, found: FoundImpacts):
    rng = np.random.default_rng(0)
    label = rng.permutation(300)
    rows = rng.permutation(len(flights.t))
    other = find_in_arrays(label[flights.trial][rows], flights.t[rows], flights.q[rows], flights.header).impacts
    order = np.lexsort((other.impact, np.argsort(label)[other.trial]))
    np.testing.assert_allclose(other.v_post[order], found.impacts.v_post, atol=SAME)
    np.testing.assert_allclose(other.q[order], found.impacts.q, atol=SAME)


def test_times_and_places_far_from_zero_do_not_matter(flights: Flights, found: FoundImpacts):
    far = find_in_arrays(flights.trial, flights.t + 1000.0, flights.q + [50.0, 0, 40 * np.pi], flights.header)
    assert len(far.impacts) == len(found.impacts)
    # 1000 s has digits of 1e-13 s, times 4 m/s over 0.1 s
    np.testing.assert_allclose(far.impacts.v_post, found.impacts.v_post, atol=1e-6)


def test_single_sample_glitch_is_masked_and_reported(flights: Flights, found: FoundImpacts):
    rng = np.random.default_rng(1)
    q = flights.q.copy()
    trials = np.arange(0, 300, 5)
    rows = trials * 150 + rng.integers(5, 25, len(trials))
    index = np.searchsorted(flights.trial * 1e3 + flights.t, (rows // 150) * 1e3 + (rows % 150) * 0.004 - 1e-6)
    q[index] += rng.normal(size=(len(rows), 3)) * [0.02, 0.02, 0.3] + [0.01, 0, 0]
    other = find_in_arrays(flights.trial, flights.t, q, flights.header)
    assert matched(flights, other.impacts.trial, other.impacts.t)[1].all()
    assert len(other.impacts) >= len(found.impacts) - 2
    reported = set(zip(other.glitches["trial"], np.round(other.glitches["t"] / 0.004)))
    injected = set(zip(flights.trial[index], np.round(flights.t[index] / 0.004)))
    assert len(injected & reported) >= 0.95 * len(injected)
    assert any("glitches" in text for text in other.warnings)
    *_, one = noise.noise_warnings(found.noise, found.noise.sigma, other.glitches[:1], ArcSettings())
    assert one.startswith("1 single sample in 1 trial treated as lost frames")


@pytest.mark.slow
def test_a_gross_contradiction_is_refused_with_its_factor_and_cause(flights: Flights):
    def refusal(a: float = 0.035, b: float = 0.025, height: float = 0.012) -> str:
        shape = {"kind": "ellipse", "semi_axes": [a, b]}
        head = ellipse_header(body={"shape": shape, "radius_of_gyration": 0.0192}, surface={"height": height})
        try:
            find_impacts(Dataset("drops", head, flights.table))
        except UserError as error:
            return str(error)
        return ""

    assert "times too large (diameters" in refusal(0.07, 0.05)
    assert "surface.height 0.012" in refusal(height=0.062)
    assert refusal() == refusal(0.037, 0.027) == refusal(height=0.006) == ""


def test_rows_that_are_no_measurement_are_left_out_of_given_impacts():
    values = [[i, 0, 0.0, 0.037, 0.1, 0.5, -2.0, 3.0, 0.4, 1.0, -5.0] for i in range(20)]
    values[7][9] = 1e6
    table = pd.DataFrame(values, columns=list(IMPACT_COLUMNS))
    found = find_impacts(Dataset("given", ellipse_header(), impacts=table))
    assert list(found.left_out["trial"]) == [7] and list(found.left_out["reason"]) == ["energy_gain"]
    assert len(found.impacts) == 19 and 7 not in found.impacts.trial


def test_rest_after_the_bounces_gives_no_impacts(flights: Flights):
    """The body lies still for 0.4 s after its last sample: nothing there may be used as an impact."""
    parts, last = [], np.r_[np.flatnonzero(np.diff(flights.trial)), len(flights.t) - 1]
    rng = np.random.default_rng(2)
    for i in last[:100]:
        rest = np.tile(flights.exact[i] * [1, 0, 0] + [0, 0.012 + 0.025, 0], (100, 1))
        rest += rng.normal(size=rest.shape) * [3e-4, 3e-4, 3e-3]
        parts.append((np.full(100, flights.trial[i]), flights.t[i] + 0.004 * np.arange(5, 105), rest))
    keep = flights.trial < 100
    trial, t, q = (
        np.concatenate([a[keep], *(p[j] for p in parts)]) for j, a in enumerate((flights.trial, flights.t, flights.q))
    )
    found = find_in_arrays(trial, t, q, flights.header)
    end = flights.t[last[:100]]
    assert (found.impacts.t < end[found.impacts.trial]).all()
    assert len(found.impacts) > 150


def test_free_flight_and_rest_hold_no_impacts():
    header, rng = ellipse_header(), np.random.default_rng(3)
    t = np.tile(np.arange(100) * 0.004, 400)
    trial = np.repeat(np.arange(400), 100)
    fall = np.stack([0.3 * t, 2.0 + 1.0 * t - 4.905 * t**2, 5.0 * t], 1)
    still = np.tile([0.1, 0.037, 0.0], (len(t), 1))
    noise = rng.normal(size=fall.shape) * [3e-4, 3e-4, 3e-3]
    for q in (fall, still):
        found = find_in_arrays(trial, t, q + noise, header)
        assert len(found.impacts) == 0 and len(found.left_out) == 0


def test_a_rocking_body_is_not_an_impact():
    """Rolling and rocking on the surface: smooth accelerations, no spikes."""
    header, rng = ellipse_header(), np.random.default_rng(4)
    t = np.tile(np.arange(200) * 0.004, 20)
    trial = np.repeat(np.arange(20), 200)
    theta = 0.5 * np.sin(12.0 * t + trial)
    q = np.stack([-0.03 * theta, 0.012 - header.body.shape.contact_point(theta)[:, 1], theta], 1)
    found = find_in_arrays(trial, t, q + rng.normal(size=q.shape) * [3e-4, 3e-4, 3e-3], header)
    assert len(found.impacts) == 0


@pytest.mark.parametrize("samples", [0, 1, 2, 3, 5, 8, 12])
def test_very_short_records(samples: int):
    f = fly(ellipse_header(), np.random.default_rng(5), 30)
    keep = (f.t > 0.2) & (f.t < 0.2 + samples * 0.004 + 1e-6) if samples else f.t < -1
    found = find_in_arrays(f.trial[keep], f.t[keep], f.q[keep], f.header)
    if len(found.impacts):
        assert matched(f, found.impacts.trial, found.impacts.t)[1].all()
    assert samples > 10 or len(found.impacts) == 0


def test_impacts_given_by_the_user_win():
    values = [[0, 0, 0.0, 0.037, 0.1, 0.5, -2.0, 3.0, 0.4, 1.0, -5.0]]
    table = pd.DataFrame(values, columns=list(IMPACT_COLUMNS))
    poses = pd.DataFrame({"trial": [0], "t": [0.0], "x": [0.0], "y": [1.0], "theta": [0.0]})
    noise = {"position": 1e-3, "angle": 2e-3, "velocity": 0.02, "angular_velocity": 0.5}
    for header, diagonal in (
        (ellipse_header(noise=noise), [1e-3, 1e-3, 2e-3] + [0.02, 0.02, 0.5] * 2),
        (ellipse_header(noise={"position": 1e-3}), None),
        (ellipse_header(), None),
    ):
        found = find_impacts(Dataset("given", header, poses, table))
        assert len(found.impacts) == 1 and found.left_out.empty
        if diagonal is None:
            assert found.impacts.cov is None
        else:
            np.testing.assert_allclose(np.diag(found.impacts.cov[0]), np.square(diagonal))


def test_driver_takes_a_dataset_and_refuses_an_empty_one(flights: Flights, found: FoundImpacts):
    dataset = Dataset("drops", flights.header, flights.table)
    np.testing.assert_array_equal(find_impacts(dataset).impacts.t, found.impacts.t)
    summary = found.summary()
    assert len(found.arcs) == summary["used"] + sum(summary["left_out"].values())
    with pytest.raises(UserError, match="neither"):
        find_impacts(Dataset("drops", flights.header))


@pytest.mark.slow
def test_speed():
    f = fly(ellipse_header(), np.random.default_rng(6), 2000)
    start = time.process_time()
    find_in_arrays(f.trial, f.t, f.q, f.header)
    assert time.process_time() - start < 4 * SECONDS  # on a busy machine, processor time itself grows threefold


@pytest.mark.slow
def test_measured_dice(planar_dice_dir):
    """Known of the throws, here 200: two to three clean impacts per roll or so, eps near 0.5, first touch at 50 ms."""
    from thesis_lib.datasets.impacts.quality import contact_measures
    from thesis_lib.datasets.read import read_dataset

    dataset = read_dataset(planar_dice_dir)
    table = dataset.trajectories
    some = table[table["trial"].isin(table["trial"].unique()[:200])]
    found = find_impacts(replace(dataset, trajectories=some))
    assert 480 < len(found.impacts) < 880
    assert len(np.unique(found.impacts.trial)) > 180
    # guided between glass sheets, and tracked smoothly: neither straight arcs nor white noise
    assert (found.noise.stray > 0).all() and (found.noise.colour > 1).all()
    first = found.arcs[found.arcs["impact"] == 0]
    assert len(first) == 200 and 0.04 < first["t"].median() < 0.06
    # the body is where it should be: the median gap at impact is well below the side of 60 mm
    used = found.arcs[found.arcs["used"]]
    assert used["gap"].abs().median() < 1.5e-3
    c = contact_measures(found.impacts)
    assert 0.4 < np.median(-c.v_c_post[:, 1] / c.v_c_pre[:, 1]) < 0.7
    # many first impacts are two corners within a frame or so
    reasons = found.left_out[found.left_out["impact"] == 0]["reason"].value_counts()
    assert reasons.idxmax() == "second_hit"


def test_a_body_lands_with_the_speed_of_its_fall():
    """Exact falls of a disk onto a floor, on which it stays; frames are 4 ms apart, in which it falls up to 12 mm."""
    heights, g, radius = np.linspace(0.1, 0.4, 7), 9.81, 0.03
    header = ellipse_header(body={"shape": {"kind": "disk", "radius": radius}, "radius_of_gyration": 0.02})
    t = np.arange(150) / 250.0
    fall = np.maximum(heights[:, None] - 0.5 * g * t**2, 0.0)
    q = np.stack([0.0 * fall, header.surface.height + radius + fall, 0.0 * fall], axis=2)
    trial = np.repeat(np.arange(7), len(t))
    samples = make_samples(trial, np.tile(t, 7), q.reshape(-1, 3), header, ArcSettings())
    at = np.arange(7) * len(t) + (fall > 0.0).sum(axis=1) - 1
    landed = landing_speeds(samples, at, np.array([1e-5, 1e-5, 1e-4]), header, ArcSettings())
    np.testing.assert_allclose(landed, np.sqrt(2.0 * g * heights), rtol=1e-6)
