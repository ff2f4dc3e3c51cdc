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

from tests.docs.tutorial_runner import compare
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.effects import EFFECTS
from thesis_lib.ledger.format import read_ledger

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
FINDINGS, BENCHMARKS, HARNESSES = (
    (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") for name in ("findings", "benchmarks", "harnesses")
)
LINES = 150  # of a front page


def test_it_is_a_front_page():
    assert len(README.splitlines()) <= LINES


def test_as_many_effects_are_looked_for_as_it_says():
    assert f"({len(EFFECTS)} are looked for)" in README


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
    assert {name for name, status in quick.items() if status == "not decided"} == undecided
    assert {name for name in quick if name in statuses and quick[name] != statuses[name]} <= undecided


# --- words that judge numbers, where a template fills the numbers in ---


def test_classes_of_learned_models_are_told_apart_as_it_says():
    stored = pd.read_csv(ROOT / "config/reference/chapter4/learning_classes.csv").set_index("statement")
    few = stored.loc[["rigid_over_residual_few", "wrench_over_residual_few"], ["value", "std"]].to_numpy() - [1.0, 0.0]
    assert few[0, 0] > 2.0 * few[0, 1] and not few[1, 0] > 2.0 * few[1, 1]


DICE = ROOT / "config/results/chapter4/planar_dice"
STUDY = ROOT / "config/reference/chapter5"


def test_what_is_said_of_faces_and_beliefs_is_so_in_the_stored_run(statuses):
    coverage = pd.read_csv(DICE / "dice_calibration.csv").query("model == 'compliant_residual'")
    assert "all within 3 points" in FINDINGS
    # as shown, in whole per cent
    assert ((100 * coverage["coverage"]).round() - 100 * coverage["level"]).abs().max() <= 3.0 and len(coverage) == 6
    stored = pd.read_csv(DICE / "dice.csv").set_index(["quantity", "model"])
    assert "0.7 sides cannot be told from this, and six faces of ten, at its\nedge, hardly" in FINDINGS
    faces, scatter = (stored.loc[(name, "compliant_residual")] for name in ("face_right", "std"))
    assert scatter["low"] < 0.7 < scatter["high"] and abs(faces["high"] - 0.6) < 0.005
    assert "more than eight of ten throws" in FINDINGS and stored.loc["limit_face", "value"].min() > 0.8
    # "scatter less than any law does"
    start = pd.read_csv(DICE / "dice_budget.csv").query("contact == 0").set_index("model")["std"]
    assert start["nearest"] < start[["law", "residual", "residual_wrench", "critique"]].min()
    # "contacts are the main source"
    assert statuses["figure_4_4.contacts_are_the_main_source"] == "reproduced"


def test_what_is_said_of_the_analytical_model_is_so_in_the_stored_run():
    stored = pd.read_csv(DICE / "dice_readings.csv")
    # "the second alone of all is not told"; "with too many right faces"
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
    from thesis_lib.critique.proof.engines import ENOUGH
    from thesis_lib.critique.proof.store import NOTHING

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


def test_what_is_said_of_the_games_is_so_in_the_stored_study():
    games = pd.read_csv(STUDY / "study_games.csv").query("refused == 0")
    won = games.pivot(index="tower", columns=["policy", "size"], values="extractions")
    said = " ".join(FINDINGS.split())
    paired = pd.read_csv(STUDY / "study_paired.csv").query("policy == 'hma' and size == rival_size")

    def told(rival: str) -> list[int]:
        own = paired[(paired["rival"] == rival) & (paired["low"] > 0.0)]
        return sorted(own["size"])

    assert told("mor") == [100, 200, 1000] and "HMA leads MOR with 200 and with 1,000 samples, too" in said
    assert told("network") == [] and "From the network it is not told at any number of samples" in said
    assert pd.read_csv(STUDY / "study_needed.csv")["needed_high"].isna().all()
    pairs = [("hma", "hma_without_cost"), ("mor", "mor_with_cost"), ("network_with_cost", "network")]
    worth = [(won[first, 100] - won[second, 100]).dropna() for first, second in pairs]
    apart = [more.mean() > 2.0 * more.sem() for more in worth]
    assert apart == [True, True, False] and "neither gains nor loses with it that could be told" in said
    curve = pd.read_csv(STUDY / "study_curve.csv").set_index(["policy", "size"])["mean"]
    learners = [won[name, size] for name in ("hma", "mor", "network") for size in (50, 100, 200, 300, 500, 1000)]
    assert {games.count() for games in learners} == {10} and "standard error over ten towers" in said
    assert max(curve[name, 50] for name in ("hma", "mor", "network")) < curve["exploration", 0]
    assert curve["ppo"].max() < curve["mor"].min()


def test_what_is_said_of_crossed_training_sets_is_so_in_the_stored_games():
    leads = pd.read_csv(STUDY / "crossed_leads.csv").set_index("rival")
    assert leads.loc["mor", "low"] > 0.0 > leads.loc["network", "low"] and "HMA's lead over MOR stands, and" in FINDINGS
    games = pd.read_csv(STUDY / "crossed_games.csv").query("refused == 0")
    assert (games.groupby(["policy", "set"])["tower"].nunique() == leads["towers"].max()).all()
    by_set = games.groupby(["policy", "set"])["extractions"].mean().groupby("policy").agg(["min", "max"])
    assert (by_set["max"] - by_set["min"]).idxmax() == "mor" and leads["sets"].eq(games["set"].nunique()).all()
    # the games of the study, played again
    study = pd.read_csv(STUDY / "study_games.csv").query("size == 100 and refused == 0")
    both = games.merge(study, on=["policy", "tower"], suffixes=("", "_study"))
    own = both[both["set"] == both["tower"] % games["set"].nunique()]
    same = (own["extractions"] == own["extractions_study"]).sum()
    readme = (STUDY / "README.md").read_text(encoding="utf-8")
    assert f"Of the {len(own)} crossed games that the study has, too, {same} brought out" in " ".join(readme.split())


def test_what_is_said_of_switches_of_the_set_up_is_so_in_the_stored_games():
    effects = pd.read_csv(STUDY / "switch_effects.csv")
    assert set(effects["n"]) == {6} and effects["mean"].max() < 21.0
    changed = effects.set_index(["policy", "switch"])
    learners = changed.loc[["hma", "mor", "network"]].dropna(subset="difference")
    assert (learners.drop("exact_states", level="switch")["difference"] < 0.0).all()
    sure = learners[(learners["difference_low"] > 0.0) | (learners["difference_high"] < 0.0)]
    assert list(sure.index) == [("hma", "three_quarters"), ("mor", "three_quarters")]
    means = changed["mean"]
    assert list((means["hma"] < means["mor"]).loc[lambda below: below].index) == ["exploration"]


def test_what_is_said_of_beliefs_experts_and_steering_is_so_in_the_stored_tables():
    belief = pd.read_csv(STUDY / "model_belief.csv").set_index("quantity")
    assert (belief.loc[["stuck_no_block_first", "easy_no_block_first"], "value"] == 0.0).all()
    assert (belief.loc[["stuck_resists", "force_leads_early", "poses_gain_later"], "low"] > 0.0).all()
    curves, said = pd.read_csv(STUDY / "model_experts.csv"), " ".join(FINDINGS.split())
    many = curves.query("chosen == 1 and size == 1000")
    assert (many["cv"] > 2.0 * many["cv_std"]).all() and "each is better by two standard errors" in said
    gain = pd.read_csv(STUDY / "model_experts_summary.csv").set_index(["quantity", "size"]).loc["chosen_gain"]
    assert gain.loc[1000, "low"] > 0.0 and gain.loc[100, "high"] > 0.0 > gain.loc[100, "value"]
    assert "in cross-validation no mixture is better by two standard errors" in said
    few = curves[curves["size"] == 100]
    assert (few["cv"] <= 2.0 * few["cv_std"]).all()
    stray = pd.read_csv(STUDY / "showcase_steering.csv").pivot(
        index=["block", "edge"], columns="steered", values="stray"
    )
    blocks = (stray[0] - stray[1]).groupby("block").mean()
    assert blocks.mean() < 2.0 * blocks.sem()


def test_what_is_said_of_abstractions_and_unseen_effects_is_so_in_the_stored_tables():
    sets = pd.read_csv(STUDY / "model_agreement.csv").query("set >= 0")
    assert (sets["n_stuck_abstractions"] >= 1).all() and set(sets["n_abstractions"]) == {2, 3}
    found = pd.read_csv(STUDY / "model_abstractions.csv").query("size >= 100")
    kinds = found.assign(kind=found["abstraction"].str.rstrip(" 12")).groupby(["size", "set"])["kind"].agg(set)
    assert all({"drags tower", "easy move"} <= kind <= {"drags tower", "easy move", "hard move"} for kind in kinds)
    assert "From 100 samples on every training set gives an abstraction of blocks that drag the tower" in FINDINGS
    unseen = pd.read_csv(STUDY / "unseen_summary.csv").set_index("effect")
    assert list(unseen.index) == ["glued", "slippery", "heavy_tool"] and (unseen["new_abstraction"] == 0).all()


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

    (said,) = PRINTED
    compare(said, outputs[2])
    assert outputs[4].startswith("vx_seen,vy_seen,omega_seen,vx_post,vy_post,omega_post\n")
