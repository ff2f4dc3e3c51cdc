"""Walls in place of a floor, and a body whose angle nobody measured: what is read, refused and found."""

import numpy as np
import pandas as pd
import pytest
from folders import DISK, WALLS, between_walls, bouncing_disk, header, impacts, only, sliding, trajectories, write

from thesis_lib.bodies.shapes import Disk
from thesis_lib.bodies.walls import Wall, as_filmed, in_wall_frame, struck_wall, turns
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.datasets import find_impacts, read_dataset
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.simulate.table.puck import (
    CUSHIONS,
    EPSILON,
    LENGTH,
    NOISE,
    RADIUS,
    RATE,
    WIDTH,
    believed_header,
    simulate_puck,
)

TURNED = 0.6  # rad
ASKEW = 2e-3  # m/s, one sigma of a velocity: detection sees x and y apart, so single samples change sides


def test_a_floor_is_its_own_wall_and_a_ceiling_is_a_floor_upside_down() -> None:
    q = np.array([[0.2, 0.5, 0.1]])
    walls = [
        Wall(name="floor", point=(0.0, 0.3), normal=(0.0, 2.0)),
        Wall(name="top", point=(0.1, 1.0), normal=(0, -1)),
    ]
    np.testing.assert_allclose(in_wall_frame(walls, np.array([0]), q), [[0.2, 0.2, 0.1]], atol=1e-12)
    upside_down = in_wall_frame(walls, np.array([1]), q)
    np.testing.assert_allclose(upside_down[:, :2], [[-0.1, 0.5]], atol=1e-12)
    assert np.cos(upside_down[0, 2] - 0.1) == pytest.approx(-1.0)


def test_the_frame_of_a_wall_keeps_lengths_turns_and_places() -> None:
    rng = np.random.default_rng(0)
    wall, q = rng.integers(4, size=50), rng.uniform(-0.4, 0.4, (50, 3))
    R = turns(CUSHIONS, wall)
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    np.testing.assert_allclose(as_filmed(CUSHIONS, wall, in_wall_frame(CUSHIONS, wall, q)), q[:, :2], atol=1e-12)


def test_in_a_corner_the_wall_is_told_by_the_way_in_which_the_body_is_pushed() -> None:
    corner = np.array([[0.559, 0.359, 0.0]] * 2)  # 1 mm from the north and the east cushion
    pushed = np.array([[-1.0, 0.3, 0.0], [0.2, -1.0, 0.0]])
    names = [CUSHIONS[i].name for i in struck_wall(CUSHIONS, Disk(radius=0.04), corner, pushed)]
    assert names == ["east", "north"]


def test_a_dataset_without_theta_is_read_and_written_back(tmp_path) -> None:
    dataset = read_dataset(write(tmp_path / "a", between_walls(), trajectories=sliding()))
    assert not dataset.has_angle
    assert (dataset.trajectories["theta"] == 0.0).all()
    again = read_dataset(write_dataset(dataset, tmp_path / "b", float_format=None))
    assert not again.has_angle
    assert again.header == dataset.header
    assert again.digest() == dataset.digest()


def test_theta_may_be_absent_for_a_disk_only(tmp_path) -> None:
    assert "column theta: missing" in only(write(tmp_path, header(), trajectories=trajectories().drop(columns="theta")))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"surface": {"height": 0.0}}, "surface and surfaces are both given"),
        ({"surfaces": [WALLS[0], WALLS[1] | {"name": "south"}]}, "the name south occurs more than once"),
        ({"surfaces": [WALLS[0] | {"normal": [0.0, 0.0]}]}, "the normal has no direction"),
        ({"surfaces": [WALLS[0] | {"point": [0.0, -400.0]}]}, "millimetres?"),
        ({"surfaces": [WALLS[0] | {"name": "South wall"}]}, "should match pattern"),
        ({"surfaces": [WALLS[0] | {"normals": [0.0, 1.0]}]}, "did you mean 'normal'?"),
        ({"surfaces": [WALLS[0] | {"normal": [0.0, float("nan")]}]}, "a finite number"),
        ({"surfaces": []}, "surfaces contains no wall"),
        ({"surfaces": [WALLS[0], WALLS[1] | {"normal": [0.0, 1.0]}]}, "behind the wall north in most rows"),
        ({"gravity": -9.81}, "must be 0.0 or more"),
        ({"spin": 0.0}, "above 0.0"),
    ],
)
def test_each_mistake_about_walls_is_said(tmp_path, changes: dict, said: str) -> None:
    text = only(write(tmp_path, between_walls(**changes), trajectories=sliding()))
    assert said in text, text


def test_lengths_in_millimetres_are_noticed_without_gravity_too(tmp_path) -> None:
    poses = sliding()
    folder = write(tmp_path, between_walls(), trajectories=poses.assign(x=1e3 * poses["x"]))
    assert "column x: looks like millimetres" in only(folder)


