"""Inputs that once hung, crashed or passed a reader: each is refused, with the name of the file and the reason."""

import json
import os

import numpy as np
import pandas as pd
import pytest
import yaml

from tests.fuzz.readers import READERS
from thesis_lib.commands.comparison import read_run
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_model import read_states
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.foundation.files import read_cells, read_json, read_table
from thesis_lib.foundation.regular_file import FileProblem, MissingFile, read_bytes, regular_size
from thesis_lib.thesis.config import parse_config, read_config
from thesis_lib.thesis.ledger.reading import load_yaml


@pytest.fixture
def dataset(tmp_path):
    """A valid dataset folder with trajectories."""
    folder = tmp_path / "drops"
    folder.mkdir()
    for name, content in READERS["dataset"].samples()[0].items():
        (folder / name).write_bytes(content)
    return folder


def refusal(read, *arguments) -> str:
    with pytest.raises(UserError) as caught:
        read(*arguments)
    return str(caught.value)


class TestRegularFile:
    @pytest.mark.parametrize(
        ("place", "words"),
        [
            (lambda path: path.mkdir(), "is a folder"),
            (lambda path: os.mkfifo(path), "is a pipe or a device"),
            (lambda path: path.symlink_to("/dev/zero"), "is a pipe or a device"),
            (lambda path: path.symlink_to(path), "cannot be opened"),
            (lambda path: path.write_bytes(b"x" * 11), "has 11 bytes; the limit is 10"),
        ],
    )
    def test_what_is_no_file_of_that_size_is_not_opened(self, tmp_path, place, words):
        place(tmp_path / "a")
        assert words in refusal(read_bytes, tmp_path / "a", 10)

    def test_missing_and_impossible_names(self, tmp_path):
        (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
        for path in (tmp_path / "none", tmp_path / "dangling"):
            with pytest.raises(MissingFile):
                regular_size(path, 10)
        for name in ("a\x00b", "x" * 300):
            with pytest.raises(FileProblem, match="cannot be opened"):
                regular_size(tmp_path / name, 10)

    def test_a_file_that_claims_no_size_is_bounded_all_the_same(self):
        assert "has more than 10 bytes" in refusal(read_bytes, "/proc/self/status", 10)

    def test_links_are_followed_up_to_the_folder(self, tmp_path):
        folder = tmp_path / "in"
        folder.mkdir()
        (folder / "a").write_text("inside")
        (tmp_path / "b").write_text("outside")
        (folder / "good").symlink_to("a")
        (folder / "bad").symlink_to("../b")
        assert read_bytes(folder / "good", 10, folder) == b"inside"
        assert "leads out of its folder" in refusal(read_bytes, folder / "bad", 10, folder)
        assert read_bytes(folder / "bad", 10) == b"outside"


class TestDatasets:
    @pytest.mark.parametrize("name", ["dataset.yaml", "trajectories.csv"])
    def test_a_link_out_of_the_folder_is_not_followed(self, dataset, name):
        content = (dataset / name).read_bytes()
        (dataset.parent / "outside").write_bytes(content)
        (dataset / name).unlink()
        (dataset / name).symlink_to("../outside")
        assert f"{name}: is a link that leads out of its folder" in refusal(read_dataset, dataset)

    def test_a_pipe_is_not_waited_for(self, dataset):
        (dataset / "trajectories.csv").unlink()
        os.mkfifo(dataset / "trajectories.csv")
        assert "trajectories.csv: is a pipe or a device" in refusal(read_dataset, dataset)

    def test_a_loop_of_links_and_an_impossible_name(self, tmp_path):
        (tmp_path / "loop").symlink_to(tmp_path / "loop")
        for name in ("loop", "a\x00b", "x" * 300):
            assert "cannot be opened" in refusal(read_dataset, tmp_path / name)

    def test_very_many_columns(self, dataset):
        (dataset / "trajectories.csv").write_text(",".join(f"c{i}" for i in range(17_000)) + "\n1\n")
        assert "columns; the limit is 1,000" in refusal(read_dataset, dataset)

    def test_very_many_rows_that_are_none(self, dataset):
        (dataset / "trajectories.csv").write_text("trial,t,x,y,theta\n" + "\n" * 200_000)
        assert "more than 100,000 rows are empty" in refusal(read_dataset, dataset)

    def test_very_many_unknown_keys(self, dataset):
        (dataset / "dataset.yaml").write_text("".join(f"k{i}: 1\n" for i in range(5000)))
        assert "has 1001 problems" in refusal(read_dataset, dataset)

    def test_lists_in_parquet(self, dataset):
        (dataset / "trajectories.csv").unlink()
        columns = {name: [[0.0, 1.0]] * 3 for name in ("trial", "t", "x", "y", "theta")}
        pd.DataFrame(columns).to_parquet(dataset / "trajectories.parquet")
        assert "column trial holds lists" in refusal(read_dataset, dataset)


LAUGHS = "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LAUGHS, "with aliases expanded"),
        ("a: &a [*a]", "nested more than 20 levels"),
        ("[" * 5000, "nested more than 20 levels"),
        ("a: !!int ''", "is not valid YAML"),
        ("a: !!timestamp x", "is not valid YAML"),
        ("a: " + "9" * 5000, "is not valid YAML"),
        ("a: !!python/object/apply:os.getcwd []", "is not valid YAML"),
        ("\x00", "is not valid YAML"),
        ("a: 1\n---\nb: 1\n", "is not valid YAML"),
        ("seed: 1\nseed: 2\n", "the key 'seed' occurs in line 1 and again in line 2"),
    ],
)
@pytest.mark.parametrize("read", [read_config, load_yaml])
def test_yaml(tmp_path, read, text, words):
    (tmp_path / "a.yaml").write_text(text)
    told = refusal(read, tmp_path / "a.yaml")
    assert words in told and "a.yaml" in told


