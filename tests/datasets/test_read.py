"""Valid datasets are read as they are; every kind of fault gets the message that a user needs."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import yaml
from folders import header, impacts, only, problems, refusal, trajectories, write

from thesis_lib.datasets import dataset_of, read_dataset
from thesis_lib.datasets.format import tables
from thesis_lib.datasets.format.dataset import unwrap
from thesis_lib.datasets.format.impacts import COVARIANCE_COLUMNS
from thesis_lib.datasets.format.validate import DatasetError


def test_arrays_become_the_dataset_that_files_hold(tmp_path):
    tables = {"trajectories": trajectories(), "impacts": impacts()}
    read = read_dataset(write(tmp_path / "drops", header(), **tables))
    arrays = {name: {column: frame[column].to_numpy(copy=True) for column in frame} for name, frame in tables.items()}
    made = dataset_of({key: value for key, value in header().items() if key != "schema"}, **arrays)
    assert made.digest() == read.digest() and len(made.warnings) == len(read.warnings) == 1 and made.path is None
    arrays["impacts"]["vy_pre"][3] = np.nan
    with pytest.raises(DatasetError, match=r"impacts, column vy_pre, row 4: is empty or NaN"):
        dataset_of(header(), **arrays)
    with pytest.raises(DatasetError, match="neither is given"):
        dataset_of(header())
    with pytest.raises(DatasetError, match=r"body\.mas: unknown key"):
        dataset_of(header(body={**header()["body"], "mas": 1.0}), impacts=arrays["impacts"])


def table(make=trajectories, **changes):
    """A table with cells set: column -> {row index: value} or a whole column."""
    frame = make()
    for column, value in changes.items():
        if isinstance(value, dict):
            frame[column] = frame[column].astype(object)
            for row, cell in value.items():
                frame.loc[row, column] = cell
        else:
            frame[column] = value
    return frame


# --- valid datasets -----------------------------------------------------------------------------------------


def test_valid_dataset_is_read_without_warnings(tmp_path):
    dataset = read_dataset(write(tmp_path / "drops", trajectories=trajectories(), impacts=impacts(3, 1)))
    assert dataset.name == "drops"
    assert dataset.warnings == ()
    assert len(dataset.trials) == 3
    assert dataset.rate == 250.0
    pd.testing.assert_frame_equal(dataset.trajectories, trajectories(), check_dtype=False, rtol=1e-15)
    assert dataset.stated_impacts().r.shape == (3, 2)


def test_parquet_and_csv_give_the_same_dataset(tmp_path):
    csv = write(tmp_path / "a", trajectories=trajectories(), impacts=impacts())
    parquet = write(tmp_path / "b")
    trajectories().to_parquet(parquet / "trajectories.parquet", index=False)
    impacts().to_parquet(parquet / "impacts.parquet", index=False)
    a, b = read_dataset(csv), read_dataset(parquet)
    assert a.digest() == b.digest()
    assert a.digest() != read_dataset(write(tmp_path / "c", impacts=impacts(11))).digest()


def test_angles_are_made_continuous_within_each_trial_only(tmp_path):
    true = np.array([np.linspace(0.1, 6.0 * k, 40) for k in (1, -1, 2)]).ravel()
    wrapped = (true + np.pi) % (2.0 * np.pi) - np.pi
    dataset = read_dataset(write(tmp_path / "d", trajectories=table(theta=wrapped)))
    np.testing.assert_allclose(dataset.trajectories["theta"], true, atol=1e-12)  # rounding of a few turns
    trial = np.repeat([0, 1], 2)
    np.testing.assert_array_equal(unwrap(np.array([0.0, 3.2, 9.0, 9.1]), trial)[2:], [9.0, 9.1])
    np.testing.assert_array_equal(unwrap(true, np.repeat([0, 1, 2], 40)), true)
    np.testing.assert_allclose(unwrap(wrapped[:40], np.zeros(40)), np.unwrap(wrapped[:40]), atol=1e-12)


def test_optional_columns_blank_times_and_other_files_are_accepted(tmp_path):
    frame = impacts()
    frame["t"] = np.where(np.arange(len(frame)) % 2, np.nan, 0.1)
    frame["r_x"], frame["r_y"], frame["flags"] = 0.0, -0.04, ""
    frame.loc[3, "flags"] = "energy;cone"
    frame = pd.concat([frame, pd.DataFrame(1e-6, index=frame.index, columns=list(COVARIANCE_COLUMNS))], axis=1)
    folder = write(tmp_path / "d", impacts=frame, notes="anything,at,all\n1\n")
    dataset = read_dataset(folder)
    assert dataset.impacts["flags"].tolist()[2:5] == ["", "energy;cone", ""]
    assert dataset.stated_impacts().cov.shape == (len(frame), 9, 9)
    assert np.isnan(dataset.impacts["t"][1])


def test_impacts_that_were_left_out_keep_their_number(tmp_path):
    frame = table(impacts, impact={5: 4})  # 1, 2 and 3 of that trial could not be measured
    assert read_dataset(write(tmp_path, impacts=frame)).warnings == ()


def test_excel_habits_are_accepted(tmp_path):
    text = trajectories().to_csv(index=False, lineterminator="\r\n")
    quoted = ",".join(f'"{name}"' for name in text.splitlines()[0].split(","))
    folder = write(tmp_path / "d", trajectories="")
    content = "\ufeff" + quoted + text[text.index("\r\n") :] + "\r\n\r\n"
    (folder / "trajectories.csv").write_bytes(content.encode())
    assert len(read_dataset(folder).trajectories) == 120


def test_importing_the_package_is_cheap():
    code = "import sys, thesis_lib.datasets; sys.exit('scipy' in sys.modules or 'pandas' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --- files and YAML -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (shutil.rmtree, "the folder does not exist"),
        (lambda folder: (shutil.rmtree(folder), folder.write_text("")), "is a file, expected a folder"),
        (lambda folder: (folder / "dataset.yaml").unlink(), "dataset.yaml: the file is missing"),
        (lambda folder: (folder / "dataset.yaml").write_bytes(b"\xff\xfe\x00schema"), "is not UTF-8 text"),
        (lambda folder: (folder / "trajectories.csv").unlink(), "neither file exists"),
        (lambda folder: trajectories().to_parquet(folder / "trajectories.parquet"), "trajectories.parquet exists, too"),
    ],
    ids=["folder", "file", "header", "bytes", "table", "tables"],
)
def test_files_that_are_not_there_or_unclear(tmp_path, spoil, message):
    folder = write(tmp_path / "drops", trajectories=trajectories())
    spoil(folder)
    assert message in only(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("schema: 1\nbody: [1, 2\n", "is not valid YAML"),
        ("- 1\n- 2\n", "is a list, not a mapping"),
        ("", "is empty, not a mapping"),
        ("a: &x [1]\nb: *x\n", "line 2: uses a YAML alias"),
        ("a: " + "[" * 50 + "]" * 50, "is nested more than 20 levels deep"),
        ("#" * 1_000_001, "the limit is 1,000,000"),
        ("a: !!python/object/apply:os.getcwd []\n", "is not valid YAML"),
        ("schema: 2020-99-99\n", "is not valid YAML"),
        (yaml.safe_dump(header()) + "gravity: 9.8\n", "gravity: the key occurs twice (first in line"),
    ],
    ids=["syntax", "list", "empty", "alias", "deep", "large", "object", "date", "twice"],
)
def test_yaml_that_cannot_be_used(tmp_path, text, message):
    assert message in only(write(tmp_path, text, trajectories=trajectories()))


def changed(path: str, value) -> dict:
    """The header with the key at a dotted path set, or deleted where value is `del`."""
    content = header()
    *parents, key = path.split(".")
    at = content
    for parent in parents:
        at = at[parent]
    if value is del_:
        del at[key]
    else:
        at[key] = value
    return content


del_ = object()


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("gravityy", 9.81, "gravityy: unknown key"),
        ("gravityy", 9.81, "did you mean 'gravity'?"),
        ("body.radius_of_gyraton", 0.02, "did you mean 'radius_of_gyration'?"),
        ("body.shape.vertexes", [], "did you mean 'vertices'?"),
        ("noise.postion", 1e-4, "did you mean 'position'?"),
        ("surface.hight", 1.0, "did you mean 'height'?"),
        ("mass", 0.1, "it belongs under body"),
        ("colour", "red", "remove it; known keys here: schema"),
        ("schema", del_, "schema: the key is missing"),
        ("schema", 3, "schema: is 3, but must be 1 or 2"),
        ("schema", "1", "schema: is '1', but must be 1 or 2"),
        ("body", del_, "body: the key is missing"),
        ("body.radius_of_gyration", del_, "body.radius_of_gyration: the key is missing"),
        ("body.shape.kind", del_, "the key kind is missing"),
        ("body.shape.kind", "polygn", "did you mean 'polygon'?"),
        ("body.mass", -0.05, "body.mass: is -0.05, but must be above 0"),
        ("body.mass", 0, "is 0, but must be above 0"),
        ("body.mass", float("nan"), "is nan, but must be"),
        ("body.mass", "heavy", "is 'heavy', but must be a number"),
        ("body.homogeneous", "partly", "body.homogeneous: is 'partly', but must be true or false"),
        ("body.homogeneous", True, "body.homogeneous: true, but its uncertainty is not stated"),
        ("body.uncertainty", {"size": 2.0}, "body.uncertainty.size: is 2.0, but must be below 1"),
        ("body.uncertainty", {"inertia": 0}, "body.uncertainty.inertia: is 0, but must be above 0"),
        ("body.uncertainty", {"inertja": 0.1}, "did you mean 'inertia'?"),
        ("rate", -250, "rate: is -250, but must be above 0"),
        ("gravity", float("inf"), "is inf, but must be a finite number"),
        ("body.shape.vertices", [[0, 0], [1, 1], [2, 2]], "the polygon has no area"),
        ("noise", 3, "is 3, but must be a mapping"),
        ("noise.angle", -1, "noise.angle: is -1, but must be above 0"),
        ("body.shape.vertices", [[30, 30], [-30, 30], [-30, -30], [30, -30]], "millimetres?"),
        ("body.radius_of_gyration", 24.5, "is larger than the body, which reaches 0.04"),
        ("gravity", 9810.0, "9810 m/s² is more than on any planet"),
        ("noise.position", 0.3, "is larger than the body: millimetres?"),
    ],
)
def test_wrong_header_values(tmp_path, path, value, message):
    text = only(write(tmp_path, changed(path, value), trajectories=trajectories()))
    assert message in text
    assert "dataset.yaml" in text


def test_what_a_homogeneous_body_cannot_be(tmp_path):
    body = header()["body"] | {"homogeneous": True, "uncertainty": {"size": 0.005}}

    def read(name: str, **changes):
        return write(tmp_path / name, header(body=body | changes), trajectories=trajectories())

    assert read_dataset(read("square")).header.body.known("inertia") == pytest.approx(0.01)
    heavy_rim = only(read("rim", radius_of_gyration=0.026))
    assert "gives a moment of inertia +13 % off that of this shape with uniform density (0.0244949 m)" in heavy_rim
    assert "known to 1 %" in heavy_rim and "leave homogeneous out" in heavy_rim
    moved = [[x + 0.002, y] for x, y in body["shape"]["vertices"]]
    text = only(read("moved", shape={"kind": "polygon", "vertices": moved}))
    assert "its centroid is 2 mm from the origin" in text and "give the vertices from the centroid" in text
    # the same body, not said to be homogeneous, may be anything
    plain = body | {"homogeneous": False, "radius_of_gyration": 0.026}
    assert read_dataset(write(tmp_path / "plain", header(body=plain), trajectories=trajectories())).warnings == ()


def test_header_problems_name_the_line(tmp_path):
    text = "schema: 1\nbody:\n  shape: {kind: disk, radius: 0.03}\n  radius_of_gyration: 0.02\n  mass: -1\n"
    assert "dataset.yaml, line 5, body.mass:" in only(write(tmp_path, text, trajectories=trajectories()))


# --- tables -------------------------------------------------------------------------------------------------

CSV = trajectories().to_csv(index=False)
LINES = CSV.splitlines(keepends=True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "trajectories.csv: is empty"),
        (LINES[0], "has a header but no rows"),
        (CSV.replace(",", ";"), "columns are separated by ';', expected commas"),
        ("".join(LINES[1:]), "holds numbers, expected the column names"),
        (CSV.replace("theta", "y", 1), "column y: the name occurs more than once"),
        (CSV.replace("theta", "angle", 1), "column theta: missing"),
        (CSV[:-30].rsplit(",", 2)[0] + "\n", "the file may have been cut off"),
        (CSV.replace(LINES[6], LINES[6].strip() + ",7\n"), "row 7: 6 cells instead of 5"),
        ("".join([*LINES[:6], "\n", *LINES[6:]]), "row 7: the row is empty"),
        ('"' + CSV, "is not CSV text"),
    ],
    ids=["empty", "no rows", "semicolons", "no header", "twice", "missing", "truncated", "ragged", "blank", "quote"],
)
def test_files_that_are_no_table(tmp_path, text, message):
    assert message in refusal(write(tmp_path, trajectories=text))


def test_tables_that_are_not_text(tmp_path):
    folder = write(tmp_path, trajectories="")
    (folder / "trajectories.csv").write_bytes(b"trial,t,x,y,theta\n\xff\xfe,1,2,3,4\n")
    assert "trajectories.csv: is not CSV text" in only(folder)
    (folder / "trajectories.csv").unlink()
    (folder / "trajectories.parquet").write_bytes(b"PAR1 not really PAR1")
    assert "cannot be read as Parquet" in only(folder)


def test_oversized_tables_are_refused_before_reading(tmp_path, monkeypatch):
    folder = write(tmp_path, trajectories=trajectories())
    with (folder / "trajectories.csv").open("r+b") as file:
        os.truncate(file.fileno(), tables.MAX_BYTES + 1)  # sparse: takes no disk
    assert "the limit is 2,000,000,000" in only(folder)
    (folder / "trajectories.csv").unlink()
    trajectories().to_parquet(folder / "trajectories.parquet", index=False)
    monkeypatch.setattr(tables, "MAX_VALUES", 100)
    assert "states 120 rows of 5 columns; the limit is 100" in only(folder)


def test_unknown_columns(tmp_path):
    text = only(write(tmp_path / "a", trajectories=table(speed=1.0)))
    assert "column speed: unknown column" in text
    text = only(write(tmp_path / "b", impacts=impacts().assign(rx=0.0)))
    assert "did you mean 'r_x'?" in text
    text = refusal(write(tmp_path / "c", trajectories=trajectories().rename(columns={"theta": "Theta"})))
    assert "did you mean 'theta'?" in text


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"x": {3: "abc", 5: "1.2 m"}}, "column x, rows 5, 7: is not a number (first: 'abc')"),
        ({"y": {0: np.nan}}, "column y, row 2: is empty or NaN"),
        ({"theta": {i: np.nan for i in range(2, 9)}}, "column theta, rows 4, 5, 6, 7 and 3 more: is empty"),
        ({"x": {10: np.inf}}, "column x, row 12: is infinite"),
        ({"x": {10: 1e12}}, "column x, row 12: is beyond ±1e+09"),
        ({"trial": {4: 0.5}}, "column trial, row 6: is not a whole number"),
        ({"t": {5: 4 / 250.0}}, "column t, row 7: the time is the same as in the row before"),
        ({"t": {5: 0.0125}}, "column t, row 7: the time goes backwards"),
        ({"trial": {119: 0}}, "column trial, row 121: a trial begins again"),
        ({"trial": {i: 3 for i in range(115, 120)}}, "column trial, trial 3: fewer than 10 samples in a trial"),
    ],
)
def test_faulty_cells(tmp_path, changes, message):
    assert message in only(write(tmp_path, trajectories=table(**changes)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"impact": {5: 0}}, "columns trial and impact, row 7: the same impact of the same trial"),
        ({"impact": {5: -1}}, "column impact, row 7: within a trial, impact must count up from 0"),
        ({"impact": {4: 1, 5: 0}}, "column impact, row 7: within a trial, impact must count up from 0"),
        ({"impact": impacts()["impact"] + 1}, "column impact, rows 2, 3, 4, 5 and 20 more: within a trial"),
        ({"r_x": 0.0}, "column r_y: is missing although r_x is given"),
        ({"cov_x_x": 1.0}, "only 1 of the 45 covariance columns are given"),
        ({name: -1.0 for name in COVARIANCE_COLUMNS}, "a variance is negative"),
        ({"t": 0.5}, "an impact is not later than the one before it"),
        ({"trial": {23: 0}, "impact": {23: 2}}, "column trial, row 25: a trial begins again"),
    ],
)
def test_faulty_impacts(tmp_path, changes, message):
    assert message in refusal(write(tmp_path, impacts=table(impacts, **changes)))


def test_rate_that_contradicts_the_times(tmp_path):
    assert "but dataset.yaml has rate: 240 Hz" in only(write(tmp_path, header(rate=240.0), trajectories=table()))
    text = only(write(tmp_path, trajectories=table(t=trajectories()["t"] * 1000.0)))
    assert "t looks like milliseconds" in text
    content = {key: value for key, value in header().items() if key != "rate"}
    dataset = read_dataset(write(tmp_path / "ok", content, trajectories=trajectories()))
    assert dataset.rate == pytest.approx(250.0)


def test_all_problems_are_told_at_once(tmp_path):
    content = changed("body.mass", -1.0) | {"colour": "red"}
    frame = table(x={3: "abc"}, y={4: np.nan}, t={30: 0.01}, speed=1.0)
    found = problems(write(tmp_path, content, trajectories=frame, impacts=table(impacts, impact={5: -1})))
    text = "\n".join(map(str, found))
    for part in ("colour", "body.mass", "'abc'", "column y, row 6", "goes backwards", "speed", "impacts.csv"):
        assert part in text
    assert len(found) == 7


def test_a_disaster_stays_readable(tmp_path):
    content = header(**{f"key{i}": i for i in range(500)})
    with pytest.raises(DatasetError, match=r"\.\.\. and 400 more") as caught:
        read_dataset(write(tmp_path, content, trajectories=trajectories()))
    assert len(caught.value.problems) == 500


def test_lost_frames_and_stray_trials_are_warnings(tmp_path):
    frame = trajectories().drop(index=[7, 8, 9])
    dataset = read_dataset(write(tmp_path, trajectories=frame, impacts=impacts(5, 1)))
    texts = [str(problem) for problem in dataset.warnings]
    assert len(texts) == 2
    assert "column t, row 9: samples are missing before these rows" in texts[0]
    assert "these trials are not in trajectories.csv" in texts[1]


def test_a_last_row_without_a_line_break_is_a_warning(tmp_path):
    text = trajectories().to_csv(index=False)
    assert read_dataset(write(tmp_path / "a", trajectories=text + "\n\n")).warnings == ()
    (warning,) = read_dataset(write(tmp_path / "b", trajectories=text.rstrip("\n"))).warnings
    assert warning.where == "row 121" and "may have been cut off" in warning.what