def test_impacts_cannot_be_given_for_walls(tmp_path) -> None:
    text = only(write(tmp_path, between_walls(), trajectories=sliding(), impacts=impacts()))
    assert "which wall was hit" in text


def test_old_datasets_have_the_seeds_that_they_had(tmp_path) -> None:
    # stored results hang on it: keys that a header lacks do not count
    dataset = read_dataset(write(tmp_path, header(), trajectories=trajectories()))
    assert dataset.digest() == "e5ef7a024a3fac3d7fa80e288c730834cdf24f01c02bd09d15bc24575e235d5f"


@pytest.fixture(scope="module")
def puck() -> Dataset:
    return simulate_puck("puck", "nothing", trials=25)


def test_impacts_are_found_at_the_walls_with_their_restitution(puck: Dataset) -> None:
    found = find_impacts(puck)
    hits = found.impacts
    assert len(hits) > 40
    assert set(hits.surface) == {0, 1, 2, 3}
    assert (hits.v_pre[:, 1] < 0.0).all()
    # the median over 50 impacts of a ratio known to 0.3 %
    assert np.median(-hits.v_post[:, 1] / hits.v_pre[:, 1]) == pytest.approx(EPSILON, abs=2e-3)
    # contacts of 1 ms sink in by 0.5 mm at 1 m/s
    assert np.median(np.abs(found.used_arcs["gap"])) < 1e-3
    assert any("theta is not measured" in text for text in found.warnings)


@pytest.mark.parametrize(("late", "used"), [(2e-3, 0), (60e-3, 4)])
def test_two_walls_at_once_are_no_impact_at_one_of_them(late: float, used: int) -> None:
    """A puck that runs into the corner of north and east, one of which it meets `late` s after the other."""
    rng, header = np.random.default_rng(1), believed_header()
    t = np.arange(80) / RATE
    poses = []
    for trial, v in enumerate(([1.1, 0.7], [0.7, 1.1])):
        # straight on and mirrored at each wall, with restitution
        corner = np.array([LENGTH, WIDTH]) / 2.0 - RADIUS
        since = t[:, None] - 0.3 - late * np.array([trial == 0, trial == 1])
        q = corner + np.where(since < 0.0, since, -EPSILON * since) * v + NOISE * rng.standard_normal((len(t), 2))
        poses.append(pd.DataFrame({"trial": trial, "t": t, "x": q[:, 0], "y": q[:, 1], "theta": 0.0}))
    found = find_impacts(Dataset("corner", header, pd.concat(poses, ignore_index=True), has_angle=False))
    assert len(found.impacts) == used
    if not used:
        assert (found.left_out["reason"] == "second_hit").all() and set(found.left_out["trial"]) == {0, 1}
        assert found.left_out["detail"].str.contains("another wall is").any()


def test_a_table_that_stands_askew_has_the_same_impacts(puck: Dataset) -> None:
    cos, sin = np.cos(TURNED), np.sin(TURNED)
    R, shift = np.array([[cos, -sin], [sin, cos]]), np.array([0.3, -0.2])
    walls = [
        wall.model_copy(update={"point": tuple(R @ wall.point + shift), "normal": tuple(R @ wall.normal)})
        for wall in CUSHIONS
    ]
    moved = puck.trajectories[["x", "y"]].to_numpy() @ R.T + shift
    poses = puck.trajectories.assign(x=moved[:, 0], y=moved[:, 1])
    askew = Dataset("askew", puck.header.model_copy(update={"surfaces": tuple(walls)}), poses, has_angle=False)
    straight, turned = find_impacts(puck).impacts, find_impacts(askew).impacts
    assert (straight.trial == turned.trial).all()
    assert (straight.surface == turned.surface).all()
    for name in ("v_pre", "v_post"):
        difference = np.abs(getattr(straight, name) - getattr(turned, name)).max(axis=0)
        assert difference[:2].max() < ASKEW


def test_spin_is_stated_or_follows_from_the_speed(puck: Dataset, tmp_path) -> None:
    assert 10.0 < observe(puck).spin < 30.0  # half of 1.5 m/s at 0.04 m
    stated = Dataset("p", puck.header.model_copy(update={"spin": 3.0}), puck.trajectories, has_angle=False)
    assert observe(stated).spin == 3.0


def test_a_ball_without_an_angle_bounces_on_a_floor(tmp_path) -> None:
    poses = bouncing_disk().drop(columns="theta")
    folder = write(tmp_path, header(body=DISK, noise={"position": 2e-4}), trajectories=poses)
    with_angle = write(tmp_path / "theta", header(body=DISK), trajectories=bouncing_disk())
    found, known = (find_impacts(read_dataset(each)).impacts for each in (folder, with_angle))
    assert len(found) == len(known) > 5
    np.testing.assert_allclose(found.v_post[:, :2], known.v_post[:, :2], atol=0.02)