def test_yaml_that_is_no_text_and_aliases_that_are_few(tmp_path):
    (tmp_path / "a.yaml").write_bytes("seed: 1".encode("utf-16"))
    assert "is not UTF-8 text" in refusal(read_config, tmp_path / "a.yaml")
    (tmp_path / "a.yaml").write_text("a: &x [1, 2]\nb: *x\n")
    assert load_yaml(tmp_path / "a.yaml").content == {"a": [1, 2], "b": [1, 2]}


def test_a_configuration_with_very_many_mistakes_stays_readable():
    told = refusal(parse_config, {f"k{i}": 1 for i in range(5000)})
    assert "... and 4900 more" in told and len(told) < 40_000


class TestIntermediates:
    @pytest.mark.parametrize(
        ("name", "content", "words"),
        [
            ("a.csv", b"a,mu\n1,2\n3,4", "the last row was cut off"),
            ("a.csv", b"law,mu,n\nmirtich,0.1,10\nnewto", "the last row was cut off"),
            ("a.csv", b"a,mu\n1,2\n3\n", "line 3 has 1 cells instead of 2"),
            ("a.csv", b"a,mu\n1,2,3\n", "line 2 has 3 cells instead of 2"),
            ("a.csv", b"a,mu\n1,2\n3,0.4x\n", "column mu holds the text '0.4x'"),
            ("a.csv", b"mu,mu\n1,2\n", "two columns have the same name"),
            ("a.csv", b"a,mu\n1,\xff\n", "is not a CSV table"),
            ("a.csv", b'mu,"eps\n1,2', "is not a CSV table"),
            ("a.csv", b"", "is not a CSV table"),
        ],
    )
    def test_a_damaged_table_is_named(self, tmp_path, name, content, words):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(CorruptFileError) as caught:
            read_table(tmp_path / name)
        assert words in str(caught.value) and name in str(caught.value)
        assert "delete it and run again" in str(caught.value)

    @pytest.mark.parametrize(
        "content",
        [
            *(b"[" * 100_000, b"[]", b"NaN", b'{"a": NaN}', b'{"a": 1, "a": 2}', b'{"a": ' + b"9" * 5000 + b"}"),
            *(b'{"a": 1', b"\xff\xfe{}"),
        ],
    )
    def test_damaged_json_is_named(self, tmp_path, content):
        (tmp_path / "a.json").write_bytes(content)
        with pytest.raises(CorruptFileError, match=r"a\.json .* delete it and run again"):
            read_json(tmp_path / "a.json")

    def test_a_diagnosis_that_lacks_what_is_compared(self, tmp_path):
        good = json.loads(READERS["results"].samples()[1]["diagnosis.json"])
        (tmp_path / "diagnosis.json").write_text(json.dumps(good))
        assert read_run(tmp_path) == good
        for key in ("base_model", "effects", "error"):
            (tmp_path / "diagnosis.json").write_text(json.dumps(good | {key: 5}))
            assert "is not a diagnosis of schema 1" in refusal(read_run, tmp_path)

    def test_two_columns_of_a_name(self, tmp_path):
        (tmp_path / "a.csv").write_text(",".join(["a"] * 40_000) + "\n")
        assert "two columns have the same name" in refusal(read_cells, tmp_path / "a.csv")


class TestModels:
    @pytest.fixture
    def files(self, tmp_path):
        for name, content in READERS["model"].samples()[0].items():
            (tmp_path / name).write_bytes(content)
        return tmp_path / "model.json", tmp_path / "states.csv"

    def test_the_file_of_the_states_is_named(self, files):
        model, path = load_model(files[0]), files[1]
        states = read_states(path)
        assert np.isfinite(model.predict(states)["vx_post"]).all()
        assert "states.csv: The column vx" in refusal(model.predict, states.assign(vx=np.nan), "states.csv")
        path.write_text(states.astype(object).assign(vx="9" * 5000).to_csv(index=False))
        assert "vx" in refusal(model.predict, read_states(path), "states.csv")
        path.write_text("x,x\n1,2\n")
        assert "states.csv is not a CSV table" in refusal(read_states, path)

    def test_a_model_of_impossible_size(self, files):
        content = json.loads(files[0].read_text())
        content["rig"]["shape"]["semi_axes"] = [1e308, 1e308]
        files[0].write_text(json.dumps(content))
        assert "model.json holds numbers that cannot be computed with" in refusal(load_model, files[0])

    def test_a_model_with_a_million_keys_is_not_parsed(self, files):
        files[0].write_text(yaml.safe_dump({"a": "x" * 1_000_000}))
        assert "the limit is 1,000,000" in refusal(load_model, files[0])
