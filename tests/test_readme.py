"""The README and the pages behind it say what is: numbers, commands, paths and code."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from matplotlib.image import imread

from tests.docs.tutorial_runner import compare
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.effects import effects_in
from thesis_lib.mechanics.space import PLANE, SPACE
from thesis_lib.thesis.ledger.format import read_ledger

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
FINDINGS, BENCHMARKS, HARNESSES = (
    (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") for name in ("findings", "benchmarks", "harnesses")
)
LINES = 150  # of a front page


def test_it_is_a_front_page():
    assert len(README.splitlines()) <= LINES


def test_as_many_effects_are_looked_for_as_it_says():
    assert f"(of {len(effects_in(PLANE))} in the plane, {len(effects_in(SPACE))} in space)" in README


def test_benchmarks_are_six_rows_of_all():
    begin, end = "<!-- benchmarks -->", "<!-- /benchmarks -->"
    shown, every = (text.split(begin)[1].split(end)[0].splitlines() for text in (README, BENCHMARKS))
    assert sum(line.startswith("| ") for line in shown) == 1 + 6  # a heading
    assert set(shown) <= set(every)


@pytest.fixture(scope="module")
def statuses() -> dict[str, str]:
    text = (ROOT / "config" / "claims_expected.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)["expected"]["default"]


def test_scales_that_disagree_say_that_the_quick_one_cannot_tell(statuses):
    text = (ROOT / "config" / "claims_expected.yaml").read_text(encoding="utf-8")
    quick = yaml.safe_load(text)["expected"]["quick"]
    undecided = {claim.id for claim in read_ledger(ROOT / "config/claims").claims if claim.quick}
    hidden = {name for name, status in quick.items() if status == "not decided"}
    assert hidden >= undecided
    assert {name for name in quick if name in statuses and quick[name] != statuses[name]} <= hidden


# --- words that judge numbers, where a template fills the numbers in ---


def test_classes_of_learned_models_are_told_apart_as_it_says():
    stored = pd.read_csv(ROOT / "config/reference/chapter4/learning_classes.csv").set_index("statement")
    few = stored.loc[["rigid_over_residual_few", "wrench_over_residual_few"], ["value", "std"]].to_numpy() - [1.0, 0.0]
    assert few[0, 0] > 2.0 * few[0, 1] and not few[1, 0] > 2.0 * few[1, 1]


DICE = ROOT / "config/results/chapter4/planar_dice"


def test_what_is_said_of_faces_and_beliefs_is_so_in_the_stored_run(statuses):
    coverage = pd.read_csv(DICE / "dice_calibration.csv").query("model == 'compliant_residual'")
    assert "all within 3 points" in FINDINGS
    # as shown, in whole per cent
    assert ((100 * coverage["coverage"]).round() - 100 * coverage["level"]).abs().max() <= 3.0 and len(coverage) == 6
    stored = pd.read_csv(DICE / "dice.csv").set_index(["quantity", "model"])
    assert "the first is missed by four points, within the interval, and the second is met within its own" in FINDINGS
    faces, scatter = (stored.loc[(name, "compliant_residual")] for name in ("face_right", "std"))
    assert scatter["low"] < 0.7 < scatter["high"] and round(100 * (0.6 - faces["value"])) == 4
    assert round(faces["high"], 2) >= 0.6
    assert "more than eight of ten throws" in FINDINGS and stored.loc["limit_face", "value"].min() > 0.8
    # "scatter less than any law does"
    start = pd.read_csv(DICE / "dice_budget.csv").query("contact == 0").set_index("model")["std"]
    assert start["nearest"] < start[["law", "residual", "residual_wrench", "critique"]].min()
    # "contacts are the main source"
    assert statuses["figure_4_4.contacts_are_the_main_source"] == "reproduced"


def test_what_is_said_of_the_analytical_model_is_so_in_the_stored_run():
    stored = pd.read_csv(DICE / "dice_readings.csv")
    # "only the second is indistinguishable"; "with too many right faces"
    assert stored.query("chi2 < 7.8")[["rotation", "mu", "epsilon"]].to_numpy().tolist() == [["given", 0.3, 0.6]]
    wide = stored.query("rotation == 'mirrored' and 4 < std < 5 and mean < -0.4")
    assert (wide["face_right"] > 0.23 + 0.04).all()


def test_what_is_said_of_the_budget_of_the_dice_is_so_in_the_stored_run():
    stored = pd.read_csv(DICE / "dice_budget.csv").set_index(["model", "contact"])
    models = stored.reset_index().query("model not in ('nearest', 'pairs')")
    start, past = (models[models["contact"] == k]["face_right"] for k in (0, 1))
    assert start.max() < 0.5 and past.between(0.7, 0.9).all()
    assert stored.loc[("nearest", 0), "face_right"] < stored.loc[("compliant", 0), "face_right"] - 0.1
    assert stored.loc[("nearest", 0), "std"] < 1.1 * stored.loc[("compliant", 0), "std"]


def test_sentences_on_engines_whose_drops_are_not_adequate_are_those_of_the_stored_rows():
    from thesis_lib.studies.proof.engines import ENOUGH
    from thesis_lib.studies.proof.store import NOTHING

    rows = pd.read_csv(ROOT / "config/proof/engines.csv").fillna({"named": ""})
    left = rows[rows["own"] >= ENOUGH * rows["floor"]]
    told = {"com_offset_x": "com_offset", "size_error": "wrong_size", "tilt": "surface_tilt", NOTHING: ""}
    assert (left["named"] == left["truth"].map(told)).all() and (left["best"] == left["engine"]).all()
    rolling = left[(left["engine"] == "mujoco") & (left["shape"] == "ellipse")]
    numbers = ("two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
    n, of_them = numbers[len(left) - 2], numbers[len(rolling) - 2]
    said = " ".join(FINDINGS.split())
    assert f"In the {n} sets that are not *adequate* the verdict is right and the engine is recognised" in said
    assert f"{of_them.capitalize()} of the {n} are MuJoCo's ellipses that roll to rest" in said


def test_no_model_comes_near_the_noise_of_the_measured_die():
    rows = pd.read_csv(ROOT / "config/proof/models_measured.csv").query("dataset == 'planar_dice'")
    assert (rows["error"] > 5.0 * rows["noise_floor"]).all() and "None of these models comes near the noise" in FINDINGS


@pytest.mark.parametrize(
    "target", sorted(set(re.findall(r"(?:`|^    )make ([a-z-]+)", README + HARNESSES + BENCHMARKS, re.M)))
)
def test_make_targets_exist(target):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.search(rf"^{target}:", makefile, re.M), f"make {target}"


@pytest.mark.parametrize(
    "path", sorted(set(re.findall(r"`((?:thesis_lib|config|tests|\.ci)/[\w./*-]+)`", README + FINDINGS + HARNESSES)))
)
def test_paths_exist(path):
    assert list(ROOT.glob(path.rstrip("/"))) or "<" in path, path


def test_the_library_example_runs():
    code = re.search(r"```python\n(.*?)```", README, re.S).group(1)
    space: dict = {}
    exec(code.split("critique = ")[0], space)
    assert space["out"].v_post.shape == (1, 3) and space["out"].status.tolist() == [0]
    assert callable(space["criticise"]) and callable(space["fit"])


@pytest.mark.parametrize("command", ["fetch", "init", "check", "example"])
def test_dataset_commands_exist(command, capsys):
    from thesis_lib.commands.datasets import main

    assert f"thesis-lib datasets {command}" in README
    with pytest.raises(SystemExit) as stopped:
        main([command, "--help"])
    assert stopped.value.code == 0 and command in capsys.readouterr().out


# --- from a misfit to its cause ---

WALK = README.split("## From a misfit to its cause")[1].split("\n## ")[0]
COMMANDS = [line.strip() for line in re.findall(r"^    (thesis-lib .*)$", WALK, re.M)]
PRINTED = re.findall(r"```text\n(.*?)```", WALK, re.S)
HIDDEN = 0.0005  # m, com_offset_x of the example


@pytest.mark.slow
def test_five_commands_lead_from_a_misfit_to_its_cause_and_a_fallen_error(tmp_path):
    assert len(COMMANDS) == 5
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    outputs = []
    for command in COMMANDS:
        line = command.replace("thesis-lib", f"{shlex.quote(sys.executable)} -m thesis_lib", 1)
        done = subprocess.run(
            line, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        outputs.append(done.stdout)

    runs = tmp_path / "results" / "critique"
    content = json.loads((runs / "example" / "diagnosis.json").read_text())
    error, (effect,) = content["error"], content["effects"]
    assert content["verdict"] == "effects" and effect["name"] == "com_offset"
    assert effect["indistinguishable_from"] == []
    c_x = effect["parameters"]["c_x"]
    assert abs(c_x["value"] - HIDDEN) < 3.0 * c_x["std"] < 0.05 * HIDDEN
    assert error["base"] > 2.5 * error["noise_floor"]
    assert error["augmented"] < 1.2 * error["noise_floor"]
    fixed = json.loads((runs / "example_fixed" / "diagnosis.json").read_text())
    assert fixed["error"]["augmented"] == pytest.approx(error["augmented"], rel=0.01)

    data = tmp_path / "data" / "example"
    for name in ("dataset.yaml", "trajectories.csv", "new_impacts.csv"):  # no hint of what was hidden
        assert not re.search("com|offset|hidden", (data / name).read_text()), name
    new = pd.read_csv(data / "new_impacts.csv")
    after = load_model(runs / "example" / "model.json").predict(new)
    k_g = yaml.safe_load((data / "dataset.yaml").read_text())["body"]["radius_of_gyration"]
    d = [after[f"{name}_post"] - after[f"{name}_seen"] for name in ("vx", "vy", "omega")]
    unseen = np.sqrt(d[0] ** 2 + d[1] ** 2 + (k_g * d[2]) ** 2)
    assert len(unseen) == 40 and unseen.mean() < 0.1 * error["base"]

    for name in ("ladder", "candidates"):  # letters may be drawn a little otherwise elsewhere
        shown, drawn = imread(ROOT / "docs" / f"example_{name}.png"), imread(runs / "example" / f"{name}.png")
        assert shown.shape == drawn.shape and np.abs(shown - drawn).mean() < 0.005, name

    (said,) = PRINTED
    compare(said, outputs[2])
    assert outputs[4].startswith("vx_seen,vy_seen,omega_seen,vx_post,vy_post,omega_post\n")
