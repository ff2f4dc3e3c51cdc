"""Each reader on generated input: what our writers wrote comes back, and anything else is refused by name."""

import contextlib
import csv
import io
import json
import math
import operator
import tempfile
import zipfile
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import pandas as pd
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.readers import READERS
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.header_file import load_header
from thesis_lib.datasets.format.validate import ValidationReport
from thesis_lib.datasets.format.write import header_text
from thesis_lib.datasets.read import read_dataset
from thesis_lib.datasets.sources.fetch import unpack
from thesis_lib.datasets.sources.published import SOURCES
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_cells, read_json, read_table, write_json, write_table
from thesis_lib.foundation.yaml_file import read_yaml
from thesis_lib.thesis.config import Config, read_config
from thesis_lib.thesis.ledger.format import read_ledger

few = settings(max_examples=40, deadline=None, derandomize=True)

finite = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(1e-300, 1e300)
text = st.text(st.characters(exclude_categories=("Cs",)), max_size=20)
plain = st.none() | st.booleans() | st.integers(-(2**70), 2**70) | st.floats() | text
tree = st.recursive(plain, lambda t: st.lists(t, max_size=4) | st.dictionaries(text, t, max_size=4), max_leaves=12)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("generated")


def either(read: Callable, *arguments, names: str) -> object:
    """What is read, or None where it is refused by name; any other error fails the test."""
    try:
        return read(*arguments)
    except UserError as error:
        assert names in str(error)
        return None


def same(a: object, b: object) -> bool:
    """Equal, NaN equal to NaN, and of the same types."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float) and isinstance(b, float) and math.isnan(a):
        return math.isnan(b)
    return type(a) is type(b) and a == b


def places(node: object, at: tuple = ()) -> list[tuple]:
    """Where the values of nested mappings and lists are."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    return [place for key, value in items for place in ((*at, key), *places(value, (*at, key)))]


def replaced(node: object, place: tuple, value: object) -> object:
    node = deepcopy(node)
    inner = node
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return node


class TestText:
    @few
    @given(st.binary(max_size=200) | text.map(str.encode))
    def test_any_bytes_are_yaml_or_refused(self, folder, content):
        (folder / "a.yaml").write_bytes(content)
        either(read_yaml, folder / "a.yaml", names="a.yaml")

    @few
    @given(tree)
    def test_plain_values_come_back_from_yaml(self, folder, value):
        # PyYAML writes a next line (U+0085) as it is, and reads it as a space: escaped it comes back
        raw = "\\u0085" not in json.dumps(value, default=str)
        (folder / "a.yaml").write_text(yaml.safe_dump(value, allow_unicode=raw), encoding="utf-8", newline="\n")
        assert same(read_yaml(folder / "a.yaml").content, value)

    @few
    @given(st.dictionaries(text, tree, max_size=4))
    def test_json_comes_back_unless_it_holds_no_numbers(self, folder, value):
        path = folder / "a.json"
        try:
            write_json(value, path)
        except ValueError:
            path.write_text(json.dumps(value))
            assert either(read_json, path, names="a.json") is None
        else:
            assert same(read_json(path), value)

    @few
    @given(st.binary(max_size=100) | tree.map(lambda value: json.dumps(value).encode()))
    def test_any_bytes_are_a_json_object_or_refused(self, folder, content):
        (folder / "a.json").write_bytes(content)
        value = either(read_json, folder / "a.json", names="a.json")
        assert value is None or isinstance(value, dict)


class TestTables:
    words = st.text(st.sampled_from("xy ,\"\n'é;"), max_size=6).map(lambda word: "w" + word)

    @few
    @given(st.lists(st.tuples(words, finite, st.integers(-(2**53), 2**53)), min_size=1, max_size=6))
    def test_results_come_back(self, folder, rows):
        table = pd.DataFrame(rows, columns=["law", "mu", "n"])
        write_table(table, folder / "a.csv")
        back = read_table(folder / "a.csv", ["law", "mu", "n"])
        assert back["law"].tolist() == table["law"].tolist() and back["n"].tolist() == table["n"].tolist()
        # CSV keeps nine digits
        assert all(math.isclose(a, b, rel_tol=1e-8, abs_tol=1e-300) for a, b in zip(back["mu"], table["mu"]))

    @few
    @given(st.lists(st.lists(text.map(lambda word: word.replace("\r", "")), min_size=2, max_size=2), max_size=5))
    def test_cells_come_back(self, folder, rows):
        out = io.StringIO(newline="")
        csv.writer(out, lineterminator="\n").writerows([["law", "mu"], *rows])
        (folder / "c.csv").write_text(out.getvalue(), encoding="utf-8", newline="")
        cells = read_cells(folder / "c.csv")
        assert cells.to_numpy().tolist() == rows and list(cells) == ["law", "mu"]

    @few
    @given(st.binary(max_size=100))
    def test_any_bytes_are_a_table_or_refused(self, folder, content):
        (folder / "b.csv").write_bytes(content)
        either(read_table, folder / "b.csv", names="b.csv")
        either(read_cells, folder / "b.csv", names="b.csv")


