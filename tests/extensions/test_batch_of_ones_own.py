"""Processes of a batch load the same code as the command that began it; other code makes other results."""

import json
import sys
from pathlib import Path

import own_files
import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / "critique"))
from hidden_effects import injected_impacts

from thesis_lib.__main__ import main
from thesis_lib.commands.batch import criticise_folder
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.extensions.loading import load
from thesis_lib.foundation.errors import UserError

NAME = "slip_dependent_restitution"


@pytest.mark.slow
def test_a_batch_looks_for_an_effect_of_ones_own(own_effect, tmp_path, capsys):
    rigs = tmp_path / "rigs"
    for name, seed in (("one", 3), ("two", 4)):
        made = injected_impacts(name, 50, seed, "tangential_restitution", {"tangential_restitution.e_t": 0.4})
        write_dataset(made, rigs / name)
    words = ["critique", "--batch", str(rigs), "-o", str(tmp_path / "out"), "--jobs", "2"]
    words += ["--effect", NAME, "--effect", "tangential_restitution", "--effects", str(own_effect)]
    assert main(words) == 0
    for name in ("one", "two"):
        diagnosis = json.loads((tmp_path / "out" / name / "diagnosis.json").read_text())
        assert NAME in [effect["name"] for effect in diagnosis["effects"]]
        assert diagnosis["additions"][0]["file"] == "my_effects.py"
        assert "is a program, which runs now" in (tmp_path / "out" / f"{name}.log").read_text()
    capsys.readouterr()
    assert main(words) == 0 and "2 of 2 datasets are done already" in capsys.readouterr().err
    own_effect.write_text(own_files.EFFECT.replace("scale=0.05", "scale=0.06"), encoding="utf-8")
    assert main(words) == 0 and "done already" not in capsys.readouterr().err


def test_code_that_changes_while_a_batch_runs_stops_it(own_effect, tmp_path):
    additions = load([own_effect], say=lambda text: None)
    own_effect.write_text(own_files.EFFECT.replace("scale=0.05", "scale=0.06"), encoding="utf-8")
    with pytest.raises(UserError, match="changed since the batch began"):
        criticise_folder("nowhere", str(tmp_path), 0, None, [str(own_effect)], additions)
