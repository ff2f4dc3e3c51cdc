"""`datasets init` keeps a motion in space if the shape is one of space: units, up, order of quaternions, cutting."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from folders_in_space import header, mesh
from scipy.spatial.transform import Rotation
from tossed import flights

from tests.tosses import simulate_tosses
from thesis_lib.commands.datasets import main
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.sources.logs import convert
from thesis_lib.datasets.sources.tables.options import Reading
from thesis_lib.datasets.sources.tables.pose import read_quaternion_tables
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, parse_shape
from thesis_lib.datasets.space.flights import too_slow
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.foundation.errors import UserError

Q = ["qw", "qx", "qy", "qz"]
SHAPE = ["--shape", "box:0.1,0.08,0.06"]
XYZW = ["--quaternion", "xyzw", *SHAPE]
NAMED = ["--quaternion", "wxyz", "--columns", "q1=qw,q2=qx,q3=qy,q4=qz", *SHAPE]


def init(tmp_path, frame, *options: str) -> tuple[int, object]:
    frame.to_csv(tmp_path / "log.csv", index=False)
    code = main(["init", str(tmp_path / "log.csv"), "-o", str(tmp_path / "made"), *options])
    return code, read_dataset(tmp_path / "made") if code == 0 else None


@pytest.mark.slow
def test_tosses_stay_in_space(tmp_path, capsys):
    frame = flights(trials=12)
    code, made = init(tmp_path, frame, *NAMED, "--mass", "0.25")
    assert code == 0 and made.warnings == () and made.header.body.mass == 0.25
    assert made.header.body.homogeneous and made.shape.half_extents == (0.05, 0.04, 0.03)
    np.testing.assert_allclose(made.trajectories[["t", "x", "y", "z"]], frame[["t", "x", "y", "z"]], atol=1e-12)
    dots = np.sum(made.trajectories[Q].to_numpy() * frame[Q].to_numpy(), axis=1)
    np.testing.assert_allclose(np.abs(dots), 1.0, atol=1e-12)
    assert "the tracked frame is assumed to be the frame of the shape" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("form", ["rows", "blocks", "before", "behind"])
def test_of_several_bodies_in_a_table_one_is_named(tmp_path, capsys, form):
    frame, options = flights(trials=12), ["--quaternion", "wxyz", *SHAPE, "--force"]
    still = frame.assign(x=0.5, y=0.2, z=0.1, qw=1.0, qx=0.0, qy=0.0, qz=0.0)
    pose = ["x", "y", "z", *Q]
    if form in ("rows", "blocks"):
        log = pd.concat([frame.assign(name="brick"), still.assign(name="table")])
        log = log.sort_values(["trial", "t"], kind="stable") if form == "rows" else log
    else:
        parts = [(frame, "brick"), (still, "table")]
        names = [[f"{name}_{c}" if form == "before" else f"{c}.{name}" for c in pose] for _, name in parts]
        poses = [p[pose].set_axis(n, axis=1) for (p, _), n in zip(parts, names)]
        log = pd.concat([frame[["trial", "t"]], *poses], axis=1)
    assert init(tmp_path, log, *options)[0] == 2
    said = capsys.readouterr().err
    assert "brick, table" in said and "choose one with --body NAME" in said.replace("Choose", "choose")
    assert ("--columns trial=name" in said) == (form == "blocks")
    assert init(tmp_path, log, *options, "--body", "cup")[0] == 2 and "It has: brick, table" in capsys.readouterr().err
    code, made = init(tmp_path, log, *options, "--body", "brick")
    assert code == 0
    np.testing.assert_allclose(made.trajectories[["t", "x", "y", "z"]], frame[["t", "x", "y", "z"]], atol=1e-12)


def test_numbers_that_take_turns_at_equal_times_name_bodies_and_numbers_of_trials_do_not(tmp_path):
    """Tags on a cube: each picture shows some of them; runs: blocks of rows, with a clock each or one for all."""

    def read(log: pd.DataFrame, body: str | None = None) -> Motion:
        log.to_csv(tmp_path / "log.csv", index=False)
        return read_quaternion_tables([tmp_path / "log.csv"], Reading(quaternion="wxyz", body=body), [], [])[0]

    frame = flights(trials=1, frames=40).drop(columns="trial")
    seen = {tag: np.random.default_rng(tag).random(len(frame)) < 0.7 for tag in (3, 0, 13)}
    log = pd.concat([frame[rows].assign(tag_id=tag, x=frame["x"] + tag) for tag, rows in seen.items()])
    log = log.sort_values("t", kind="stable")
    for body, said in (
        (None, r"has 3 bodies \(column tag_id\): .*13.* Choose one with --body"),
        ("1", "has no body '1'"),
    ):
        with pytest.raises(UserError, match=said):
            read(log, body)
    for tag, rows in seen.items():
        np.testing.assert_allclose(read(log, str(tag)).position[:, 0], frame["x"][rows] + tag)
    one = frame.iloc[:20].assign(run=0)
    for start in (0.0, one["t"].iloc[-1]):  # the second run begins at the stamp at which the first ends
        assert len(read(pd.concat([one, one.assign(run=1, t=one["t"] + start)]))) == 40


@pytest.mark.slow
def test_units_and_the_axis_that_is_up_are_found_or_given(tmp_path, capsys):
    frame = flights(trials=12)
    log = frame.assign(x=1e3 * frame["y"], y=1e3 * frame["z"], z=1e3 * frame["x"])
    log[Q] = frame[["qw", "qy", "qz", "qx"]]  # axes renamed x y z -> z x y
    code, made = init(tmp_path, log, *XYZW, "--units", "mm")
    assert code == 0 and "note: up is (" in capsys.readouterr().out
    np.testing.assert_allclose(made.header.gravity, [0.0, -9.81, 0.0], atol=0.2)
    code, made = init(tmp_path, log, *XYZW, "--units", "mm", "--up", "y", "--force")
    assert made.header.gravity == (0.0, -9.81, 0.0) and made.header.planes[0][1].tolist() == [0.0, 1.0, 0.0]
    assert init(tmp_path, log, *XYZW, "--units", "mm", "--up", "x", "--force")[0] == 2
    assert "free flights with --up y" in capsys.readouterr().err


def test_a_given_tracked_frame_hits_and_rests_on_a_table_at_any_height(tmp_path):
    surface = {"point": [0.0, 0.0, 0.73], "normal": [0.0, 0.0, 1.0]}
    simulate_tosses(header(surface=surface), 6, np.random.default_rng(0)).trajectories.to_csv(tmp_path / "hits.csv")
    flights().to_csv(tmp_path / "flights.csv")
    columns = {f"q{i + 1}": (name, 1.0) for i, name in enumerate(Q)}
    reading, rig = Reading(columns=columns, quaternion="wxyz", tracked="shape"), RigOptions(parse_shape(SHAPE[1]))
    made = convert([tmp_path / "hits.csv"], "made", rig, reading)
    assert made.dataset.in_space.planes[0][0] == pytest.approx([0.0, 0.0, 0.73], abs=2e-3)
    assert re.match(r"the surface is at 0\.7\d+ m along up, where the .* at \d+ hits and 0 rests", made.notes[-1])
    given = convert([tmp_path / "hits.csv"], "made", replace(rig, surface_height=0.7), reading)
    assert given.dataset.in_space.planes[0][0].tolist() == [0.0, 0.0, 0.7]
    airborne = convert([tmp_path / "flights.csv"], "made", rig, reading)
    assert airborne.notes[-1].startswith("the surface is assumed at height 0 along up: no hit and no rest follows")


def test_a_given_up_that_is_off_the_fall_is_named_with_the_measured_one(tmp_path):
    flights(trials=12).to_csv(tmp_path / "log.csv")
    columns = {f"q{i + 1}": (name, 1.0) for i, name in enumerate(Q)}
    reading = Reading(columns=columns, quaternion="wxyz", tracked="shape", up="0,0.26,0.966")
    (said,) = convert([tmp_path / "log.csv"], "made", RigOptions(parse_shape(SHAPE[1])), reading).warnings
    assert re.match(r"\d+ free flights fall 1[45]\.\d° off the direction opposite --up, .* give --up=", said)
    up = said.split("--up=")[1]
    np.testing.assert_allclose([float(part) for part in up.split(",")], [0.0, 0.0, 1.0], atol=0.01)
    level = convert([tmp_path / "log.csv"], "made", RigOptions(parse_shape(SHAPE[1])), replace(reading, up=up))
    assert level.warnings == []


def test_one_fall_among_many_trials_does_not_say_where_up_is(tmp_path, capsys):
    frame = flights(trials=12)
    still = frame["trial"] > 0
    frame.loc[still, ["x", "y", "z"]] = 2e-4 * np.random.default_rng(0).standard_normal((int(still.sum()), 3))
    log = frame.rename(columns={"x": "y", "y": "z", "z": "x"})
    assert init(tmp_path, log, *XYZW)[0] == 2
    assert "there is 1 free flight with --up x" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ((), "times look like ms (240 Hz, not 0.24 Hz) and the lengths look like mm: then there are 12 free flights."),
        (("--units", "mm"), "times look like ms (240 Hz, not 0.24 Hz): then there are 12 free flights."),
        (("--units", "mm,us"), "times look like ms (240 Hz, not 2.4e+05 Hz): then"),
        (("--units", "cm,ms"), "the lengths look like mm: then there are 12 free flights."),
        (("--units", "ms"), "the lengths look like mm: then there are 12 free flights."),
    ],
)
def test_wrong_units_are_named_with_the_option(tmp_path, capsys, units, said):
    log = flights(trials=12, spin=2.0)
    log[["t", "x", "y", "z"]] *= 1e3
    assert init(tmp_path, log, *NAMED, *units)[0] == 2
    error = capsys.readouterr().err
    assert said in error and "Give --units mm,ms.\n" in error, error


def test_inches_and_slow_clocks_are_named(tmp_path, capsys):
    frame = flights(trials=12, spin=2.0)
    log = frame.assign(t=1e3 * frame["t"])
    log[["x", "y", "z"]] /= 0.0254
    assert init(tmp_path, log, *NAMED, "--units", "ms")[0] == 2
    assert "look like inches: then there are 12 free flights. Give --units ms and --scale 39.3701." in (
        capsys.readouterr().err
    )
    assert init(tmp_path, log.assign(x=0.0, y=0.0, z=0.0), *NAMED)[0] == 2  # nothing falls in any unit
    assert "the times look like ms (240 Hz, not 0.24 Hz). Give --units ms." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("names", "trials"),
    [([1, 2, 3], [1, 2, 3]), ([12, 7, 9], [12, 7, 9]), (["a", "b", "c"], [0, 1, 2]), ([-1, 0, 1], [0, 1, 2])],
)
def test_trials_keep_their_numbers_and_quaternions_may_be_named_by_part(tmp_path, names, trials):
    frame = flights(trials=3, spin=2.0)
    log = frame.assign(trial=np.array(names)[frame["trial"]])
    log.rename(columns={"qx": "i", "qy": "j", "qz": "k", "qw": "r"}).to_csv(tmp_path / "log.csv", index=False)
    columns = {name: (name.translate(str.maketrans("xyzw", "ijkr"))[1:], 1.0) for name in Q}
    reading = Reading(columns=columns, quaternion="xyzw", tracked="shape")
    made = convert([tmp_path / "log.csv"], "made", RigOptions(parse_shape(SHAPE[1])), reading)
    poses = made.dataset.trajectories
    assert poses["trial"].unique().tolist() == trials
    np.testing.assert_allclose(np.abs(np.sum(poses[Q].to_numpy() * frame[Q].to_numpy(), axis=1)), 1.0, atol=1e-12)
    said = f"trials numbered in order of appearance: 0 = {names[0]}, …, 2 = {names[2]}"
    assert (said in made.notes) == (trials != names)


def test_a_part_of_the_quaternion_is_named_once(tmp_path, capsys):
    assert init(tmp_path, flights(), "--columns", "q1=qx,qx=qx", *XYZW)[0] == 2
    assert "with --quaternion xyzw, q1 is qx; give one of them" in capsys.readouterr().err


def test_another_order_of_the_quaternion_is_refused_with_the_option(tmp_path, capsys):
    code, _ = init(tmp_path, flights(trials=20), "--quaternion", "wxyz", "--columns", "q1=qx,q2=qy,q3=qz,q4=qw", *SHAPE)
    assert code == 2 and "It does with --quaternion xyzw" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("lost", [np.nan, 0.0])
@pytest.mark.parametrize("cut", [False, True])
def test_where_the_orientation_is_lost_the_position_stays(tmp_path, capsys, lost, cut):
    frame = flights(trials=12, frames=100)
    frame = frame[frame["z"] > 0.03].reset_index(drop=True)
    rows = np.random.default_rng(1).random(len(frame)) < 0.1
    frame.loc[rows, Q] = lost
    gone = frame.index[frame["trial"] == 3][20:24]
    frame.loc[gone, [*Q, "x", "y", "z"]] = lost  # the body itself
    log = frame.assign(t=frame["t"] + 2.0 * frame["trial"]).drop(columns="trial") if cut else frame
    code, made = init(tmp_path, log, *NAMED)
    assert code == 0 and f"{rows.sum() - rows[gone].sum()} of {len(frame)} samples have a position but no" in (
        capsys.readouterr().out
    )
    found, known = made.trajectories, frame.drop(index=gone)
    if not cut:
        np.testing.assert_allclose(found[["trial", "t", "x", "y", "z"]], known[["trial", "t", "x", "y", "z"]])
        assert (found["qw"].isna().to_numpy() == rows[known.index]).all()
    assert 0.07 < found["qw"].isna().mean() < 0.13 and np.isfinite(found[["x", "y", "z"]]).to_numpy().all()


def test_rows_without_an_orientation_count_for_the_rate(tmp_path):
    """Every second orientation is lost; the check compares the rate with the times of all rows."""
    frame = flights(trials=12, frames=100)
    frame.loc[::2, Q] = np.nan
    code, made = init(tmp_path, frame, *NAMED)
    assert code == 0 and made.rate == pytest.approx(1.0 / np.diff(frame["t"][:2])[0])


@pytest.mark.parametrize(("order", "mirror", "option"), [("xyzw", 1.0, "wxyz"), ("wxyz", -1.0, "--left-handed")])
def test_a_wrong_reading_is_refused_whatever_point_is_tracked(tmp_path, capsys, order, mirror, option):
    frame = flights(trials=20)
    turn = Rotation.from_quat(frame[Q].to_numpy(), scalar_first=True)
    frame[["x", "y", "z"]] += turn.apply([0.04, 0.01, 0.0])
    frame[Q[1:]] *= mirror
    columns = ("--columns", "q1=qw,q2=qx,q3=qy,q4=qz")
    code, _ = init(tmp_path, frame, "--quaternion", order, *columns, *SHAPE)
    assert code == 2 and f"does not fall as a free body does. It does with --{option.lstrip('-')}" in (
        capsys.readouterr().err.replace("--quaternion ", "--")
    )


@pytest.mark.parametrize(
    ("shape", "options", "message"),
    [
        ("box:0.1,0.08", (), "--shape: 'box:0.1,0.08' is not a shape"),
        ("cube:0.1", (), "box:X,Y,Z"),
        (
            "box:100,80,60",
            (),
            "error: --shape: the box reaches 70.7 m from its centre: millimetres? --shape of the init",
        ),
        (
            "box:0.1,0.08,0.06",
            ("--surface-height", "50"),
            "the surface (--surface-height): the point is more than 40 m",
        ),
        ("box:0.1,0.08,0.06", ("--plane", "x"), "--plane is for planar shapes"),
        ("box:0.1,0.08,0.06", ("--k-g", "0.03"), "--k-g is for planar shapes"),
        ("mesh:missing.obj,0.001", (), "does not exist"),
    ],
)
def test_options_that_do_not_fit(tmp_path, capsys, shape, options, message):
    code, _ = init(tmp_path, flights(), "--quaternion", "xyzw", "--shape", shape, *options)
    assert code == 2
    assert message in capsys.readouterr().err


def test_a_planar_table_has_no_body_in_space(tmp_path, capsys):
    frame = flights().drop(columns=[*Q, "y"]).rename(columns={"z": "y"}).assign(theta=0.0)
    assert init(tmp_path, frame, *SHAPE)[0] == 2
    said = capsys.readouterr().err
    assert "a box is a body in space" in said and "give --quaternion xyzw or wxyz, and name its columns" in said


@pytest.mark.slow
def test_a_ball_and_a_mesh(tmp_path):
    frame = flights(trials=12)
    code, ball = init(tmp_path, frame.drop(columns=Q), "--shape", "sphere:0.03")
    assert code == 0 and not ball.has_angle
    (tmp_path / "body.stl").write_bytes(mesh((50.0, 40.0, 30.0), "stl"))
    shape = f"mesh:{tmp_path / 'body.stl'},0.001"
    code, made = init(tmp_path, frame, "--quaternion", "xyzw", "--force", "--shape", shape)
    assert code == 0 and made.shape.extent == pytest.approx(np.sqrt(0.005), rel=1e-6)
    assert (tmp_path / "made" / "body.stl").exists()


@pytest.mark.slow
def test_an_open_mesh_needs_what_is_believed_of_its_mass(tmp_path, capsys):
    frame = flights(trials=12)
    (tmp_path / "open.obj").write_bytes(mesh((50.0, 40.0, 30.0), closed=False))
    options = ["--quaternion", "xyzw", "--shape", f"mesh:{tmp_path / 'open.obj'},0.001"]
    assert init(tmp_path, frame, *options)[0] == 2
    assert "error: --shape: the mesh is not closed, so that it has neither volume nor inertia. Repair the mesh" in (
        capsys.readouterr().err
    )
    believed = ["--radii-of-gyration", "0.03,0.03,0.035", "--center-of-mass", "-0.0,0,0.001"]
    code, made = init(tmp_path, frame, *options, *believed)
    assert code == 0 and made.header.body.radii_of_gyration == (0.03, 0.03, 0.035)
    assert made.header.body.center_of_mass == (0.0, 0.0, 0.001)
    assert init(tmp_path, frame, "--force", "--shape", "disk:0.1", *believed)[0] == 2
    assert "--radii-of-gyration is for shapes in space" in capsys.readouterr().err
    assert init(tmp_path, frame, "--force", *options, "--radii-of-gyration", "1,2")[0] == 2
    assert "error: --radii-of-gyration: '1,2' is not X,Y,Z in m." in capsys.readouterr().err


def test_what_is_too_slow_for_flights_is_refused_with_that_reason(tmp_path, capsys):
    slow, options = flights(trials=12).iloc[::8], [*XYZW, "--tracked", "shape", "--force"]
    assert init(tmp_path, slow, *options, "--up", "-x")[0] == 2
    said = capsys.readouterr().err
    assert "At 30 Hz a flight has few samples, and two hits often lie within one step (33 ms)" in said
    assert "fall freely for 8 frames (0.27 s) or more are read at this rate, too: critique then shows gravity" in said
    assert too_slow(60.0) == ""
    # heights that were smoothed fall slower than anything that is let go
    z = slow.groupby("trial")["z"].transform(lambda z: z.rolling(9, center=True, min_periods=1).mean())
    for table, is_smoothed in ((slow, False), (slow.assign(z=z), True)):
        assert init(tmp_path, table, *options, "--up", "x")[0] == 2
        said = capsys.readouterr().err
        assert ("the positions were smoothed" in said) == is_smoothed, said


@pytest.mark.slow
def test_one_long_recording_is_cut_into_tosses(tmp_path):
    """Each toss is followed by a pause at rest on the table, after which the next one begins."""
    parts, start = [], 0.0
    for _, toss in flights(trials=12, frames=100).groupby("trial"):
        fall = toss[toss["z"] > 0.03]
        rest = fall.iloc[[-1]].iloc[np.zeros(60, int)].assign(t=fall["t"].max() + np.arange(1, 61) / 240.0)
        for part in (fall, rest):
            parts.append(part.assign(t=part["t"] + start))
        start += float(rest["t"].max()) + 1 / 240.0
    log = pd.concat(parts).drop(columns="trial")
    log["t"] += 2000.0
    log["t"] = log["t"].map("{:.7g}".format)  # to milliseconds
    code, made = init(tmp_path, log, *XYZW)
    assert code == 0 and len(made.trials) == 12
    assert abs(made.rate - 240.0) < 0.2
