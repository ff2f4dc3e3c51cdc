"""One long recording becomes drops: all that were made, none that a hand made up."""

import numpy as np
import pytest

from tests.datasets.in_space import BODIES, UP, Take, take
from thesis_lib.datasets.sources.motion_capture.tracked_bodies import body_of_markers
from thesis_lib.datasets.space.drops import IN_THE_AIR, SPATIAL, Cuts, Drop, cut_drops, impact_shares
from thesis_lib.datasets.space.flights import find_flights, follow
from thesis_lib.figures.cuts import draw_cuts

G = 9.81


def drops_of(recorded: Take, shape: str = "ellipse", lost: float = 0.0) -> tuple[list[Drop], np.ndarray]:
    """The drops found, and the times of the samples that were seen; heights are the true ones."""
    seen = ~recorded.lose(lost)
    track = follow(recorded.t[seen], recorded.position[seen], G)
    flat = recorded.position @ recorded.axes[:2].T
    angle = np.nan_to_num(recorded.planar[:, 2])
    height = BODIES[shape].shape.gap(flat[:, 1], angle, 0.0)[seen]
    return cut_drops(track, height, find_flights(track, -G * UP["z"]), BODIES[shape].shape.extent), recorded.t[seen]


@pytest.mark.parametrize("rate", [120.0, 250.0, pytest.param(1000.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("lost", [0.0, 0.03])
def test_each_drop_is_cut_out(rate, lost):
    recorded = take(10, rate=rate, seed=3)
    found, t = drops_of(recorded, lost=lost)
    used = [drop for drop in found if not drop.left_out]
    starts = np.array([t[drop.start] for drop in used])
    true = recorded.t[np.flatnonzero(np.diff(recorded.drop, prepend=-1) > 0)]
    assert len(starts) == len(true) == 10
    np.testing.assert_allclose(starts, true, atol=0.03)  # where samples are lost at the release
    for drop, begin in zip(used, true):
        number = recorded.drop[np.flatnonzero(recorded.t == begin)[0]]
        last = recorded.t[recorded.drop == number][-1]
        assert t[drop.stop - 1] < last + 0.15  # the hand comes 0.3 s later


def parabola(t: np.ndarray, height: float, speed: float = 0.0) -> np.ndarray:
    return np.stack([0.3 * t, np.zeros_like(t), height + speed * t - G * t**2 / 2], axis=1)


def still(p: np.ndarray, n: int) -> np.ndarray:
    return np.repeat(p[None], n, axis=0)


def test_a_body_that_is_caught_is_left_out_and_one_that_bounces_first_is_cut_short():
    """Falls of 0.2 s: into a hand at 0.5 m, and onto the surface, from where it flies into the hand."""
    t = np.arange(50) / 250.0
    caught = parabola(t, 0.7)
    lands = parabola(t, G * t[-1] ** 2 / 2)
    up = parabola(t, 0.0, 1.5) + [lands[-1, 0], 0.0, lands[-1, 2]]
    hold = 100
    parts = [still(caught[0], hold), caught, still(caught[-1], hold), still(lands[0], hold), lands, up[1:]]
    path = np.concatenate([*parts, still(up[-1], hold)])
    path = path + 1e-4 * np.random.default_rng(0).standard_normal(path.shape)
    clock = np.arange(len(path)) / 250.0
    track = follow(clock, path, G)
    found = cut_drops(track, path[:, 2], find_flights(track, -G * UP["z"]), 0.035)
    assert [drop.left_out for drop in found] == [IN_THE_AIR, ""]
    (drop,) = found[1:]
    assert len(drop.flights) == 2 and not drop.lands
    assert clock[drop.stop - 1] == pytest.approx(clock[-hold - 1], abs=0.012)


def test_nothing_falls_in_a_hand():
    rng = np.random.default_rng(1)
    t = np.arange(5000) / 250.0
    waving = np.stack([0.2 * np.sin(w * t + p) for w, p in zip((3.0, 4.1, 5.3), rng.uniform(0, 6, 3))], axis=1)
    track = follow(t, waving + 2e-4 * rng.standard_normal(waving.shape), G)
    assert find_flights(track, -G * UP["z"]) == []


def test_flights_go_on_where_samples_are_lost_or_off():
    t = np.arange(100) / 250.0
    path = parabola(t, 1.0) + 1e-4 * np.random.default_rng(2).standard_normal((100, 3))
    path[50] += [0.0, 0.05, 0.0]
    kept = np.r_[0:30, 37:100]
    track = follow(t[kept], path[kept], G)
    (flight,) = find_flights(track, -G * UP["z"])
    assert flight.stop - flight.start > 0.9 * len(kept)


def test_drops_are_judged_by_the_energy_out_of_the_plane():
    flights = (slice(0, 10), slice(10, 20))
    drops = [Drop(0, 0, 20, flights), Drop(1, 20, 40, (slice(20, 30), slice(30, 40)), lands=False)]
    out, total = np.zeros(40), np.ones(40)
    out[10:20], out[20:40], out[5] = 0.06, 0.01, np.nan
    judged, table = impact_shares(drops, np.arange(40.0), out, total, 0.05)
    assert [drop.left_out for drop in judged] == [SPATIAL, ""]
    assert table["trial"].tolist() == [0, 0, 1]  # the second drop was caught after its one impact
    np.testing.assert_allclose(table["energy_out_before"], [0.0, 0.06, 0.01])
    np.testing.assert_allclose(table["energy_out_after"], [0.06, np.nan, 0.01])


def test_the_picture_has_a_row_for_each_drop():
    drops = (Drop(0, 0, 30, (slice(0, 20),)), Drop(1, 50, 90, (slice(50, 60),), False, IN_THE_AIR))
    t = np.arange(100.0)
    figure, table = draw_cuts(Cuts(t, np.sin(t), drops, impact_shares(drops, t, t, t, 2.0)[1]))
    assert table["start"].tolist() == [0.0, 50.0] and table["left_out"].tolist() == ["", IN_THE_AIR]
    assert len(figure.axes) == 3  # strips of 40 s


def test_a_body_is_made_of_its_markers():
    recorded = take(2, noise=0.0)
    places = np.array([[0.03, 0.01, 0.0], [-0.02, 0.025, 0.0], [-0.01, -0.03, 0.0], [0.02, -0.02, 0.01]])
    markers = recorded.position[:, None] + np.stack([recorded.rotation.apply(p) for p in places], axis=1)
    markers[0, 1] = np.nan  # the first whole frame is the second
    markers[100:200, 2] = np.nan
    markers[300:310, :2] = np.nan
    markers[400, 0] += 0.05  # a marker taken for another
    position, quaternion, odd = body_of_markers(markers)
    assert odd == 1
    assert np.flatnonzero(np.isnan(position[:, 0])).tolist() == [*range(300, 310), 400]
    good = np.isfinite(position[:, 0])
    expected = recorded.position + recorded.rotation.apply(places.mean(axis=0))
    np.testing.assert_allclose(position[good], expected[good], atol=1e-9)
    turned = (recorded.rotation * recorded.rotation[1].inv()).as_quat()
    np.testing.assert_allclose(np.abs(np.sum(turned * quaternion, axis=1))[good], 1.0, atol=1e-9)
    for wrong, words in ((markers[:, :2], "2 markers"), (np.full((5, 3, 3), np.nan), "no frame shows all")):
        with pytest.raises(ValueError, match=words):
            body_of_markers(wrong)
    line = np.linspace(0.0, 1.0, 4)[:, None] * np.array([1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="on a line"):
        body_of_markers(np.repeat(line[None], 3, axis=0))


@pytest.mark.parametrize(("rises", "tosses"), [(0.002, 1), (0.2, 2)])
def test_a_body_that_rocks_goes_on_and_one_that_is_lifted_is_a_new_drop(rises, tosses):
    """A fall onto the surface, 0.24 s in which the body moves along or is lifted, and another flight, of 0.2 s."""
    t, low = np.arange(50) / 250.0, np.arange(60) / 240.0
    lands = parabola(t, G * t[-1] ** 2 / 2)
    rocks = np.stack([0.06 + 0.1 * low, 0.0 * low, rises * low / low[-1]], axis=1)
    hops = parabola(t, rises, 1.0) + [rocks[-1, 0], 0.0, 0.0]
    path = np.concatenate([still(lands[0], 100), lands, rocks, hops, still(hops[-1], 100)])
    path = path + 1e-4 * np.random.default_rng(0).standard_normal(path.shape)
    track = follow(np.arange(len(path)) / 250.0, path, G)
    flights = find_flights(track, -G * UP["z"])
    assert len(flights) == 2
    assert len(cut_drops(track, path[:, 2], flights, 0.035)) == tosses
