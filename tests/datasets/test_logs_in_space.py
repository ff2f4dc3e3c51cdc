"""`datasets init` on recordings in space: each form becomes a dataset by one command, and says what it did."""

import numpy as np
import pandas as pd
import pytest

from tests.datasets import exports
from tests.datasets.in_space import Take, take
from thesis_lib.commands.datasets import main
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.sources.logs import convert
from thesis_lib.datasets.sources.tables.options import Reading
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, parse_shape

SHAPE = ("--shape", "ellipse:0.035,0.025", "--k-g", "0.019235")
DROPS = 8
TABLE = ("--columns", "t=time,x=X,y=Y,z=Z,q1=q0,q2=q1,q3=q2,q4=q3")
SAME_POSITION = 1e-3  # m: five times the noise
SAME_ANGLE = 1.2e-2  # rad: five times the noise
SAME_TURN = 2.0  # samples: of the camera, in which a drop may begin earlier or later


@pytest.fixture(scope="module")
def recorded() -> Take:
    return take(DROPS)


@pytest.fixture(scope="module")
def recorded_y_up() -> Take:
    return take(DROPS, up="y")


def init(folder, *args: str) -> int:
    return main(["init", *map(str, args), "-o", str(folder / "out"), *SHAPE])


def same_drops(folder, recorded: Take, position: float = SAME_POSITION) -> None:
    """The dataset holds the drops that were simulated, in the plane: each sample at the pose that it had there."""
    poses = read_dataset(folder / "out").trajectories
    assert sorted(set(poses["trial"])) == list(range(int(recorded.drop.max()) + 1))
    cuts = pd.read_csv(folder / "out" / "cuts.csv").set_index("trial")
    mirror = None
    for trial, part in poses.groupby("trial"):
        # samples of the recording at the same times
        which = np.rint((part["t"].to_numpy() + cuts.loc[trial, "start"]) * 250.0).astype(int)
        truth = recorded.planar[which]
        inside = np.isfinite(truth[:, 0])
        assert inside.sum() > 0.6 * np.sum(recorded.drop == trial)
        assert abs(which[0] - np.flatnonzero(recorded.drop == trial)[0]) <= SAME_TURN
        q, truth = part[["x", "y", "theta"]].to_numpy()[inside], truth[inside]
        mirror = np.sign(np.dot(q[:, 0] - q[0, 0], truth[:, 0] - truth[0, 0])) if mirror is None else mirror
        np.testing.assert_allclose(q[:, 1], truth[:, 1], atol=position)
        np.testing.assert_allclose(mirror * (q[:, 0] - q[0, 0]), truth[:, 0] - truth[0, 0], atol=2 * position)
        turned = mirror * q[:, 2] - truth[:, 2]
        np.testing.assert_allclose(np.angle(np.exp(2j * (turned - turned[0]))) / 2, 0.0, atol=2 * SAME_ANGLE)


def test_a_table_with_quaternions(tmp_path, recorded, capsys):
    log = exports.write_table(recorded, tmp_path / "log.csv", order="wxyz", scale=1e3, lost=0.02)
    assert init(tmp_path, log, "--quaternion", "wxyz", "--units", "mm", *TABLE) == 0
    text = capsys.readouterr().out
    same_drops(tmp_path, recorded)
    assert "4.0° off the vertical; gravity in it 9.78" in text
    assert f"{DROPS} drops cut out of the recording" in text
    assert read_dataset(tmp_path / "out").gravity == pytest.approx(9.81 * np.cos(np.radians(4.0)), rel=1e-3)
    assert (tmp_path / "out" / "cuts.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("rotation", "units"),
    [
        ("Quaternion", "Millimeters"),
        pytest.param("Quaternion", "Meters", marks=pytest.mark.slow),
        pytest.param("XYZ", "Millimeters", marks=pytest.mark.slow),
        pytest.param("ZYX", "Centimeters", marks=pytest.mark.slow),
    ],
)
def test_an_export_of_motive(tmp_path, recorded_y_up, rotation, units):
    log = exports.write_motive(recorded_y_up, tmp_path / "take.csv", rotation, units, lost=0.02)
    assert init(tmp_path, log, "--body", "plate") == 0
    same_drops(tmp_path, recorded_y_up)


@pytest.mark.parametrize(
    "kind", ["XYZ", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("helical", "quaternion"))]
)
def test_an_export_of_vicon(tmp_path, recorded, kind):
    log = exports.write_vicon(
        recorded, tmp_path / "trial.csv", kind, lost=0.02, delimiter=";" if kind == "XYZ" else ","
    )
    assert init(tmp_path, log, *(["--rotation", "helical"] if kind == "helical" else [])) == 0
    same_drops(tmp_path, recorded)