class TestDatasets:
    shapes = st.one_of(
        st.builds(lambda a, b: {"kind": "ellipse", "semi_axes": [a, b]}, positive, positive),
        st.builds(lambda r: {"kind": "disk", "radius": r}, positive),
    )
    walls = st.lists(
        st.fixed_dictionaries(
            {
                "name": st.from_regex(r"[a-z]{1,8}", fullmatch=True),
                "point": st.lists(st.floats(-28.0, 28.0), min_size=2, max_size=2),  # m, on a rig
                "normal": st.floats(-math.pi, math.pi).map(lambda angle: [math.cos(angle), math.sin(angle)]),
            }
        ),
        min_size=1,
        max_size=4,
        unique_by=lambda wall: wall["name"],
    )
    surroundings = st.fixed_dictionaries(
        {}, optional={"surface": st.fixed_dictionaries({}, optional={"height": finite}), "gravity": positive}
    ) | st.fixed_dictionaries({"surfaces": walls, "gravity": st.just(0.0)}, optional={"spin": positive})
    bodies = st.fixed_dictionaries(
        {
            "schema": st.just(1),
            "body": st.fixed_dictionaries(
                {"shape": shapes, "radius_of_gyration": positive}, optional={"mass": positive}
            ),
        },
        optional={
            "description": st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=200),
            "rate": positive,
            "noise": st.dictionaries(st.sampled_from(["position", "angle", "velocity"]), positive),
        },
    )

    @pytest.mark.slow
    @few
    @given(st.builds(operator.or_, bodies, surroundings))
    def test_a_header_comes_back(self, folder, content):
        header = Header.model_validate(content)
        (folder / "dataset.yaml").write_text(header_text(header), encoding="utf-8", newline="\n")
        report = ValidationReport()
        assert load_header(folder, report)[0] == header and not report.errors

    @few
    @given(st.data())
    def test_a_dataset_with_any_value_anywhere_is_read_or_refused(self, tmp_path_factory, data):
        folder = tmp_path_factory.mktemp("drops")
        sample = READERS["dataset"].samples()[data.draw(st.integers(0, 2))]
        header = yaml.safe_load(sample["dataset.yaml"])
        place = data.draw(st.sampled_from(places(header)))
        header = replaced(header, place, data.draw(tree))
        table = next(name for name in sample if name.endswith(".csv"))
        rows = [line.split(",") for line in sample[table].decode().splitlines()]
        row, column = (data.draw(st.integers(0, len(line) - 1)) for line in (rows, rows[0]))
        rows[row][column] = data.draw(text | finite.map(repr))
        spoilt = data.draw(st.sampled_from(["dataset.yaml", table]))
        for name, content in sample.items():
            (folder / name).write_bytes(content)
        new = {"dataset.yaml": yaml.safe_dump(header), table: "\n".join(map(",".join, rows)) + "\n"}[spoilt]
        (folder / spoilt).write_text(new, encoding="utf-8", newline="")
        either(read_dataset, folder, names=spoilt)


def model() -> dict:
    return json.loads(READERS["model"].samples()[0]["model.json"])


TYPED: dict[str, tuple[Callable[[], dict], Callable]] = {  # file -> what a valid one holds, and what reads it
    "config.yaml": (lambda: Config().model_dump(mode="json", by_alias=True), read_config),
    "claims.yaml": (lambda: yaml.safe_load(READERS["claims"].samples()[0]["claims.yaml"]), read_ledger),
    "model.json": (model, load_model),
}


@pytest.mark.parametrize("name", [pytest.param("config.yaml", marks=pytest.mark.slow), "claims.yaml", "model.json"])
@few
@given(st.data())
def test_a_typed_file_with_any_value_anywhere_is_read_or_refused(folder, name, data):
    make, read = TYPED[name]
    values = make()
    place = data.draw(st.sampled_from(places(values)))
    written = (json.dumps if name.endswith(".json") else yaml.safe_dump)(replaced(values, place, data.draw(tree)))
    (folder / name).write_text(written)
    either(read, folder / name, names=name)


@few
@given(st.floats(0.0, 10.0), st.floats(-0.1, 0.1), st.floats(1e-3, 1e3))
def test_a_model_comes_back(folder, mu, offset, size):
    content = model()
    content["parameters"]["mu"]["value"] = mu
    content["parameters"]["com_offset.c_x"]["value"] = offset
    content["rig"]["radius_of_gyration"] = size
    made = SavedModel.model_validate(content)
    made.save(folder / "model.json")
    assert load_model(folder / "model.json") == made


@few
@given(
    st.lists(
        st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), min_size=1, max_size=30), max_size=4
    )
)
def test_an_archive_writes_only_the_files_that_are_expected(names):
    with tempfile.TemporaryDirectory() as root:
        folder, expected = Path(root), "x/dice-data-processed/traj_0.csv"
        (folder / "out").mkdir()
        with zipfile.ZipFile(folder / "a.zip", "w") as archive:
            for name in {*names, *(f"../{name}" for name in names[1:]), expected}:
                archive.writestr(name, b"x")
        with contextlib.suppress(UserError):
            unpack(folder / "a.zip", SOURCES["planar_dice"], {"traj_0.csv": folder / "out" / "traj_0.csv"})
        found = {path.relative_to(folder).as_posix() for path in folder.rglob("*")}
        assert found <= {"a.zip", "out", "out/traj_0.csv"}
