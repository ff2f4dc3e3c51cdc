"""Tables as programs and people write them, read by `datasets init`: the same poses, whatever the form."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from folders import bouncing_disk, trajectories

from thesis_lib.commands.datasets import main
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.sources.conversion import Conversion
from thesis_lib.datasets.sources.logs import convert
from thesis_lib.datasets.sources.tables.options import Reading, parse_columns, unit_in, unit_of
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, parse_shape, parse_wall
from thesis_lib.foundation.errors import UserError

WRITTEN = 6e-6  # m, rad: half of the last of five digits, and rounding
FRAME = trajectories()
STAMPS = 1567176123123456789 + np.rint(1e9 * FRAME["t"]).astype(np.int64)  # ns since 1970
PX, CORNER = 900.0, np.array([300.0, 800.0])  # pixels a metre, and the pixel at x = 0, y = 0


def text(frame: pd.DataFrame = FRAME, **how) -> str:
    return frame.to_csv(index=False, float_format="%.5f", **how)


def read(
    folder, content: str | bytes, shape: str = "square:0.06", rig: dict | None = None, **options: Any
) -> Conversion:
    path = folder / "log.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    options["columns"] = parse_columns(options.get("columns", ""))
    return convert([path], "made", RigOptions(parse_shape(shape), **(rig or {})), Reading(**options))


def poses_of(conversion: Conversion) -> pd.DataFrame:
    poses = conversion.dataset.trajectories
    assert poses is not None
    return poses


def same(conversion: Conversion, expected: pd.DataFrame = FRAME, within: float = WRITTEN) -> None:
    poses = poses_of(conversion)
    columns = ["t", "x", "y", "theta"] if conversion.dataset.has_angle else ["t", "x", "y"]
    assert conversion.dataset.has_angle == ("theta" in expected)
    np.testing.assert_array_equal(poses["trial"], expected["trial"])
    np.testing.assert_allclose(poses[columns], expected[columns], atol=within)


def below(units: str, content: str) -> str:
    """A table with a row of units below its header."""
    return content.replace("\n", f"\n{units}\n", 1)


MILLI = FRAME.assign(x=1e3 * FRAME["x"], y=1e3 * FRAME["y"], theta=np.degrees(FRAME["theta"]))
NAMED = MILLI.rename(columns={"t": "t (s)", "x": "x (mm)", "y": "y [mm]", "theta": "angle (°)"})
COLUMNS = "t=t (s),x=x (mm),y=y [mm],theta=angle (°)"
FORMS = {  # content, options, what is said of it
    "semicolons": (text(sep=";"), {}, "semicolons between cells"),
    "decimal commas": (text(sep=";", decimal=","), {}, "semicolons between cells and decimal commas"),
    "tabs and commas": (text(sep="\t", decimal=","), {}, "tabs between cells and decimal commas"),
    "quoted decimals": (text(decimal=",", quoting=1), {}, "commas between cells and decimal commas"),
    "aligned by blanks": (FRAME.round(5).to_string(index=False) + "\n", {}, "spaces between cells"),
    "UTF-16": (text().encode("utf-16"), {}, "read as utf-16"),
    "UTF-8 with a mark": (text().encode("utf-8-sig"), {}, ""),
    "old line ends": (text().replace("\n", "\r"), {}, ""),
    "cp1252, units in brackets": (text(NAMED).encode("cp1252"), {"columns": COLUMNS}, "read as cp1252"),
    "names without their units": (text(NAMED), {"columns": "theta=angle"}, "units read from the names"),
    "units stated twice": (text(NAMED), {"columns": COLUMNS, "units": "mm,deg"}, "units read from the names"),
    "a row of units": (below(",s,(mm),[mm],°", text(MILLI)), {}, "y in mm, theta in deg"),
    "a row of unknown units": (below(",sec,inch,inch,rad", text()), {"units": "m"}, "t in s, theta in rad"),
    "units and comments": (below(",s,m,m,rad\n,a,b,b,c", text()), {}, "row 3 skipped"),
    "the name of the mass": ("mass_A\n" + text(sep="\t"), {}, "row 1 skipped, text around the header: 'mass_A'"),
    "a preamble": ("Rate\t250\nBy\tJane\n***End***\t\n\n" + text(sep="\t"), {}, "rows 1, 2, 3 skipped"),
    "a commented header": ("# from the rig\n# " + text(sep=" "), {}, "row 1 skipped"),
    "comments": (text().replace("\n", "\n# pause\n", 4), {}, "4 comment lines below the header left out"),
    "no header": (text(header=False), {"columns": "trial=1,t=2,x=3,y=4,theta=5"}, "columns are named by their number"),
    "frames": (
        text(FRAME.assign(t=np.rint(250 * FRAME["t"]).astype(int))),
        {"rig": {"rate": 250.0}},
        "t counts frames; times follow from --rate 250",
    ),
    "ns": (text(FRAME.assign(t=STAMPS)), {"units": "ns"}, ""),
    "ns in a commented header": (
        "#" + text(FRAME.assign(t=STAMPS)[["t", "x", "y", "theta", "trial"]]).replace("t,", "timestamp [ns],", 1),
        {"columns": "t=#timestamp [ns]"},
        "",
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_the_form_of_a_table_is_found(tmp_path, form):
    content, options, said = FORMS[form]
    done = read(tmp_path, content, **options)
    same(done)
    assert any(said in note for note in done.notes) if said else not any("log.txt" in note for note in done.notes)
    assert done.warnings == []


def test_rows_that_repeat_are_left_out(tmp_path):
    twice = read(tmp_path, text(FRAME.iloc[np.sort(np.r_[np.arange(len(FRAME)), 5, 5, 9])]))
    same(twice)
    assert f"3 of {len(FRAME) + 3} rows left out: they repeat the one before, with its time" in twice.notes


def test_stamps_in_nanoseconds_keep_their_digits(tmp_path):
    """Floats of 19 digits are 256 ns apart; integers are taken off the first before."""
    stamps = STAMPS + np.arange(len(STAMPS))  # 1 ns a row later
    stamps[5:8] = [stamps[5], 0, stamps[7]]
    cells = [str(stamp) if stamp else "#N/A" for stamp in stamps]
    poses = poses_of(read(tmp_path, text(FRAME.assign(t=cells)), units="ns"))
    one = (stamps[:40] - stamps[0])[stamps[:40] > 0]
    np.testing.assert_array_equal(poses["t"][:39], 1e-9 * one.astype(float))


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("rows", [[5, 6, 7, 20], range(1, len(FRAME), 2)])
def test_rows_of_zeros_far_from_the_body_are_lost_frames(tmp_path, rows):
    lost = np.isin(np.arange(len(FRAME)), rows)
    made = read(tmp_path, text(FRAME.mask(lost[:, None] & FRAME.columns.isin(["x", "y", "theta"]), 0.0)))
    same(made, FRAME[~lost])
    assert f"{len(rows)} rows of zeros taken as lost" in " ".join(made.notes)
    # a body may pass the origin
    near = FRAME.assign(
        x=FRAME["x"] - FRAME["x"][5], y=FRAME["y"] - FRAME["y"][5], theta=FRAME["theta"] - FRAME["theta"][5]
    )
    assert not any("zeros" in note for note in read(tmp_path, text(near), rig={"surface_height": -9.0}).notes)


def test_missing_numbers_are_read_as_loggers_write_them(tmp_path):
    """printf of C and of Microsoft's C; the sign of a NaN is that of the operation that made it."""
    written = ("-nan", "nan(ind)", "-nan(ind)", "-1.#IND", "1.#QNAN", "-1.#IND00", "", "NaN", "#N/A")
    cells = text().splitlines()
    for row, cell in enumerate(written, 5):
        cells[row] = ",".join([*cells[row].split(",")[:2], *3 * [cell]])
    done = read(tmp_path, "\n".join(cells) + "\n")
    same(done, FRAME.drop(index=range(4, 4 + len(written))).reset_index(drop=True))
    assert any(note.startswith(f"{len(written)} of {len(FRAME)} rows left out") for note in done.notes)


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%fZ", "%H:%M:%S.%f"])
def test_dates_and_times_of_day_are_seconds(tmp_path, form):
    """Past midnight, and with a lost frame."""
    stamps = pd.Timestamp("2025-11-20 23:59:59.95") + pd.to_timedelta(FRAME["t"], unit="s")
    done = read(tmp_path, text(FRAME.assign(t=stamps.dt.strftime(form).where(FRAME.index != 7))))
    same(done, FRAME.drop(index=7).reset_index(drop=True))
    assert "t is a date or a time of day: read as seconds since the first row" in done.notes


