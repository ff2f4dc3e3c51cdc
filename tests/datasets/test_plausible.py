"""Units and signs: wrong ones are named, right ones pass.  Both sides are tested on the measured sets."""

import numpy as np
import pandas as pd
import pytest
from folders import DISK, bouncing_disk, header, impacts, only, refusal, trajectories, write

from tests.datasets.bouncing import ellipse_header, fly
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import V_POST, V_PRE
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.datasets.impacts.detect import find_impacts

DEG = 180.0 / np.pi


def rewritten(dataset, tmp_path, **changes) -> str:
    """Folder of the dataset with changed tables."""
    parts = {"trajectories": dataset.trajectories, "impacts": dataset.impacts} | changes
    return write_dataset(Dataset(dataset.name, dataset.header, **parts), tmp_path / "changed")


@pytest.fixture(scope="module")
def dice(planar_dice_dir):
    return read_dataset(planar_dice_dir)


@pytest.fixture(scope="module")
def ellipse(planar_impact_dir):
    return read_dataset(planar_impact_dir)


def test_measured_sets_pass_without_warnings(dice, ellipse):
    assert dice.warnings == ellipse.warnings == ()
    assert np.abs(dice.trajectories["theta"]).max() > 2.0 * np.pi


def test_every_single_throw_passes(dice, tmp_path):
    """Small datasets are where a median misleads."""
    for number in range(1, 501, 10):
        part = dice.trajectories[dice.trajectories["trial"] == number]
        assert read_dataset(rewritten(dice, tmp_path, trajectories=part)).warnings == ()


def test_dice_in_wrapped_degrees(dice, tmp_path):
    wrapped = dice.trajectories.assign(theta=(dice.trajectories["theta"] * DEG + 180.0) % 360.0 - 180.0)
    assert "looks like degrees" in refusal(rewritten(dice, tmp_path, trajectories=wrapped))


def test_few_throws_in_degrees(dice, tmp_path):
    caught = 0
    for number in range(1, 501, 25):
        part = dice.trajectories[dice.trajectories["trial"].between(number, number + 4)]
        folder = rewritten(dice, tmp_path, trajectories=part.assign(theta=part["theta"] * DEG))
        caught += "looks like degrees" in refusal(folder)
    assert caught == 20


@pytest.mark.parametrize(
    ("columns", "factor", "message"),
    [
        (("x", "y"), 1000.0, "column x: looks like millimetres or centimetres"),
        (("x", "y"), 1000.0, "column y: looks like millimetres or centimetres"),
        (("y",), 1000.0, "column y: looks like millimetres"),
        (("x", "y"), 100.0, "bodies fall at 96 times gravity"),
        (("y",), -1.0, "y must point up"),
        (("theta",), DEG, "looks like degrees"),
    ],
)
def test_dice_in_wrong_units(dice, tmp_path, columns, factor, message):
    poses = dice.trajectories.assign(**{name: dice.trajectories[name] * factor for name in columns})
    assert message in refusal(rewritten(dice, tmp_path, trajectories=poses))


@pytest.mark.parametrize(
    ("columns", "factor", "message"),
    [
        (("theta",), DEG, "column theta: looks like degrees"),
        (("theta",), 1.0 / DEG, "column theta: looks like radians that were read as degrees: at 1718 impacts"),
        (("omega_pre", "omega_post"), DEG, "look like degrees per second"),
        (("x", "y"), 1000.0, "columns x, y: looks like millimetres"),
        (("r_x", "r_y"), 1000.0, "columns r_x, r_y: look like millimetres"),
        (("vx_pre", "vy_pre", "vx_post", "vy_post"), 1000.0, "looks like mm/s or cm/s"),
        (("y",), -1.0, "y must point up"),
    ],
)
def test_impacts_in_wrong_units(ellipse, tmp_path, columns, factor, message):
    table = ellipse.impacts.assign(**{name: ellipse.impacts[name] * factor for name in columns})
    assert message in refusal(rewritten(ellipse, tmp_path, impacts=table))


