"""Forms of motion capture beside Motive's and Vicon's: Qualisys, older OptiTrack, C3D, named bodies in bags, points."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.datasets.exports import PUBLISHED, write_bag, write_c3d, write_optitrack, write_qualisys
from tests.datasets.in_space import UP, Take, take
from tests.datasets.test_logs_in_space import init, same_drops
from thesis_lib.commands.datasets import main
from thesis_lib.datasets import find_impacts, read_dataset
from thesis_lib.datasets.sources.conversion import Conversion, View
from thesis_lib.datasets.sources.logs import convert, convert_motions
from thesis_lib.datasets.sources.motion_capture import c3d
from thesis_lib.datasets.sources.motion_capture.bags import read_bag
from thesis_lib.datasets.sources.motion_capture.c3d import read_c3d
from thesis_lib.datasets.sources.motion_capture.motive import BEGINS_OLDER, read_optitrack
from thesis_lib.datasets.sources.motion_capture.qualisys import read_qualisys
from thesis_lib.datasets.sources.tables.options import Reading, parse_columns
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, parse_shape
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.foundation.errors import UserError

DROPS = 4
DIGITS = 2e-6  # m and of quaternions: six digits are written, of a C3D file seven bits fewer than of a double
HINT = 2.0  # degrees of a square: 8 drops tell half of it, and rarely 1.5


@pytest.fixture(scope="module")
def recorded() -> Take:
    return take(DROPS)


@pytest.fixture(scope="module")
def short() -> Take:
    return take(1)


def same_motion(motion: Motion, recorded: Take, lost: float) -> None:
    """Positions and rotations as recorded, lost where they were lost."""
    gone = recorded.lose(lost)
    assert not motion.seen[gone].any() and motion.seen[~gone].all()
    np.testing.assert_allclose(motion.t[~gone], recorded.t[~gone] + motion.t[0] - recorded.t[0], atol=1e-5)
    np.testing.assert_allclose(motion.position[~gone], recorded.position[~gone], atol=DIGITS)
    q, truth = motion.quaternion[~gone], recorded.quaternion[~gone]
    np.testing.assert_allclose(np.abs(np.sum(q * truth, axis=1)), 1.0, atol=DIGITS)


@pytest.mark.parametrize(("kind", "times", "zeros"), [("6D", True, False), ("6D", False, True), ("angles", True, True)])
def test_bodies_of_qualisys(tmp_path, short, kind, times, zeros):
    """Matrices column by column, or angles; with Frame and Time or without; lost frames empty or zero."""
    path = write_qualisys(short, tmp_path / "drop.tsv", kind, times, zeros, lost=0.02)
    same_motion(read_qualisys(path, "plate", None, []), short, 0.02)


def test_accents_and_decimal_commas_of_an_export(tmp_path, short):
    path = write_qualisys(short, tmp_path / "drop.tsv", lost=0.02)
    path.write_bytes(path.read_text().replace(".", ",").replace("plate", "Würfel").encode("cp1252"))
    same_motion(read_qualisys(path, "Würfel", None, []), short, 0.02)


@pytest.mark.parametrize("first", ["frame,t,x,y,theta", "comment,t,x,y,theta", "info,t,x,y,theta"])
def test_a_table_is_no_older_export(first):
    assert not BEGINS_OLDER.match(first)


@pytest.mark.parametrize(("left", "word"), [(False, "rigidbody"), (True, "trackable")])
def test_bodies_of_older_optitrack(tmp_path, short, left, word):
    """Bodies by their ID wherever they stand in a frame; a left-handed export is the same motion."""
    path = write_optitrack(short, tmp_path / "take.csv", left, word, lost=0.02)
    same_motion(read_optitrack(path, "plate", None, []), short, 0.02)


@pytest.mark.parametrize(
    ("message", "ending", "body"),
    [
        ("NamedPoseArray", ".mcap", "plate"),
        ("RigidBodies", ".db3", "plate"),
        ("AlvarMarkers", ".bag", "7"),
        ("PoseArray", ".mcap", "0"),
    ],
)
def test_bodies_of_a_bag_by_name_or_number(tmp_path, short, message, ending, body):
    motion = read_bag(write_bag(short, tmp_path / f"drops{ending}", message), body, [])
    same_motion(motion, short, 0.0)
    assert motion.body == f"/plate:{body}"


def test_a_rotation_of_a_c3d_file(tmp_path, short):
    same_motion(read_c3d(write_c3d(short, tmp_path / "a.c3d", "rotations", "m"), "plate", []), short, 0.0)


def test_a_rotation_that_is_lost_leaves_the_place_of_a_c3d_file():
    matrices = np.tile(np.eye(4)[:, :, None], (1, 1, 3))
    matrices[:3, 3] = [[100.0], [200.0], [300.0]]
    matrices[:3, :3, 1] = 0.0
    matrices[..., 2] = 0.0
    motion = c3d._rotated(Path("a.c3d"), "plate", matrices, 1e-3, 100.0)
    assert motion.placed.tolist() == [True, True, False] and motion.seen.tolist() == [True, False, False]


def test_markers_of_a_c3d_file_and_of_qualisys_are_the_same_body(tmp_path, short):
    one = read_c3d(write_c3d(short, tmp_path / "a.c3d", lost=0.02), "plate", [])
    other = read_qualisys(write_qualisys(short, tmp_path / "a.tsv", "3D", lost=0.02), "plate", None, [])
    assert (one.seen == other.seen).all() and 0.95 < one.seen.mean() < 1.0
    np.testing.assert_allclose(one.position[one.seen], other.position[one.seen], atol=DIGITS)
    turned = np.abs(np.sum(one.quaternion[one.seen] * other.quaternion[one.seen], axis=1))
    np.testing.assert_allclose(turned, 1.0, atol=1e-6)


@pytest.mark.slow
def test_one_command_makes_drops_of_each(tmp_path, recorded):
    assert init(tmp_path, write_qualisys(recorded, tmp_path / "a.tsv", lost=0.02), "--body", "plate") == 0
    same_drops(tmp_path, recorded)
    y_up = take(DROPS, up="y")
    assert init(tmp_path, write_optitrack(y_up, tmp_path / "a.csv", lost=0.02), "--body", "plate", "--force") == 0
    same_drops(tmp_path, y_up)


def test_a_ball_is_a_point(tmp_path, recorded, capsys):
    """One marker, one topic of points, three columns: drops without theta, with the heights of the flights."""
    table = pd.DataFrame(np.c_[recorded.t, 100.0 * recorded.position], columns=["time", "X", "Y", "Z"])
    table.to_csv(tmp_path / "ball.csv", index=False)
    columns = "t=time,x=X,y=Y,z=Z"
    said = ("--units", "cm", "--up", "z", "--columns", columns, "--shape", "disk:0.035")
    assert main(["init", str(tmp_path / "ball.csv"), "-o", str(tmp_path / "out"), *said]) == 0
    assert "note: theta is not measured" in capsys.readouterr().out
    dataset = read_dataset(tmp_path / "out")
    assert not dataset.has_angle and len(dataset.trials) == DROPS
    ways: dict = {
        tmp_path / "ball.csv": {"units": "cm", "columns": parse_columns(columns)},
        write_c3d(recorded, tmp_path / "ball.c3d"): {"body": "ball"},
        write_bag(recorded, tmp_path / "ball.mcap", "PointStamped"): {},
    }
    for path, options in ways.items():
        made = convert([path], "out", RigOptions(parse_shape("disk:0.035")), Reading(**options)).dataset
        assert not made.has_angle
        pd.testing.assert_frame_equal(made.trajectories, dataset.trajectories, atol=1e-5, check_exact=False)
        with pytest.raises(UserError, match="it has no angle of the body"):
            convert([path], "out", RigOptions(parse_shape("square:0.06")), Reading(**options))
    drop = dataset.trajectories[dataset.trajectories["trial"] == 0]
    np.testing.assert_allclose(drop["y"].max(), recorded.planar[recorded.drop == 0, 1].max(), atol=1e-3)


def test_columns_of_a_quaternion_are_asked_for(tmp_path, capsys):
    names = "t,x,y,z,qx,qy,qz,qw"
    (tmp_path / "log.csv").write_text(f"{names}\n" + "0,0,0,0,0,0,0,1\n" * 3)
    assert main(["init", str(tmp_path / "log.csv"), "-o", str(tmp_path / "out"), "--shape", "disk:0.03"]) == 2
    assert "give --quaternion xyzw" in capsys.readouterr().err


def test_messages_without_a_stamp_have_the_times_of_their_pictures(tmp_path, recorded, capsys):
    """Arrival wanders by a frame and more; drops are cut and hits are found as with right stamps."""
    rig = RigOptions(parse_shape("ellipse:0.035,0.025"), k_g=0.019235)
    right = find_impacts(convert([write_bag(recorded, tmp_path / "right.mcap")], "out", rig, Reading()).dataset)
    assert init(tmp_path, write_bag(recorded, tmp_path / "a.mcap", "Pose", stamped=False, late=5e-3)) == 0
    text = capsys.readouterr().out
    assert "note: The time stamps are those of arrival" in text
    assert "warning: a.mcap: /plate has no time stamps, so its times are those of arrival" in text
    mended = read_dataset(tmp_path / "out")
    assert len(mended.trials) == DROPS
    assert abs(len(find_impacts(mended).impacts) - len(right.impacts)) <= 1
    same_drops(tmp_path, recorded)


def test_equal_times_are_put_apart_or_refused_and_repeated_rows_left_out(tmp_path, recorded):
    """Equal, not falling, times are placed as times of arrival if all are; falling ones are not."""
    falls = recorded.drop >= 0
    log = pd.DataFrame(recorded.position[falls], columns=["x", "y", "z"])
    log["t"], log["trial"] = recorded.t[falls], recorded.drop[falls]
    log["t"] += log["trial"]  # no drop begins at the end of another

    def made(t: np.ndarray, rows: np.ndarray | slice = slice(None)) -> Conversion:
        log.assign(t=t).iloc[rows].to_csv(tmp_path / "log.csv", index=False)
        return convert([tmp_path / "log.csv"], "out", RigOptions(parse_shape("disk:0.035")), Reading())

    t, n = log["t"].to_numpy(), len(log)
    right = made(t)
    late = np.random.default_rng(3).exponential(8e-4, n)
    stamps = np.round(pd.Series(t + late).groupby(log["trial"]).cummax().to_numpy(), 3)
    assert 0 < np.sum(np.diff(stamps) == 0.0) < 0.2 * n
    mended = made(stamps)
    assert any("those of arrival" in note for note in mended.notes)
    assert right.dataset.trajectories is not None and mended.dataset.trajectories is not None
    np.testing.assert_allclose(mended.dataset.trajectories["t"], right.dataset.trajectories["t"], atol=1e-3)

    twice = made(t, np.sort(np.r_[np.arange(n), 50, 50, 80]))
    assert f"3 of {n + 3} samples left out: they repeat the one before, with its time" in twice.notes
    pd.testing.assert_frame_equal(twice.dataset.trajectories, right.dataset.trajectories)

    held = np.where(np.isin(np.arange(n), [50, 80]), np.roll(t, 1), t)
    for later in (0.0, 1e-9):  # s
        with pytest.raises(UserError, match=r"log.csv, row 52, trial 0: .* or nearly, .*\(such rows: 2\)"):
            made(np.where(held == t, t, held + later))
    with pytest.raises(UserError, match=r"log.csv, row 52, trial 0: time falls after .* Sort the rows by time\."):
        made(np.where(np.arange(n) == 50, np.roll(t, 2), t))


@pytest.mark.parametrize(
    ("up", "yaw", "angle"), [("z", 35.0, 20.0), ("z", 215.0, 20.0), ("y", -63.0, -33.0), ("x", 135.0, 12.0)]
)
def test_the_frame_that_a_note_names_is_right(up, yaw, angle):
    """The shape is turned against its tracked frame: with the frame of the note it is not, and there is no note."""
    from scipy.spatial.transform import Rotation

    from tests.datasets.in_space import plane_axes

    mount = Rotation.from_rotvec([0.0, 0.0, -np.radians(angle)])
    axes = plane_axes(up, yaw, 0.0)
    recorded = take(8, shape="square", axes=axes, tilt=0.0, mount=mount)
    motion = Motion("", "log.csv", recorded.t, recorded.position, recorded.quaternion)
    rig = RigOptions(parse_shape("square:0.06"))

    def told(frame: float) -> tuple[float | None, pd.DataFrame]:
        notes: list[str] = []
        view = View(UP[up], frame=(0.0, 0.0, np.radians(frame)))
        made = convert_motions([motion], "made", ["log.csv"], rig, view, notes).dataset.trajectories
        hint = [note.split("--frame 0,0,")[1].split(")")[0] for note in notes if "--frame 0,0," in note]
        return (float(hint[0]) if hint else None), made

    hint, _ = told(0.0)
    assert hint is not None and abs(abs((hint + 45.0) % 90.0 - 45.0) - abs(angle)) < HINT
    again, made = told(hint)
    assert again is None
    first = made.groupby("trial")["theta"].first().to_numpy()
    truth = np.array([recorded.planar[recorded.drop == drop][0, 2] for drop in range(8)])
    off = [np.degrees(first - sign * truth) for sign in (1.0, -1.0)]  # seen from the one side of the plane or the other
    assert min(np.abs((turns + 45.0) % 90.0 - 45.0).max() for turns in off) < HINT


def test_what_a_c3d_file_lacks_is_said(tmp_path, short, capsys, monkeypatch):
    whole = write_c3d(short, tmp_path / "whole.c3d").read_bytes()
    damaged = {"short": whole[:-3000], "no": b"text", "blocks": b"\x02P" + bytes(range(256)) * 2}
    labels = whole.index(b"LABELS")
    damaged |= {f"labels{i}": whole[: labels + i] + b"\xff" + whole[labels + i + 1 :] for i in (-3, -2, 9)}
    for name, content in damaged.items():
        path = tmp_path / f"{name}.c3d"
        path.write_bytes(content)
        with pytest.raises(UserError, match=rf"{name}\.c3d is a C3D file .*, but cannot be read: "):
            read_c3d(path, "plate", [])
    with pytest.raises(UserError, match=r"has 2 bodies: plate, ball\. Choose one"):
        read_c3d(tmp_path / "whole.c3d", None, [])
    monkeypatch.setattr("thesis_lib.datasets.sources.motion_capture.c3d.find_spec", lambda name: None)
    assert init(tmp_path, tmp_path / "whole.c3d") == 2
    assert "pip install ezc3d" in capsys.readouterr().err


def test_markers_that_are_no_rigid_body(tmp_path, short):
    path = write_qualisys(short, tmp_path / "a.tsv", "3D")
    text = path.read_text().replace("plate:m", "ball")
    lines = text.split("\n")
    for i in range(8, len(lines) - 1):  # the first ball goes its own way
        cells = lines[i].split("\t")
        lines[i] = "\t".join([*cells[:2], f"{float(cells[2]) + i:.3f}", *cells[3:]])
    path.write_text("\n".join(lines))
    with pytest.raises(UserError, match="do not move as one rigid body"):
        read_qualisys(path, None, None, [])
    assert not read_qualisys(path, "ball1", None, []).oriented


def test_a_bag_says_which_topics_it_has(tmp_path, short, capsys):
    bag = write_bag(short, tmp_path / "a.mcap", "NamedPoseArray")
    assert init(tmp_path, bag, "--body", "cup") == 2
    error = capsys.readouterr().err
    assert "has no body 'cup'" in error and "/plate:plate, /plate:rod" in error
    assert "Its topics are: /plate (motion_capture_tracking_interfaces/msg/NamedPoseArray, " in error
    bag = write_bag(short, tmp_path / "b.mcap", "Twist")
    assert init(tmp_path, bag) == 2
    error = capsys.readouterr().err
    assert "has no messages of poses" in error and "/plate (geometry_msgs/msg/Twist, " in error


def test_a_type_of_another_content_is_refused(tmp_path, short):
    kind = "mocap4r2_msgs/msg/RigidBodies"
    other = PUBLISHED | {kind: PUBLISHED[kind].replace("uint32 frame_number", "uint64 frame_number")}
    with pytest.raises(UserError, match="whose definition is not the standard one"):
        read_bag(write_bag(short, tmp_path / "a.mcap", "RigidBodies", published=other), "plate", [])
