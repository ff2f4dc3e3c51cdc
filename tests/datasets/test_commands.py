"""The commands fetch, check and init, as a user types them."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from folders import DISK, bouncing_disk, header, impacts, trajectories, write

from thesis_lib.commands.datasets import main
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.sources.tables.options import Units, parse_columns, parse_units
from thesis_lib.datasets.sources.tables.rig_options import parse_shape
from thesis_lib.foundation.errors import UserError

ROOT = Path(__file__).resolve().parents[2]
NOISE_FROM_FEW_ARCS = 0.25  # a dozen arcs of 20 samples know their noise to 5 %; four times that
COLUMNS = "trial=run,t=time,x=X,y=Z,theta=angle"
UNITS = ("--units", "mm,deg,ms")


def rig(frame: pd.DataFrame, *, down: bool = False) -> pd.DataFrame:
    """The poses as a rig might log them: ms, mm, degrees, own names, a column more."""
    up = -1e3 if down else 1e3
    log = {"run": frame["trial"], "time": frame["t"] * 1e3, "X": frame["x"] * 1e3, "Z": frame["y"] * up}
    return pd.DataFrame(log | {"angle": np.degrees(frame["theta"]), "quality": 1})


def init(tmp_path, *args: str) -> int:
    return main(["init", *args, "-o", str(tmp_path / "out"), "--shape", "square:0.06"])


def log_of(tmp_path, table: pd.DataFrame, **how: str) -> str:
    """The table as a file of a rig."""
    table.to_csv(tmp_path / "log.csv", index=False, **how)
    return str(tmp_path / "log.csv")


def same_poses(tmp_path, expected: pd.DataFrame) -> None:
    poses = read_dataset(tmp_path / "out").trajectories
    np.testing.assert_array_equal(poses["trial"], expected["trial"])
    columns = ["t", "x", "y", "theta"]
    np.testing.assert_allclose(poses[columns], expected[columns], atol=1e-12)  # rounding of the unit factors


def test_check_prints_a_summary(tmp_path, capsys):
    frame = bouncing_disk(6)
    content = header(body=DISK | {"mass": 0.05}, noise={"position": 2e-4, "angle": 2e-3})
    folder = write(tmp_path / "drops", content, trajectories=frame, impacts=impacts(6, 2).assign(y=0.03))
    assert main(["check", str(folder)]) == 0
    text = capsys.readouterr().out
    for part in (
        "trials      6",
        f"{len(frame)} samples",
        "250 Hz",
        "mass 0.05 kg",
        "noise       position 0.0002 m",
        "rad/s",
        "impacts of the trajectories can be used (impacts.csv is used instead)",
        "(stated 0.0002)",
    ):
        assert part in text
    assert text.endswith("The dataset is valid.\n")


def check_json(folder: Path, capsys) -> dict:
    assert main(["check", str(folder), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_check_says_what_detection_finds(tmp_path, capsys):
    folder = write(tmp_path / "a", header(body=DISK, noise=None), trajectories=bouncing_disk(6))
    detection = check_json(folder, capsys)["detection"]
    assert detection["used"] >= 10 and detection["warnings"] == []
    assert detection["noise"]["position"] == pytest.approx(2e-4, rel=NOISE_FROM_FEW_ARCS)
    assert detection["noise"]["angle"] == pytest.approx(2e-3, rel=NOISE_FROM_FEW_ARCS)
    assert main(["check", str(folder)]) == 0
    text = capsys.readouterr().out
    for part in (f"detection   {detection['used']} impacts of the trajectories can be used\n", "left out", "flags"):
        assert part in text


def test_check_refuses_a_surface_that_no_impact_touches(tmp_path, capsys):
    content = header(body=DISK, noise=None, surface={"height": -0.5})
    folder = write(tmp_path / "a", content, trajectories=bouncing_disk(6))
    assert main(["check", str(folder)]) == 2
    text = capsys.readouterr().err
    assert "m instead of -0.5 m would close the gap of +0.498 m" in text
    # a few millimetres are an effect that may be in the data: a warning
    folder = write(tmp_path / "b", content | {"surface": {"height": -0.005}}, trajectories=bouncing_disk(6))
    detection = check_json(folder, capsys)["detection"]
    assert detection["flagged"]["no_touch"] == detection["used"] >= 10
    (text,) = detection["warnings"]
    assert f"In {detection['used']} of {detection['used']} impacts the body is off the surface" in text
    assert "Correct surface.height (-0.005 m; " in text
    assert main(["check", str(folder)]) == 0
    assert "The dataset is valid, with the warnings above." in capsys.readouterr().out


def test_check_warns_where_no_impact_is_found_or_none_can_be_used(tmp_path, capsys):
    folder = write(tmp_path / "a", header(noise=None), trajectories=trajectories())
    (text,) = check_json(folder, capsys)["detection"]["warnings"]
    assert "No impact was found in 3 trials" in text
    frame = bouncing_disk(1)
    first = int((frame["y"].diff() > 0).idxmax())  # the record ends two samples after the first impact
    folder = write(tmp_path / "b", header(body=DISK, noise=None), trajectories=frame[: first + 2])
    texts = check_json(folder, capsys)["detection"]["warnings"]
    assert any("None of the 1 impacts found can be used (window_too_short 1)" in text for text in texts)


def test_check_lists_problems_and_exits_with_2(tmp_path, capsys):
    folder = write(tmp_path, header(colour=1), trajectories=trajectories().assign(speed=0))
    assert main(["check", str(folder)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: The dataset")
    assert "has 2 problems" in err
    assert "Traceback" not in err


def test_check_as_json(tmp_path, capsys):
    folder = write(tmp_path / "a", trajectories=trajectories().drop(index=5))
    facts = check_json(folder, capsys)
    assert facts["valid"] and facts["trials"] == 3
    assert len(facts["warnings"]) == 1
    assert facts["trajectories"]["range"]["theta"][0] == pytest.approx(0.3)
    assert main(["check", str(tmp_path / "none"), "--json"]) == 2
    facts = json.loads(capsys.readouterr().out)
    assert not facts["valid"]
    assert facts["problems"][0]["what"] == "the folder does not exist"


@pytest.mark.slow
def test_command_line_from_a_shell(tmp_path):
    folder = write(tmp_path / "drops", impacts=impacts())
    command = [sys.executable, "-m", "thesis_lib", "datasets"]
    done = subprocess.run([*command, "check", str(folder)], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "impacts     24" in done.stdout
    done = subprocess.run([*command, "--help"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "init log.csv -o data/my_drops --units mm,deg" in done.stdout


def test_fetch_from_a_local_copy(tmp_path, capsys, raw_folder):
    raw = raw_folder("planar_impact")
    for source in (raw, raw.parent):
        assert main(["fetch", "planar-impact", "--from", str(source), "--to", str(tmp_path)]) == 0
        assert "impacts     1718" in capsys.readouterr().out
    assert main(["fetch", "planar-dice", "--from", str(tmp_path), "--to", str(tmp_path)]) == 2
    assert "does not contain the published set planar_dice" in capsys.readouterr().err


def test_init_converts_units_names_and_says_what_it_left_out(tmp_path, capsys):
    log = rig(trajectories())
    log.loc[[7, 8], "X"] = np.nan
    assert init(tmp_path, log_of(tmp_path, log), *UNITS, "--columns", COLUMNS) == 0
    text = capsys.readouterr().out
    assert "note: columns left out: quality" in text
    assert "note: 2 of 120 rows left out" in text
    assert "radius of gyration 0.024495 m, as of a uniform lamina" in text
    assert "Next:" in text
    same_poses(tmp_path, trajectories().drop(index=[7, 8]))
    content = yaml.safe_load((tmp_path / "out" / "dataset.yaml").read_text())
    assert content["rate"] == 250.0
    assert content["body"]["radius_of_gyration"] == pytest.approx(0.06 / np.sqrt(6.0))


@pytest.mark.parametrize(
    ("last", "said", "rows"),
    [
        ("2,160.0,282.", "the last row has 3 of 6 cells, so the file was cut off", 120),
        ("2,160.0,280.0,120.0,53.8,1", "the last row does not end with a line break", 121),
    ],
)
def test_init_says_that_a_log_may_have_been_cut_off(tmp_path, capsys, last, said, rows):
    """Writing broke off: these cells stand in the last row, without a line break."""
    (tmp_path / "log.csv").write_text(rig(trajectories()).to_csv(index=False) + last)
    assert init(tmp_path, str(tmp_path / "log.csv"), *UNITS, "--columns", COLUMNS) == 0
    text = capsys.readouterr().out
    assert f"warning: log.csv, row 122: {said}" in text and "lost" not in text
    poses = read_dataset(tmp_path / "out").trajectories
    assert len(poses) == rows
    np.testing.assert_allclose(poses["x"][:120], trajectories()["x"], atol=1e-12)


def test_init_takes_a_file_for_each_trial_without_times_and_numbers_the_rows_that_it_leaves_out(tmp_path, capsys):
    files = [tmp_path / f"run{number}.csv" for number in range(3)]
    for file, (_, part) in zip(files, trajectories().groupby("trial")):
        part[["x", "y", "theta"]].to_csv(file, index=False)
    args = (*map(str, files), "--per-trial-files", "--rate", "250", "--force")
    assert init(tmp_path, *args) == 0
    same_poses(tmp_path, trajectories())
    lines = files[1].read_text().splitlines(keepends=True)
    lines[4] = "0.1,0.2\n"
    files[1].write_text("".join(lines[:3] + ["\n"] + lines[3:]))  # the blank line counts as a row
    assert init(tmp_path, *args) == 0
    assert "1 of 120 rows left out: a pose or time is empty, as in lost frames (run1.csv row 6)" in (
        capsys.readouterr().out
    )


def test_init_refuses_rows_that_are_too_long_and_takes_a_delimiter_at_their_end(tmp_path, capsys):
    """A reader that takes the extra cell for a row name shifts every column."""
    header_line, *lines = trajectories().to_csv(index=False).splitlines()
    (tmp_path / "end.csv").write_text("\n".join([header_line, *(line + "," for line in lines), ""]))
    assert init(tmp_path, str(tmp_path / "end.csv")) == 0
    same_poses(tmp_path, trajectories())
    (tmp_path / "long.csv").write_text("\n".join([header_line, *(line + ",1" for line in lines), ""]))
    assert init(tmp_path, str(tmp_path / "long.csv"), "--force") == 2
    assert "long.csv, row 2: 6 cells, but the header names 5 columns" in capsys.readouterr().err


def test_init_with_a_shape_in_millimetres_names_the_option(tmp_path, capsys):
    args = [log_of(tmp_path, rig(trajectories())), *UNITS, "--columns", COLUMNS]
    assert main(["init", *args, "-o", str(tmp_path / "out"), "--shape", "disk:30"]) == 2
    error = capsys.readouterr().err
    assert "--shape of the init command is in m" in error
    assert "degrees" not in error


def test_init_flips_axes_and_reads_other_delimiters(tmp_path):
    log = log_of(tmp_path, rig(trajectories(), down=True), sep=";")
    columns = COLUMNS.replace("y=Z", "y=-Z")
    args = [*UNITS, "--columns", columns, "--delimiter", ";", "--mass", "0.05", "--k-g", "0.02"]
    assert init(tmp_path, log, *args) == 0
    same_poses(tmp_path, trajectories())
    assert read_dataset(tmp_path / "out").k_g == 0.02


def test_init_says_that_a_body_is_homogeneous(tmp_path, capsys):
    args = [log_of(tmp_path, rig(trajectories())), *UNITS, "--columns", COLUMNS]
    assert init(tmp_path, *args, "--homogeneous", "0.003") == 0
    body = read_dataset(tmp_path / "out").header.body
    assert body.homogeneous and body.known("inertia") == pytest.approx(0.006)
    assert "--k-g to change" not in capsys.readouterr().out
    assert init(tmp_path, *args, "--homogeneous", "3", "--force") == 2
    assert "--homogeneous: 3.0" in capsys.readouterr().err
    assert init(tmp_path, *args, "--homogeneous", "0.003", "--k-g", "0.02", "--force") == 2
    assert "off that of this shape with uniform density" in capsys.readouterr().err


def test_init_numbers_named_trials_and_starts_their_clocks(tmp_path, capsys):
    frame = trajectories()
    log = frame.assign(trial="run_" + frame["trial"].astype(str), t=frame["t"] + 1.7e9)
    assert init(tmp_path, log_of(tmp_path, log)) == 0
    assert "0 = run_0, …, 2 = run_2" in capsys.readouterr().out
    poses = read_dataset(tmp_path / "out").trajectories
    np.testing.assert_allclose(poses["t"], frame["t"], atol=1e-6)  # the clock's own resolution at 1.7e9 s


def test_init_makes_wrapped_degrees_continuous(tmp_path, capsys):
    frame = trajectories().assign(theta=lambda table: 60.0 * table["t"])
    log = frame.assign(theta=(np.degrees(frame["theta"]) + 180.0) % 360.0 - 180.0)
    assert init(tmp_path, log_of(tmp_path, log), "--units", "deg") == 0
    assert "theta made continuous" in capsys.readouterr().out
    same_poses(tmp_path, frame)


def test_init_refuses_what_is_still_wrong_and_says_so(tmp_path, capsys):
    args = [log_of(tmp_path, rig(trajectories())), "--units", "deg,ms", "--columns", COLUMNS]
    assert init(tmp_path, *args) == 2
    error = capsys.readouterr().err
    assert "was written, but it is not usable yet" in error
    assert "column y: looks like millimetres" in error
    assert init(tmp_path, *args) == 2
    assert "already holds a dataset" in capsys.readouterr().err
    assert init(tmp_path, *args, *UNITS, "--force") == 0


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--columns", "x=XX"], "has no column XX, y, theta (did you mean 'X'?)"),
        (["--columns", "q=X"], "'q=X' is not OURS=YOURS"),
        (["--columns", "t=time,y=Z,theta=angle,x=word"], "column word, row 2: 'abc' is not a number (120 such cells)"),
        (["--units", "inch"], "'inch' is unknown; give m, cm, mm"),
        (["--units", "mm,cm"], "gives two units of length"),
        (["--columns", "x=X,y=Z,theta=angle"], "has no time column: give --columns t=NAME, or --rate HZ"),
        (["--delimiter", ";"], "and check --delimiter"),
        (["--columns", COLUMNS, "--mass", "-1"], "--mass: -1.0: Input should be greater than 0"),
        (["--columns", COLUMNS, "--rate", "0"], "--rate: 0.0 Hz is impossible"),
    ],
)
def test_init_mistakes(tmp_path, capsys, args, message):
    assert init(tmp_path, log_of(tmp_path, rig(trajectories()).assign(word="abc")), *args) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_init_of_a_missing_file(tmp_path, capsys):
    assert init(tmp_path, str(tmp_path / "no.csv")) == 2
    assert "does not exist" in capsys.readouterr().err


def test_parsers():
    assert parse_units("mm, deg") == Units({"length": "mm", "angle": "deg"})
    assert parse_columns("t=time_s, y=-Z") == {"t": ("time_s", 1.0), "y": ("Z", -1.0)}
    assert parse_shape("disk:0.03").radius == 0.03
    assert parse_shape("ellipse:0.035,0.025").semi_axes == (0.035, 0.025)
    assert parse_shape("rect:0.08,0.05").vertices == ((0.04, 0.025), (-0.04, 0.025), (-0.04, -0.025), (0.04, -0.025))
    assert len(parse_shape("polygon:0,0;1,0;0,1").vertices) == 3
    for text in ("disk:-1", "disk:a", "blob:1", "ellipse:1", "polygon:0,0;1,1", "square:"):
        with pytest.raises(UserError, match="--shape"):
            parse_shape(text)
