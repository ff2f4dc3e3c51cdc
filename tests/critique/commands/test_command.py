"""`thesis-lib critique`, `predict` and `effects`: what they print, write, and how they say no."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from report_pages import leave_page_out

from thesis_lib.__main__ import main
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation import SEED
from thesis_lib.foundation.kernels import KERNELS
from thesis_lib.thesis.config import Config

FILES = (
    *("comparison.csv", "errors.csv", "ladder.csv", "budget.csv", "impacts.csv"),
    *("where.json", "diagnosis.json", "model.json", "report.html"),
)


@pytest.fixture(scope="module")
def dataset_folder(impacts_dataset, tmp_path_factory) -> Path:
    return write_dataset(impacts_dataset, tmp_path_factory.mktemp("data") / "my_drops", float_format=None)


@pytest.fixture(scope="module")
def run_folder(dataset_folder, tmp_path_factory) -> Path:
    """What one command writes, without pictures."""
    out = tmp_path_factory.mktemp("out") / "my_run"
    with pytest.MonkeyPatch.context() as patch:
        leave_page_out(patch)
        assert main(["critique", str(dataset_folder), "-o", str(out), "-q"]) == 0
    return out


def test_the_default_seed_is_that_of_the_configuration():
    assert Config().seed == SEED


def test_effects_lists_the_whole_library(capsys):
    assert main(["effects"]) == 0
    text = capsys.readouterr().out
    for effect in EFFECTS.values():
        assert f"  {effect.name}: {effect.title}" in text and effect.equation in text
    assert main(["effects", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [entry["name"] for entry in listed] == list(EFFECTS)


@pytest.mark.slow
def test_critique_writes_every_file_and_names_the_effect(run_folder):
    assert set(FILES) <= {path.name for path in run_folder.iterdir()}
    assert not [path for path in run_folder.iterdir() if path.name.startswith(".")]
    content = json.loads((run_folder / "diagnosis.json").read_text())
    assert content["verdict"] == "effects" and content["effects"][0]["name"] == "tangential_restitution"
    for name in ("comparison", "errors", "ladder", "budget", "impacts"):
        assert len(pd.read_csv(run_folder / f"{name}.csv")) > 0
    for path in run_folder.iterdir():  # no path of this machine in any output
        assert str(run_folder.parent) not in path.read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_library_writes_the_same_bytes_as_the_command(dataset_folder, run_folder, tmp_path):
    """In a process of its own that sets nothing: seed, kernels and threads of the numbers are those of the command."""
    code = (
        "import sys\nfrom thesis_lib.critique import criticise\n"
        "import thesis_lib.figures.critique.pictures as pictures, thesis_lib.report.critique.page as page\n"
        "pictures.pictures, page.report_html = lambda *args: {}, lambda *args: '<html></html>\\n'\n"
        "criticise(sys.argv[1]).save(sys.argv[2])\n"
    )
    free = {name: value for name, value in os.environ.items() if name not in {*KERNELS, "OMP_NUM_THREADS"}}
    subprocess.run([sys.executable, "-c", code, str(dataset_folder), str(tmp_path / "again")], env=free, check=True)
    for name in FILES:
        assert (tmp_path / "again" / name).read_bytes() == (run_folder / name).read_bytes(), name


def test_the_chosen_effect_is_switched_on_and_text_goes_to_stdout(without_page, dataset_folder, tmp_path, capsys):
    out = tmp_path / "run"
    command = ["critique", str(dataset_folder), "-o", str(out), "--effect", "wrong_inertia", "--seed", "3"]
    assert main([*command, "--trials", "60", "--jobs", "2"]) == 0
    shown = capsys.readouterr()
    assert "wrong_inertia.d_I" in shown.out and "report.html" in shown.out
    assert shown.err == ""  # progress is for terminals, and for logs once a minute
    content = json.loads((out / "diagnosis.json").read_text())
    assert content["n_trials"] == 60
    assert [(effect["name"], effect["clears"]) for effect in content["effects"]] == [("wrong_inertia", False)]
    assert "Switched on by you: wrong inertia; these data do not support it" in shown.out


def test_predictions_are_a_table_or_json_on_stdout_or_in_a_file(run_folder, tmp_path, capsys):
    """Of a throw, of the mirrored one, whose outcome is the mirrored one, and of a body that moves away."""
    sides = {"theta": [0.3, -0.3, 0.3], "vx": [0.5, -0.5, 0.5], "vy": [-2.0, -2.0, 2.0], "omega": [5.0, -5.0, 5.0]}
    pd.DataFrame({"x": 0.0, "y": 0.03} | sides).to_csv(tmp_path / "states.csv", index=False)
    command = ["predict", str(run_folder / "model.json"), str(tmp_path / "states.csv")]
    to_file = ["-o", str(tmp_path / "out.csv")]
    assert main(command) == 0
    text = capsys.readouterr().out
    table = pd.read_csv(io.StringIO(text))
    assert table["vx_post"][:2].sum() == pytest.approx(0.0, abs=1e-8)
    assert table["vy_post"].diff()[1] == pytest.approx(0.0, abs=1e-8)
    assert main([*command, *to_file]) == 0 and (tmp_path / "out.csv").read_text() == text
    capsys.readouterr()
    assert main([*command, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["n"] == 3 and told["status"] == {"not_approaching": 1, "ok": 2}
    assert told["effects"] == ["tangential_restitution"]
    assert [row["vy_post"] > 0.0 for row in told["predictions"]] == [True, True, True]
    assert main([*command, "--json", *to_file]) == 0
    assert "predictions" not in json.loads(capsys.readouterr().out)


def test_an_interruption_is_one_line_and_130(dataset_folder, tmp_path, capsys, monkeypatch):
    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("thesis_lib.critique.run.criticise", interrupted)
    assert main(["critique", str(dataset_folder), "-o", str(tmp_path / "out")]) == 130
    assert capsys.readouterr() == ("", "interrupted\n")


def test_two_runs_are_compared_in_standard_errors(run_folder, tmp_path, capsys):
    other = tmp_path / "repaired"
    other.mkdir()
    content = json.loads((run_folder / "diagnosis.json").read_text())
    mu = content["augmented_model"]["parameters"]["mu"]
    mu["value"] += 10.0 * mu["std"]
    content["effects"] = []
    (other / "diagnosis.json").write_text(json.dumps(content))
    assert main(["critique", str(run_folder), str(other), "-o", str(tmp_path / "both")]) == 0
    text = capsys.readouterr().out
    assert "my_run" in text and "repaired" in text
    assert "Different by more than 3 standard errors: mu." in text
    table = pd.read_csv(tmp_path / "both" / "compare.csv").set_index("quantity")
    assert float(table.loc["mu", "sigmas"]) == pytest.approx(10.0 / np.sqrt(2.0), rel=1e-3)
    assert table.loc["effects", "b"] == "none"
    assert np.isnan(table.loc["tangential_restitution.e_t", "sigmas"])


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (["critique", "nowhere"], "nowhere"),
        (["critiqe", "nowhere"], "no command critiqe; did you mean 'critique'?"),
        ([], "a command is missing"),
        (["critique", "a", "b", "c"], "one dataset, or two"),
        (["critique", "DATA", "--effect", "gravity_waves"], "no effect 'gravity_waves'"),
        (["critique", "DATA", "--effect", "linear_drag"], "cannot test the effect linear_drag: no trajectories"),
        (["critique", "DATA", "--seed", "-1"], "--seed"),
        (["critique", "DATA", "--jobs", "0"], "--jobs must be above 0"),
        (["critique", "DATA", "--trials", "0"], "--trials must be above 0"),
        (["critique", "DATA", "--trials", "9", "--batch"], "--trials takes the first trials of one dataset"),
        (["critique", "DATA", "-o", "DATA"], "is the dataset itself"),
        (["critique", "RUN"], "written by a critique"),
        (["predict", "nowhere.json", "states.csv"], "no model"),
        (["predict", "RUN/model.json", "nowhere.csv"], "nowhere.csv does not exist"),
        (["predict", "RUN/model.json", "RUN/ladder.csv"], "lack the column"),
        (["predict", "RUN/diagnosis.json", "RUN/ladder.csv"], "not a model"),
    ],
)
def test_mistakes_get_one_readable_block_and_exit_code_2(
    command, says, dataset_folder, run_folder, capsys, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    command = [part.replace("DATA", str(dataset_folder)).replace("RUN", str(run_folder)) for part in command]
    assert main(command) == 2
    shown = capsys.readouterr()
    assert says in shown.err and "Traceback" not in shown.err
    assert shown.out == ""
    assert not list(tmp_path.iterdir())


def test_a_run_that_fails_while_writing_leaves_an_earlier_one_as_it_was(
    of_impacts, without_page, tmp_path, monkeypatch
):
    folder = tmp_path / "run"
    folder.mkdir()
    for name in FILES:
        (folder / name).write_text("earlier")

    def fail(*args):
        raise OSError("disk full")

    monkeypatch.setattr(SavedModel, "save", fail)
    with pytest.raises(OSError, match="disk full"):
        of_impacts.save(folder)
    assert {path.name: path.read_text() for path in folder.iterdir()} == dict.fromkeys(FILES, "earlier")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_a_run_that_is_killed_while_moving_its_files_in_is_seen_as_unfinished(
    of_impacts, without_page, tmp_path, monkeypatch, capsys
):
    folder = tmp_path / "run"
    of_impacts.save(folder)
    move = Path.replace

    def killed(self, target):
        if Path(target) == folder / "model.json":
            raise KeyboardInterrupt
        return move(self, target)

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        of_impacts.save(folder)
    left = {path.name for path in folder.iterdir()}
    assert left and not left & {"diagnosis.json", "model.json", "report.html"}
    assert main(["critique", str(folder), str(folder)]) == 2
    assert "unfinished run" in capsys.readouterr().err
    assert main(["predict", str(folder / "model.json"), "states.csv"]) == 2


def test_files_of_an_earlier_critique_are_taken_away_and_those_of_others_stay(of_impacts, without_page, tmp_path):
    for name in ("residuals.png", "flights.csv", "choices.csv", "notes.txt", "my_plot.png"):
        (tmp_path / name).write_text("old")
    of_impacts.save(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert {"notes.txt", "my_plot.png", "diagnosis.json"} <= names and "residuals.png" not in names
    for name in ("flights.csv", "choices.csv"):
        assert not (tmp_path / name).exists() or (tmp_path / name).read_text() != "old"


@pytest.mark.slow
def test_the_public_face_is_the_function_whatever_was_imported_before():
    code = (
        "from thesis_lib.critique.drops.criticise import DropsCritique\n"
        "from thesis_lib.critique import criticise\n"
        "assert callable(criticise) and criticise.__name__ == 'criticise'\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    light = "import sys, thesis_lib.critique\nassert 'scipy' not in sys.modules and 'pandas' not in sys.modules\n"
    subprocess.run([sys.executable, "-c", light], check=True)