def test_an_export_of_markers_alone(tmp_path, recorded, capsys):
    """The frame of the markers is that of the recording, about their mean: --frame says where the body is in it."""
    log = exports.write_vicon(recorded, tmp_path / "trial.csv", "markers", lost=0.02)
    drop = recorded.drop == 0
    angle = float(recorded.planar[drop][0, 2])  # held so from the first frame on, and the plane's x is near the room's
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = -exports.MARKERS[:, :2].mean(axis=0) @ np.array([[cos, sin], [-sin, cos]])
    assert init(tmp_path, log, "--frame", f"{x:.5f},{y:.5f},{np.degrees(angle):.3f}") == 0
    assert "the body is made of 4 markers" in capsys.readouterr().out
    same_drops(tmp_path, recorded, position=2e-3)  # they are 7 mm in front of the plane, which is tilted by 4°


BAGS = [(".bag", "TFMessage"), (".mcap", "PoseStamped"), (".db3", "TransformStamped")]
MORE_BAGS = [(".bag", "Odometry"), (".bag", "PoseStamped"), (".mcap", "TFMessage"), (".db3", "Odometry")]


@pytest.mark.parametrize(
    ("ending", "message"), [*BAGS, *(pytest.param(*bag, marks=pytest.mark.slow) for bag in MORE_BAGS)]
)
def test_a_bag_of_ros(tmp_path, recorded, ending, message):
    bag = exports.write_bag(recorded, tmp_path / f"drops{ending}", message, lost=0.02)
    assert init(tmp_path, bag, *(["--body", "plate"] if message == "TFMessage" else [])) == 0
    same_drops(tmp_path, recorded)


def flat(recorded: Take) -> pd.DataFrame:
    """The same take, seen by a camera that looks along the normal: x, y and theta, and no trials."""
    turn = recorded.rotation.as_matrix()
    x, y, _ = recorded.axes
    theta = np.arctan2(np.einsum("i,nij,j->n", y, turn, [1.0, 0, 0]), np.einsum("i,nij,j->n", x, turn, [1.0, 0, 0]))
    place = recorded.position @ np.stack([x, y]).T
    return pd.DataFrame({"t": recorded.t, "x": place[:, 0], "y": place[:, 1], "theta": theta})


def test_a_planar_table_is_cut_on_demand(tmp_path, recorded, capsys):
    flat(recorded).to_csv(tmp_path / "l.csv", index=False)
    assert init(tmp_path, tmp_path / "l.csv", "--cut") == 0
    assert f"{DROPS} drops cut out" in capsys.readouterr().out
    same_drops(tmp_path, recorded)


def test_a_planar_table_of_several_drops_that_is_not_cut_is_doubted(tmp_path, recorded, capsys):
    log = flat(recorded)
    log.to_csv(tmp_path / "l.csv", index=False)
    assert init(tmp_path, tmp_path / "l.csv") == 0
    said = capsys.readouterr().out
    assert f"warning: l.csv holds {DROPS} drops, one after the other" in said and "With --cut each" in said
    assert "in 1 trial; 30 in 10 are needed; if it is a long log of several drops, datasets init --cut" in said
    # nothing is cut between walls
    assert init(tmp_path, tmp_path / "l.csv", "--wall", "floor:0,0,0,1", "--gravity", "9.81", "--force") == 0
    said = capsys.readouterr().out
    assert "in 1 trial; 30 in 10 are needed" in said and "--cut" not in said
    # not a single drop, nor drops with their numbers, nor a file that is said to be one trial
    cases = [(log[recorded.drop == 0], {}), (log.assign(trial=recorded.drop), {})]
    cases += [(log, {"per_trial_files": True}), (log, {"cut": False})]
    for table, options in cases:
        table.to_csv(tmp_path / "l.csv", index=False)
        rig = RigOptions(parse_shape(SHAPE[1]))
        assert not convert([tmp_path / "l.csv"], "made", rig, Reading(**options)).warnings