def test_equal_time_stamps_give_way_to_a_rate(tmp_path):
    dead = text(FRAME.assign(t=1.76363e18)).replace("1763630000000000000.00000", "1.76363E+18")
    with pytest.raises(UserError) as refusal:
        read(tmp_path, dead, units="ns")
    for said in ("all time stamps are equal (1.76363E+18)", "(--columns t=NAME), or give --rate HZ"):
        assert said in str(refusal.value)
    done = read(tmp_path, dead, units="ns", rig={"rate": 250.0})
    same(done)
    assert any("rows are taken in order, evenly spaced at --rate 250" in note for note in done.notes)


@pytest.mark.parametrize("unit", ["s", "us", "ns"])
def test_rows_without_a_stamp_are_left_out(tmp_path, unit):
    """Zeros in the place of a stamp; a trial that begins at 0 after another one keeps its first row."""
    dead = (0, 1, 7, 8, len(FRAME) - 1)
    stamps = {"s": FRAME["t"] + 99.0, "us": STAMPS // 1000, "ns": STAMPS}[unit]
    done = read(tmp_path, text(FRAME.assign(t=stamps.where(~FRAME.index.isin(dead), 0))), units=unit)
    left = FRAME.drop(index=list(dead)).reset_index(drop=True)
    same(done, left.assign(t=left["t"] - left.groupby("trial")["t"].transform("first")))
    assert "5 rows left out, not stamped: the time is 0 among later ones" in done.notes
    assert not any("not stamped" in note for note in read(tmp_path, text()).notes)


LONG = trajectories(1, 700).assign(y=0.2)  # 2.8 s
REFUSED = {
    "nsecs": (text(LONG.assign(t=1e9 * ((LONG["t"] + 0.3) % 1.0))), {}, "the column with the seconds (secs + t / 1e9)"),
    "another date": (
        text(FRAME.assign(t="11/20/2025 10:00:00 AM")),
        {},
        "row 2: '11/20/2025 10:00:00 AM' is not read as",
    ),
    "month": (
        text(FRAME.assign(t="2025-12-20 10:00:00")).replace("12-20", "13-20", 9).replace("13-20", "12-20", 8),
        {},
        "row 10: '2025-13-20 10:00:00' is not read as a time: convert date and time to seconds",
    ),
    "minute": (text(FRAME.assign(t="10:60:00")), {}, "row 2: '10:60:00' is not read as a time"),
    "nearly equal": (
        text(FRAME.assign(t=FRAME["t"].where(FRAME.index != 5, FRAME["t"][4] + 1e-6).map("{:.7f}".format))),
        {},
        "log.txt, row 7, trial 0: the time 0.016 s is that of the row before, or nearly, but the pose is another one",
    ),
    "contradicting": (text(NAMED), {"columns": COLUMNS, "units": "m"}, "x (mm) is in mm, but --units states m"),
    "below": (below(",s,mm,mm,rad", text()), {"units": "deg"}, "column theta is in rad, but --units states deg"),
    "quantity": (text(NAMED), {"columns": "t=x (mm),x=t (s),y=y [mm],theta=angle (°)"}, "is in mm, but t is a time"),
    "frames": (text(FRAME.assign(t=np.arange(len(FRAME)))), {}, "t counts rows: give the frame rate, --rate"),
    "stamps": (text(FRAME.assign(t=STAMPS)), {}, "counts ns since 1970 (1.567e+18): give --units ns"),
    "decimal": (text(sep=";"), {"decimal": ","}, "'0.00000' is not a number (120 such cells)"),
    "delimiter": (text(), {"delimiter": ";"}, "and check --delimiter"),
    "pixels": (text(), {"units": "px"}, "give the pixels per metre with --scale"),
    "origin": (text(FRAME.assign(y=-FRAME["y"])), {"scale": "900"}, "Give the pixel of x = 0, y = 0 with --origin U,V"),
    "scale": (text(), {"scale": "900", "units": "mm"}, "--scale is for pixels, but --units states mm"),
    "no angle": (text(FRAME.drop(columns="theta")), {}, "and only a round body can do without"),
    "binary": (bytes(range(256)) * 20, {}, "cannot be read as a table (it is not text)"),
    "body": (text(), {"body": "plate"}, "--body is for files of several"),
    "walls and cuts": (
        text(),
        {"cut": True, "rig": {"walls": (parse_wall("a:0,0,0,1"),)}},
        "leave it out where the body moves between walls",
    ),
}


@pytest.mark.parametrize("mistake", REFUSED)
def test_what_a_table_does_not_say_is_asked_for(tmp_path, mistake):
    content, options, message = REFUSED[mistake]
    with pytest.raises(UserError) as refusal:
        read(tmp_path, content, **options)
    assert message in str(refusal.value)


def test_pixels_have_a_scale_and_an_origin(tmp_path):
    picture = FRAME.assign(x=CORNER[0] + PX * FRAME["x"], y=CORNER[1] - PX * FRAME["y"], theta=-FRAME["theta"])
    for scale in ("900", "450/0.5"):
        options = {"scale": scale, "origin": "300,800"}
        done = read(tmp_path, text(picture), columns="y=-y,theta=-theta", **options)
        same(done)
        assert done.warnings == []
    (warning,) = read(tmp_path, text(picture), columns="y=-y", units="px", scale="900", origin="300,800").warnings
    assert "needs --columns theta=-theta" in warning


def test_a_disk_may_lack_the_angle(tmp_path):
    frame = bouncing_disk(3).drop(columns="theta")
    done = read(tmp_path, text(frame), "disk:0.03")
    same(done, frame)
    assert any("theta is not measured" in note for note in done.notes)
    assert not read(tmp_path, text(frame[frame["trial"] == 0]), "disk:0.03", cut=True).dataset.has_angle
    with pytest.raises(UserError, match="no column phi"):
        read(tmp_path, text(frame), "disk:0.03", columns="theta=phi")


def test_walls_and_no_angle_through_the_command(tmp_path, capsys):
    frame = FRAME.assign(y=0.3 - 4.0 * FRAME["t"]).drop(columns="theta")
    (tmp_path / "puck.csv").write_text(text(frame, sep=";", decimal=","))
    walls = ["--wall", "south:0,-0.4,0,1", "--wall", "north:0,0.4,0,-2"]
    out = tmp_path / "out"
    assert main(["init", str(tmp_path / "puck.csv"), "-o", str(out), "--shape", "disk:0.03", *walls]) == 0
    assert "note: gravity 0, as for a motion seen from above" in capsys.readouterr().out
    dataset = read_dataset(out)
    assert not dataset.has_angle and dataset.gravity == 0.0
    assert [(wall.name, wall.point, wall.normal) for wall in dataset.header.surfaces or ()] == [
        ("south", (0.0, -0.4), (0.0, 1.0)),
        ("north", (0.0, 0.4), (0.0, -2.0)),
    ]
    more = ["--force", "--wall", "South:0,0,0,1"]
    assert main(["init", str(tmp_path / "puck.csv"), "-o", str(out), "--shape", "disk:0.03", *more]) == 2
    assert "--wall: 'South:0,0,0,1' is not NAME:X,Y,NX,NY" in capsys.readouterr().err


MARKS = {"tip": (0.03, 0.0), "side": (0.0, 0.02), "tail": (-0.03, 0.0), "other": (0.0, -0.02)}  # mean 0, m
DIRECTION = np.arctan2(0.02, -0.03)  # of the second from the first, in the body
SEEN = 5e-5  # m: half of the last digit, in pixels


def points(frame: pd.DataFrame, lost: dict[str, int], individual: str = "") -> str:
    """A table of DeepLabCut: the `MARKS` in the picture, each lost (and elsewhere) in one frame."""
    columns = [np.arange(len(frame)).astype(str)]
    for name, (a, b) in MARKS.items():
        cos, sin = np.cos(frame["theta"]), np.sin(frame["theta"])
        u = CORNER[0] + PX * (frame["x"] + cos * a - sin * b)
        v = CORNER[1] - PX * (frame["y"] + sin * a + cos * b)
        sure = np.where(np.arange(len(frame)) == lost.get(name, -1), 0.4, 0.95)
        columns += [[f"{x:.2f}" for x in u + 500.0 * (sure < 0.6)], [f"{x:.2f}" for x in v], [f"{x:.2f}" for x in sure]]
    heads = [["scorer", *["net"] * 12], *([["individuals", *[individual] * 12]] if individual else [])]
    heads += [["bodyparts", *np.repeat(list(MARKS), 3)], ["coords", *["x", "y", "likelihood"] * 4]]
    return "\n".join(",".join(row) for row in [*heads, *zip(*columns)]) + "\n"


@pytest.mark.parametrize("individual", ["", "plate"])
def test_points_of_a_video_tracker_become_the_pose(tmp_path, individual):
    frame = FRAME[FRAME["trial"] == 0]
    how: dict[str, Any] = {"scale": "900", "origin": "300,800", "rig": {"rate": 250.0}}
    table = points(frame, {"tip": 7, "side": 7, "tail": 9}, individual)
    done = read(tmp_path, table, frame=f"0,0,{-np.degrees(DIRECTION):.9f}", **how)
    same(done, frame, SEEN / 0.02)  # an angle of marks 0.02 m from the middle
    np.testing.assert_allclose(poses_of(done)[["x", "y"]], frame[["x", "y"]], atol=SEEN)
    assert any("3 points taken as lost" in note for note in done.notes)

    name = f"{individual}.tip" if individual else "tip"
    alone = read(tmp_path, table, "disk:0.03", columns=f"x={name}.x,y=-{name}.y", **how)
    assert len(poses_of(alone)) == len(frame) - 1 and not alone.dataset.has_angle
    for options, message in (
        ({"columns": "x=tip,y=-tip.1"}, "leave x, y and theta out of --columns"),
        ({"body": f"{name},nose"}, "has no point nose"),
        ({"body": name}, "and only a round body can do without"),
    ):
        with pytest.raises(UserError) as refusal:
            read(tmp_path, table, **how, **options)
        assert message in str(refusal.value)


def test_points_that_are_not_on_one_body_are_doubted(tmp_path):
    frame = FRAME[FRAME["trial"] == 0]
    table = points(frame, {}).splitlines()
    moved = [",".join([*row.split(",")[:10], "300", "575", "0.9"]) for row in table[3:]]  # a corner of the table
    (warning,) = read(
        tmp_path, "\n".join([*table[:3], *moved, ""]), scale="900", origin="300,800", rig={"rate": 250.0}
    ).warnings
    assert "other deviate by" in warning and "--body" in warning


def drops(spin: float, trials: int = 12, mu: float = 0.2) -> pd.DataFrame:
    """A disk of 30 mm that bounces and rubs once a trial: Δω = −r Δv_x/k², k² = r²/2; `spin` (rad/s) at release."""
    t = np.arange(60) / 250.0
    rows = []
    for trial in range(trials):
        vx, omega, hit = 0.2 + 0.05 * trial, spin * (1.0 + 0.1 * trial), 0.12
        rub = mu * 1.7 * 9.81 * hit
        after = np.maximum(t - hit, 0.0)
        x = vx * t - rub * after
        y = 0.03 + 9.81 / 2.0 * (hit**2 - t**2) + 1.7 * 9.81 * hit * after
        rows.append(
            pd.DataFrame({"trial": trial, "t": t, "x": x, "y": y, "theta": omega * t + 2.0 * rub / 0.03 * after})
        )
    return pd.concat(rows, ignore_index=True)


@pytest.mark.parametrize("cut", [None, True])
@pytest.mark.parametrize(("spin", "why"), [(2.0, "hits would change the spin"), (90.0, "larger than 1.5 turns")])
def test_degrees_that_are_read_as_radians_are_refused(tmp_path, spin, why, cut):
    frame = drops(spin)
    if cut:  # one recording: the hand takes a second from drop to drop, the angle goes on
        frame = frame.assign(t=frame["t"] + frame["trial"], trial=0)
    degrees = frame.assign(theta=np.degrees(frame["theta"]))
    if why.startswith("larger"):
        degrees = degrees.assign(theta=(degrees["theta"] + 180.0) % 360.0 - 180.0)
    with pytest.raises(UserError, match=r"is read as radians\. Give --units m,deg") as refusal:
        read(tmp_path, text(degrees), "disk:0.03", cut=cut, units="m")
    assert why in str(refusal.value)
    read(tmp_path, text(degrees), "disk:0.03", cut=cut, units="m,deg")


@pytest.mark.parametrize("every", [1, 8])
def test_fast_and_slowly_sampled_bodies_are_not_refused(tmp_path, every):
    """30 turns a second at 250 Hz, a fifth of that at 31 Hz."""
    frame = drops(190.0 if every == 1 else 38.0)[::every]
    read(tmp_path, text(frame), "disk:0.03")
    read(tmp_path, text(frame.assign(theta=frame["theta"] % (2.0 * np.pi))), "disk:0.03")


def test_units_that_are_not_known_are_doubted(tmp_path):
    doubts = read(tmp_path, below(",sec,inch,mm,rad", text(FRAME.assign(y=1e3 * FRAME["y"])))).warnings
    assert len(doubts) == 1 and "column x: 'inch' below the header is not a known unit; read as m" in doubts[0]


def test_units_have_many_names():
    assert [unit_of(cell) for cell in ("[mm]", "(°)", "Seconds", "µs", "pixels", "N m", "")] == [
        "mm", "deg", "s", "us", "px", None, None
    ]  # fmt: skip
    assert (unit_in("theta (deg)"), unit_in("q_x []"), unit_in("mm")) == ("deg", None, None)