def test_radians_that_were_read_as_degrees_are_named(tmp_path):
    head = ellipse_header().model_dump(mode="json", by_alias=True, exclude_none=True)
    flown = fly(ellipse_header(), np.random.default_rng(5), 30)
    hits = pd.DataFrame(
        np.hstack([flown.hit_q, flown.hit_pre, flown.hit_post]), columns=["x", "y", "theta", *V_PRE, *V_POST]
    )
    hits = hits.assign(trial=np.arange(len(hits)), impact=0)
    for name, factor in (("right", 1.0), ("wrong", 1.0 / DEG)):
        tables = {"trajectories": flown.table, "impacts": hits}
        tables = {key: table.assign(theta=factor * table["theta"]) for key, table in tables.items()}
        both = [write(tmp_path / f"{name} {key}", head, **{key: table}) for key, table in tables.items()]
        if name == "right":
            assert all(len(find_impacts(read_dataset(folder)).impacts) for folder in both)
            continue
        for read, folder in zip((lambda folder: find_impacts(read_dataset(folder)), read_dataset), both):
            assert "column theta: looks like radians that were read as degrees" in refusal(folder, read)


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize(("name", "factor"), [("x", 1e-3), ("y", 1e-3), ("x", 1e3)])
def test_a_column_in_another_unit_is_named_also_of_straight_drops(tmp_path, name, factor, straight):
    frame, rng = bouncing_disk(position=1e-4), np.random.default_rng(3)
    if straight:
        frame["x"] = 1e-3 * np.sin(frame["trial"]) + rng.normal(0.0, 1e-4, len(frame))
    assert read_dataset(disk(tmp_path / "right", frame)).warnings == ()
    text = only(disk(tmp_path / "wrong", frame.assign(**{name: factor * frame[name]})))
    fast = factor > 1.0 and not straight
    assert f"column {name}: {'looks like millimetres' if fast else 'is not in the unit of the others'}" in text


def test_x_of_an_encoder_is_in_m(tmp_path):
    """It is thirty times as good as the camera, or exact."""
    frame, rng = bouncing_disk(), np.random.default_rng(3)
    for number, noise in enumerate((7e-6, 0.0)):
        x = 0.05 * frame["t"] + noise * rng.normal(size=len(frame))
        assert read_dataset(disk(tmp_path / f"{number}", frame.assign(x=x))).warnings == ()


def test_impacts_in_degrees_without_contact_points(ellipse, tmp_path):
    table = ellipse.impacts.drop(columns=["r_x", "r_y"])
    assert read_dataset(rewritten(ellipse, tmp_path / "a", impacts=table)).warnings == ()
    both = table.assign(**{name: table[name] * DEG for name in ("theta", "omega_pre", "omega_post")})
    assert "look like degrees per second" in refusal(rewritten(ellipse, tmp_path / "b", impacts=both))


def test_wrong_signs_are_warnings(tmp_path):
    frame = impacts()
    rising = frame.assign(vy_pre=-frame["vy_pre"])
    texts = "\n".join(map(str, read_dataset(write(tmp_path / "a", impacts=rising)).warnings))
    assert "the contact point does not approach the surface before the impact" in texts
    assert read_dataset(write(tmp_path / "b", impacts=frame)).warnings == ()


def test_exchanged_pre_and_post_are_named(ellipse, tmp_path):
    names = ("vx", "vy", "omega")
    swap = {f"{n}_{a}": f"{n}_{b}" for n in names for a, b in (("pre", "post"), ("post", "pre"))}
    swapped = ellipse.impacts.rename(columns=swap)[list(ellipse.impacts.columns)]
    assert "_pre and _post are exchanged" in refusal(rewritten(ellipse, tmp_path, impacts=swapped))


def test_impacts_that_contradict_the_shape_are_told_by_the_shape(ellipse, tmp_path):
    body = {"kind": "ellipse", "semi_axes": [0.35, 0.25]}
    head = ellipse.header.model_dump(by_alias=True) | {"schema": 1}
    head["body"] = head["body"] | {"shape": body, "radius_of_gyration": 0.192}
    text = only(write(tmp_path, head, impacts=ellipse.impacts))
    assert "times too large" in text and "degrees" not in text