@pytest.mark.slow
def test_trials_are_those_of_the_log_and_of_its_files(tmp_path, recorded):
    """A column of trials, and a file each, are not cut; both give the samples of the drops as they are."""
    during = recorded.drop >= 0
    names = ["t", "x", "y", "z", "qx", "qy", "qz", "qw"]
    table = pd.DataFrame(np.c_[recorded.t, recorded.position, recorded.quaternion][during], columns=names)
    table["trial"] = recorded.drop[during]
    table.to_csv(tmp_path / "log.csv", index=False)
    assert init(tmp_path, tmp_path / "log.csv", "--quaternion", "xyzw") == 0
    whole = read_dataset(tmp_path / "out").trajectories
    assert len(whole) == during.sum()
    files = [tmp_path / f"run{trial}.csv" for trial in range(DROPS)]
    for file, (_, part) in zip(files, table.groupby("trial")):
        part.drop(columns="trial").to_csv(file, index=False)
    assert init(tmp_path, *files, "--quaternion", "xyzw", "--per-trial-files", "--force") == 0
    pd.testing.assert_frame_equal(read_dataset(tmp_path / "out").trajectories, whole, atol=1e-9)


def test_trials_that_leave_the_plane_are_left_out_with_their_number(tmp_path, capsys):
    log = exports.write_table(take(DROPS, tumbling=(2, 5)), tmp_path / "log.csv")
    assert init(tmp_path, log, "--quaternion", "xyzw", *TABLE) == 0
    text = capsys.readouterr().out
    assert f"2 of {DROPS} trials left out, leaves the plane: 2 (" in text and ", 5 (" in text
    impacts = pd.read_csv(tmp_path / "out" / "impacts_in_space.csv")
    assert set(impacts["trial"][impacts["left_out"].notna()]) == {2, 5}
    assert impacts[~impacts["trial"].isin([2, 5])]["energy_out_before"].max() < 0.01
    assert 2 not in set(read_dataset(tmp_path / "out").trajectories["trial"])


WRONG = [
    ("table", ["--quaternion", "wxyz", *TABLE], "They fit with --quaternion xyzw"),
    ("table", ["--quaternion", "xyzw", "--left-handed", *TABLE], "They fit with no --left-handed"),
    ("table", ["--quaternion", "xyzw", "--up", "y", *TABLE], "free flights with --up z"),
    ("millimetres", ["--quaternion", "xyzw", *TABLE], "the lengths look like mm: then there are"),
    ("table", ["--quaternion", "xyzw", "--surface-height", "-0.4", *TABLE], "(--surface-height)"),
    ("table", ["--quaternion", "xyzw"], "x=…,y=…,z=…,qx=…,qy=…,qz=…,qw=…"),
    (
        "table",
        ["--quaternion", "xyzw", "--columns", "x=X,y=Y,z=Z,q1=X,q2=Y,q3=Z,q4=q3,t=time"],
        "unit quaternions have 1",
    ),
    ("table", ["--columns", "q1=q0"], "q1 belongs to a motion in space; give --quaternion"),
    ("table", ["--columns", "t=time,x=X,y=Y,z=Z"], "it has no angle of the body"),
    ("table", ["--up", "y"], "--up is for motions in space"),
    ("table", ["--quaternion", "xyzw", "--body", "plate", *TABLE], "is a table of one body: leave --body out"),
    ("table", ["--quaternion", "xyzw", "--frame", "4,2", *TABLE], "is not X,Y,ANGLE"),
    ("table", ["--quaternion", "xyzw", "--frame", "40,2,0", *TABLE], "is not X,Y,ANGLE"),
    ("table", ["--quaternion", "xyzw", "--plane", "z", *TABLE], "--plane: the plane is level"),
    ("motive", [], "take.csv has 2 bodies: plate, frame. Choose one with --body NAME."),
    ("motive", ["--body", "cup"], "has no body 'cup'"),
    ("motive", ["--body", "plate", "--units", "mm"], "take.csv is an export of Motive, which contains this"),
    ("motive", ["--body", "plate", "--up", "z"], "free flights with --up y"),
    ("euler", ["--rotation", "zyx"], "They fit with --rotation ZYX"),
    ("vicon", ["--rotation", "helical"], "They fit with --rotation XYZ"),
    ("vicon", ["--rotation", "YY"], "--rotation: 'YY' is unknown"),
    ("bag", [], "drops.mcap has 2 bodies: /tf:plate, /tf:rod"),
]


@pytest.fixture(scope="module")
def logs(tmp_path_factory, recorded, recorded_y_up) -> dict:
    folder = tmp_path_factory.mktemp("logs")
    return {
        "table": exports.write_table(recorded, folder / "log.csv"),
        "millimetres": exports.write_table(recorded, folder / "mm.csv", scale=1e3),
        "motive": exports.write_motive(recorded_y_up, folder / "take.csv"),
        "euler": exports.write_motive(recorded_y_up, folder / "euler.csv", "ZYX", others=False),
        "vicon": exports.write_vicon(recorded, folder / "trial.csv"),
        "bag": exports.write_bag(recorded, folder / "drops.mcap", "TFMessage"),
        "qualisys": exports.write_qualisys(recorded, folder / "drops.tsv", times=False),
        "optitrack": exports.write_optitrack(recorded, folder / "old.csv"),
    }


@pytest.mark.parametrize(("form", "args", "message"), WRONG)
def test_mistakes_are_told_with_what_mends_them(tmp_path, logs, capsys, form, args, message):
    assert init(tmp_path, logs[form], *args) == 2
    error = capsys.readouterr().err
    assert message in error, error
    assert not (tmp_path / "out").exists()


def edited(path, out, old: str, new: str):
    text = path.read_text(encoding="utf-8-sig")
    assert old in text
    out.write_text(text.replace(old, new, 1))
    return out


@pytest.mark.parametrize(
    ("form", "old", "new", "message"),
    [
        ("motive", "Coordinate Space,Global", "Coordinate Space,Local", "export it in the Global coordinate space"),
        ("motive", "Length Units,Meters", "Length Units,Feet", "'Feet' is not a known unit of length"),
        ("motive", "Rotation Type,Quaternion", "Rotation Type,Magic", "Rotation Type 'Magic' is unknown"),
        ("motive", ",Name,", ",Nom,", "has no lines 'Type', 'Name'"),
        ("motive", "\n100,0.400000,", "\n100,0.400000,x", "row 108, column 3: 'x"),
        ("vicon", "Segments\n250", "Segments\nfast", "row 2: expected the rate of the block 'segments' in Hz"),
        ("vicon", "Frame,Sub Frame,RX", "Sub Frame,Frame,RX", "row 4: expected the columns of 'segments'"),
        ("vicon", "deg,deg,deg", "grad,grad,grad", "'grad' is not a unit of RX"),
        ("vicon", "mm,mm,mm", "in,in,in", "'in' is not a known unit of length"),
        ("qualisys", "DATA_INCLUDED\t6D", "DATA_INCLUDED\t2D", "no line DATA_INCLUDED with 6D or 3D"),
        ("qualisys", "BODY_NAMES\trod", "BODY_NAMES\tcup\trod", "3 names, but no X, Y, Z of each"),
        ("qualisys", "FREQUENCY\t250", "FREQUENCY\tEXT", "FREQUENCY is missing or not a rate in Hz"),
        ("qualisys", "rod X\tY", "rod X\tQ", "no X, Y, Z of each"),
        ("optitrack", 'rigidbody,"plate"', 'body,"plate"', "has no body 'plate'"),
        ("optitrack", "\nframe,20,", "\nframe,20,now", "column 3: 'now"),
    ],
)
def test_exports_of_another_kind_are_refused(tmp_path, logs, capsys, form, old, new, message):
    log = edited(logs[form], tmp_path / "log.csv", old, new)
    assert init(tmp_path, log, *([] if form == "vicon" else ["--body", "plate"])) == 2
    assert message in capsys.readouterr().err


def test_a_bag_needs_the_package_and_says_so(tmp_path, logs, capsys, monkeypatch):
    monkeypatch.setattr("thesis_lib.datasets.sources.motion_capture.bags.find_spec", lambda name: None)
    assert init(tmp_path, logs["bag"]) == 2
    assert "pip install rosbags" in capsys.readouterr().err


def test_a_bag_that_is_none(tmp_path, logs, capsys):
    for name, content in (("a.bag", b"#ROSBAG V2.0\n"), ("a.mcap", b"x" * 100), ("a.db3", b""), ("b.db3", b"SQLite")):
        (tmp_path / name).write_bytes(content)
        assert init(tmp_path, tmp_path / name) == 2
        assert f"{name} cannot be read as a bag" in capsys.readouterr().err
    for name in ("zeros.bag", "zeros.mcap", "zeros.db3"):
        with (tmp_path / name).open("wb") as file:
            file.truncate(10 * 2**30)  # a sparse file, in which a line or a record never ends
        assert init(tmp_path, tmp_path / name) == 2
        assert "its first bytes are not those of such a file" in capsys.readouterr().err
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(logs["bag"].read_bytes()[:5000])
    assert init(tmp_path, cut) == 2
    assert "cut.mcap cannot be read as a bag" in capsys.readouterr().err
    assert init(tmp_path, logs["bag"], logs["table"]) == 2
    assert "is a bag of ROS, but" in capsys.readouterr().err