@pytest.mark.parametrize("change", ["moon", "slow", "small"])
def test_bodies_that_do_not_fall_with_the_gravity_stated_are_refused(tmp_path, change):
    frame, head = bouncing_disk(), header(body=DISK, noise=None)
    if change == "moon":
        head["gravity"] = 1.62
        says = "give 9.81"
    elif change == "slow":  # a camera of 120 Hz believed to have 57.6
        frame, head["rate"] = frame.assign(t=2.083 * frame["t"]), 250.0 / 2.083
        says = "times are 2.0"
    else:
        head["gravity"] = 9.16  # the size of an effect
        assert read_dataset(write(tmp_path, head, trajectories=frame)).warnings == ()
        return
    text = only(write(tmp_path, head, trajectories=frame))
    assert "bodies fall with" in text and says in text


def test_wild_samples_are_no_degrees(tmp_path):
    frame, rng = bouncing_disk(12), np.random.default_rng(0)
    wild = rng.choice(len(frame), len(frame) // 100, replace=False)
    frame.loc[wild, "theta"] += 50.0 * rng.normal(size=len(wild))
    read_dataset(disk(tmp_path, frame))


def test_columns_of_a_motion_in_space_are_refused_as_such(tmp_path):
    frame = trajectories().assign(z=0.0, roll=0.1, note=1.0)
    text = refusal(write(tmp_path, trajectories=frame))
    assert "columns z, roll" in text and "is for planar motions" in text and "remove it" in text  # the last of `note`


def test_copies_of_trials_are_named(tmp_path):
    frame = bouncing_disk(4)
    both = pd.concat([frame, frame.assign(trial=frame["trial"] + 4)])
    text = refusal(disk(tmp_path / "a", both))
    assert "trials 0 and 4, 1 and 5, 2 and 6, 3 and 7 contain the same measurements" in text


def test_mass_in_grams_noise_in_degrees_and_a_sunken_body_are_warnings(tmp_path):
    content = header(noise={"angle": 3.0})
    content["body"] = content["body"] | {"mass": 50.0}
    frame = trajectories().assign(y=0.01)
    texts = [str(problem) for problem in read_dataset(write(tmp_path, content, trajectories=frame)).warnings]
    assert len(texts) == 3
    assert "grams?" in texts[0]
    assert "degrees?" in texts[1]
    assert "deep inside the surface in 100% of the rows" in texts[2]


@pytest.mark.parametrize("kind", ["rest", "spin", "high", "unreset"])
def test_unusual_but_right_data_pass(tmp_path, kind):
    frame = trajectories(3, 40)
    rng = np.random.default_rng(0)
    n = len(frame)
    if kind == "rest":  # a body at rest, angle noise far above position noise
        frame = frame.assign(x=rng.normal(0, 1e-5, n), y=0.03 + rng.normal(0, 1e-5, n), theta=rng.normal(0, 0.01, n))
    elif kind == "spin":  # 30 turns a second in free flight
        frame["theta"] = 190.0 * frame["t"]
    elif kind == "high":  # dropped from 3 m
        frame["y"] += 2.75
    elif kind == "unreset":  # an encoder that counts turns since it was switched on
        frame["theta"] += 400.0
    assert read_dataset(write(tmp_path, trajectories=frame)).warnings == ()


def disk(folder, frame: pd.DataFrame, rate: float = 250.0, **changes) -> str:
    return write(folder, header(body=DISK, rate=rate, noise=None) | changes, trajectories=frame)


@pytest.mark.parametrize("rate", [60.0, 250.0, 1000.0])
@pytest.mark.parametrize("trials", [1, 4])
def test_y_down_is_refused_wherever_the_surface_is(tmp_path, rate, trials):
    """The camera's origin is above the scene, so that no centre is below y = 0."""
    frame = bouncing_disk(trials, rate=rate)
    assert read_dataset(disk(tmp_path / "up", frame, rate)).warnings == ()
    text = only(disk(tmp_path / "down", frame.assign(y=0.8 - frame["y"]), rate))
    assert "column y: bodies fall towards larger y, by about gravity" in text
    assert "y must point up" in text and "surface.height" in text


def test_dice_with_y_down_are_refused_throw_by_throw(dice, tmp_path):
    for number in range(1, 501, 20):
        part = dice.trajectories[dice.trajectories["trial"] == number]
        text = refusal(rewritten(dice, tmp_path, trajectories=part.assign(y=0.4 - part["y"])))
        assert "bodies fall towards larger y" in text


@pytest.mark.parametrize("kind", ["rest", "wander", "lifted", "short"])
def test_bodies_that_do_not_fall_are_not_said_to_fall_up(tmp_path, kind):
    rng = np.random.default_rng(1)
    t = np.arange(2000) / 250.0
    noise = rng.normal(0.0, 3e-4, len(t))
    if kind == "rest":
        y = 0.03 + noise
    elif kind == "wander":  # a slow error of the tracker
        y = 0.03 + noise + np.cumsum(rng.normal(0.0, 3e-5, len(t)))
    elif kind == "lifted":  # a hand that accelerates by g for 0.1 s and lets go
        t = t[:100]
        lift = np.minimum(t, 0.1)
        y = 0.4 + 4.905 * lift**2 + (t - lift) * 0.981 - 4.905 * (t - lift) ** 2 + noise[:100]
    else:  # the shortest records, each around a weak impact: a kink and little flight
        t = np.tile(np.arange(10) / 250.0, 20)
        after = t - np.repeat(np.linspace(0.014, 0.022, 20), 10)
        y = 0.03 - 0.15 * after - 4.905 * after**2 + 0.3 * np.maximum(after, 0.0) + noise[:200]
    trial = np.repeat(np.arange(len(t) // 10), 10) if kind == "short" else 0
    frame = pd.DataFrame({"trial": trial, "t": t, "x": rng.normal(0.0, 3e-4, len(t)), "y": y, "theta": 0.1})
    assert read_dataset(disk(tmp_path, frame)).warnings == ()


def test_degrees_of_a_disk_are_doubted_by_its_spin_or_its_noise(tmp_path):
    """A disk touches the surface in the same way at every angle, so no contact gives degrees away."""

    def doubts(name: str, **how) -> str:
        frame = bouncing_disk(**how)
        if name.startswith("degrees"):
            frame = frame.assign(theta=frame["theta"] * DEG)
        return "\n".join(map(str, read_dataset(disk(tmp_path / name, frame)).warnings))

    assert doubts("radians") == ""
    assert doubts("radians, hard to track", angle=0.02) == ""
    text = doubts("degrees")
    assert "column theta: may be in degrees" in text
    assert "times faster than the centre" in text and "no change if it is in radians" in text
    still = bouncing_disk(angle=2e-3).assign(theta=lambda f: np.random.default_rng(2).normal(0.0, 2e-3, len(f)))
    assert read_dataset(disk(tmp_path / "still", still)).warnings == ()
    (warning,) = read_dataset(disk(tmp_path / "still deg", still.assign(theta=still["theta"] * DEG))).warnings
    assert "times as much as the position" in warning.what


def test_a_shape_in_millimetres_is_one_problem_and_no_angle_is_doubted(tmp_path):
    body = {"shape": {"kind": "disk", "radius": 30.0}, "radius_of_gyration": 21.0}
    text = only(disk(tmp_path / "a", bouncing_disk(), body=body))
    assert "body.shape" in text and "--shape of the init command is in m" in text
    # 5 m: no size that is refused by itself, but the body is inside the surface at any angle
    body = {"shape": {"kind": "disk", "radius": 5.0}, "radius_of_gyration": 3.5}
    (warning,) = read_dataset(disk(tmp_path / "b", bouncing_disk(), body=body)).warnings
    assert "deep inside the surface" in warning.what and "the shape (in m)" in warning.remedy
