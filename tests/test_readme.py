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
from thesis_lib.critique.results.saved_model import load_model
from thesis_lib.docs.games import lead
from thesis_lib.effects import EFFECTS
from thesis_lib.ledger.format import read_ledger
from thesis_lib.resources import MACHINE, MEASURED, TOTAL, read_measured

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


@pytest.mark.parametrize("scale", ["quick", "default"])
def test_cpu_times_of_the_scales_are_those_measured(scale):
    minutes = round(read_measured(ROOT / MEASURED)[MACHINE][scale][TOTAL] / 60.0)
    assert re.search(rf"^\| {scale} \|.*\| {minutes} min \|$", README, re.M)


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


def test_shares_of_the_proof_are_those_of_the_stored_results():
    from thesis_lib.critique.proof.summary import summary

    table = summary().query("n > 0")
    said = re.findall(
        r"^\| .+? \| (law|mechanism|drake) \| ([\d.]+) % \| ([\d.]+) to ([\d.]+) % \| (\d+) \|", FINDINGS, re.M
    )
    found = {
        (r.source, int(r.n), *(round(100 * x, 1) for x in (r.measured, r.low, r.high))) for r in table.itertuples()
    }
    assert len(said) >= 6
    for source, share, low, high, n in said:
        assert (source, int(n), float(share), float(low), float(high)) in found


def test_noise_table_is_that_of_the_stored_figure():
    """Table 2.1, ours: the copy that the figure check holds the pipeline to."""
    stored = pd.read_csv(ROOT / "config/figures/default/common/figure_table_2_1.csv")
    said = re.findall(
        r"^\| (block|ellipse) \| (\d+) \| \S+ % \| (\S+) ± (\S+) % \| (\S+) \| (\S+) ± (\S+) % \| (\S+) \|$",
        FINDINGS,
        re.M,
    )
    assert len(said) == 8
    for shape, snr, *numbers in said:
        rows = stored[(stored["shape"] == shape) & (stored["snr"] == float(snr))].set_index("method")
        columns = ["mean_error", "mean_error_std", "error_over_bound"]
        found = [*rows.loc["arcs", columns], *rows.loc["arcs_law", columns]]
        assert [float(x) for x in numbers] == pytest.approx(found, abs=0.0051)


def test_named_physics_table_is_that_of_the_stored_figure():
    stored = pd.read_csv(ROOT / "config/figures/default/planar_impact/figure_named_physics.csv")
    mean = stored.query("panel == 'a'").set_index("model")["mean"]
    said = re.findall(r"^\| [a-z ]+ \| (\S+) m/s \| (\S+) m/s \| (\S+) m/s \|$", FINDINGS, re.M)
    assert len(said) == 2
    for base, row in zip(("law", "effects"), said):
        found = mean[[base, f"{base}_rigid", f"{base}_wrench"]]
        assert [float(x) for x in row] == pytest.approx(list(found), abs=0.0006)


def test_classes_of_learned_models_are_those_of_the_stored_run():
    stored = pd.read_csv(ROOT / "config/reference/chapter4/learning_classes.csv").set_index("statement")
    text = " ".join(FINDINGS.split())
    said = re.search(
        r"class II errs (\S+) ± (\S+) times \(rigid\) and (\S+) ± (\S+) times \(wrench\) as much as class I\. "
        r"With ten, class I errs (\S+) ± (\S+) % more \(rigid\) and (\S+) ± (\S+) % more \(wrench; not told apart\)",
        text,
    )
    assert said, "the findings have lost the comparison of classes I and II"
    numbers = [float(x) for x in said.groups()]
    many = stored.loc[["residual_rigid_over_rigid", "residual_wrench_over_wrench"], ["value", "std"]].to_numpy()
    few = stored.loc[["rigid_over_residual_few", "wrench_over_residual_few"], ["value", "std"]].to_numpy()
    assert numbers[:4] == pytest.approx(many.ravel(), abs=0.00051)
    more = 100.0 * (few - [1.0, 0.0])
    assert numbers[4:6] == pytest.approx(more[0], abs=0.051) and numbers[6:] == pytest.approx(more[1], abs=0.51)
    assert more[0, 0] > 2.0 * more[0, 1] and not more[1, 0] > 2.0 * more[1, 1]


DICE = ROOT / "config/results/chapter4/planar_dice"
DICE_NAMES = {
    "law alone": "law",
    "law + wrench residual (the thesis's way)": "residual_wrench",
    "the critique's law": "critique",
    "contacts that take time": "compliant",
    "the same + residual": "compliant_residual",
}


def test_dice_table_is_that_of_the_stored_run():
    stored = pd.read_csv(DICE / "dice.csv").set_index(["model", "quantity"])["value"]
    said = re.findall(r"^\| ([^|]+?) \| (\S+) ± (\S+) \| (\d+) % \| (\S+) \|$", FINDINGS, re.M)
    assert [row[0] for row in said] == list(DICE_NAMES)
    for name, mean, std, face, score in said:
        own = stored[DICE_NAMES[name]]
        found = [own["mean"], own["std"], own["face_right"], own["log_score"]]
        numbers = [float(x.replace("−", "-")) for x in (mean, std, face, score)]
        assert numbers == pytest.approx([*found[:2], 100 * found[2], found[3]], abs=0.5)
        assert numbers[:2] == pytest.approx(found[:2], abs=0.0051)
        assert numbers[3] == pytest.approx(found[3], abs=0.0051)


def test_what_is_said_of_faces_and_beliefs_is_so_in_the_stored_run():
    coverage = pd.read_csv(DICE / "dice_calibration.csv").query("model == 'compliant_residual'")
    assert "all within 3 points" in FINDINGS
    # as shown, in whole per cent
    assert ((100 * coverage["coverage"]).round() - 100 * coverage["level"]).abs().max() <= 3.0 and len(coverage) == 6
    stored = pd.read_csv(DICE / "dice.csv").set_index(["quantity", "model"])
    said = " ".join(FINDINGS.split())
    assert "0.7 sides cannot be told from this, and six faces of ten, at its edge, hardly" in said
    faces, scatter = (stored.loc[(name, "compliant_residual")] for name in ("face_right", "std"))
    assert scatter["low"] < 0.7 < scatter["high"] and abs(faces["high"] - 0.6) < 0.005
    assert "more than eight of ten throws" in said and stored.loc["limit_face", "value"].min() > 0.8
    before = pd.read_csv(ROOT / "config/reference/chapter4/dice_before.csv")
    one, two, three = (100 * before[["part_0", "all"]]).round().astype(int).to_numpy()
    assert f"two draws named {one[0]} and {two[0]} % of its faces, and {one[1]} and {two[1]} % of all" in said
    assert f"With these it was {three[0]} and {three[1]} %, until" in said
    # "scatter less than any law does"
    start = pd.read_csv(DICE / "dice_budget.csv").query("contact == 0").set_index("model")["std"]
    assert start["nearest"] < start[["law", "residual", "residual_wrench", "critique"]].min()


def test_what_is_said_of_the_analytical_model_is_that_of_the_stored_run():
    dice = pd.read_csv(DICE / "dice.csv").set_index(["quantity", "model"])["value"]
    assert f"ours is one: −{dice['mean_certain', 'law']:.2f} along" in " ".join(FINDINGS.split())
    assert f"the {dice['mean', 'residual_wrench']:.2f} of the wrench residual is an overshoot" in " ".join(
        FINDINGS.split()
    )

    stored = pd.read_csv(DICE / "dice_readings.csv")
    name = {"as measured": "given", "mirrored": "mirrored"}
    table = FINDINGS[FINDINGS.index("dice_readings.csv -->") : FINDINGS.index("<!-- /readings -->")]
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in table.splitlines()[3:]]
    assert len(rows) == 3
    shown = stored.set_index(["rotation", "mu", "epsilon"])
    for rotation, mu, epsilon, error, right, chi2 in rows:
        own = shown.loc[(name[rotation], float(mu), float(epsilon))]
        assert error.replace("−", "-") == f"{own['mean']:.2f} ± {own['std']:.2f}"
        assert (right, chi2) == (f"{100 * own['face_right']:.0f} %", f"{own['chi2']:.1f}")
    # "the second alone of all is not told"; "with too many right faces"
    assert stored.query("chi2 < 7.8")[["rotation", "mu", "epsilon"]].to_numpy().tolist() == [["given", 0.3, 0.6]]
    assert len(stored.query("rotation == 'given'")) == 36
    wide = stored.query("rotation == 'mirrored' and 4 < std < 5 and mean < -0.4")
    assert (wide["face_right"] > 0.23 + 0.04).all()


def test_widths_of_a_belief_are_those_of_the_stored_figure(statuses):
    stored = pd.read_csv(ROOT / "config/figures/default/planar_dice/figure_4_4.csv").groupby("state", sort=False)["std"]
    said = re.search(
        r"is (\S+) sides at the start, (\S+) and (\S+) after the first and the second contact,\s(\S+) at rest", FINDINGS
    )
    assert [float(x) for x in said.groups()] == [float(f"{std:.2g}") for std in stored.first()]
    assert statuses["figure_4_4.contacts_are_the_main_source"] == "reproduced"


TREATMENT_NAMES = {
    "eq. 2.23 (`plain`)": "plain",
    "distance softened, eq. 2.13": "softened",
    "complementarity as cost, eq. 2.14": "complementary",
    "projected to contact": "projected",
}


def test_table_of_treatments_is_that_of_the_stored_run():
    stored = pd.read_csv(ROOT / "config/reference/chapter2/treatments.csv").set_index(["method", "snr", "shape"])
    start = FINDINGS.index("<!-- config/reference/chapter2/treatments.csv -->")
    table = FINDINGS[start : FINDINGS.index("<!-- /treatments -->")]
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in table.splitlines()[3:]]
    assert [row[0] for row in rows] == list(TREATMENT_NAMES)
    for name, *cells in rows:
        for snr, cell in zip((40.0, 30.0, 20.0, 10.0), cells, strict=True):
            for shape, said in zip(("block", "ellipse"), cell.split("; "), strict=True):
                own = stored.loc[(TREATMENT_NAMES[name], snr, shape), "median_error"]
                assert float(said.replace("−", "-").replace(",", "")) == pytest.approx(own, abs=0.051, rel=0.004)


BUDGET_NAMES = {
    "law alone": "law",
    "law + wrench residual": "residual_wrench",
    "contacts that take time": "compliant",
    "contacts that take time + residual": "compliant_residual",
    "nearest throws": "nearest",
    "most alike pairs": "pairs",
}


def test_budget_of_the_dice_is_that_of_the_stored_run():
    stored = pd.read_csv(DICE / "dice_budget.csv").set_index(["model", "contact"])
    table = FINDINGS[FINDINGS.index("<!-- budget -->") : FINDINGS.index("<!-- /budget -->")]
    rows = [line.strip("| ").split("|") for line in table.splitlines()[3:]]
    assert [row[0].strip() for row in rows] == list(BUDGET_NAMES)
    for name, *cells in rows:
        own = stored.loc[BUDGET_NAMES[name.strip()]].sort_index()
        said = [cell.strip() for cell in cells if cell.strip()]
        assert said == [f"{100 * face:.0f} %, {std:.2f}" for face, std in zip(own["face_right"], own["std"])], name
    # what is said of it
    models = stored.reset_index().query("model not in ('nearest', 'pairs')")
    start, past = (models[models["contact"] == k]["face_right"] for k in (0, 1))
    assert start.max() < 0.5 and past.between(0.7, 0.9).all()
    assert stored.loc[("nearest", 0), "face_right"] < stored.loc[("compliant", 0), "face_right"] - 0.1
    assert stored.loc[("nearest", 0), "std"] < 1.1 * stored.loc[("compliant", 0), "std"]


STUDY = ROOT / "config" / "reference" / "chapter5"


def test_sentences_on_engines_whose_drops_are_not_adequate_are_those_of_the_stored_rows():
    from thesis_lib.critique.engines.proof import ENOUGH, NOTHING

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


def test_sentences_on_engines_and_the_measured_die_are_those_of_the_stored_rows():
    rows = pd.read_csv(ROOT / "config/proof/models_measured.csv").set_index(["dataset", "model", "kind", "effects"])
    die = rows.loc["planar_dice"]

    def apart(kind: str, effects: str, of: tuple[str, str] = ("mujoco", "drake")) -> float:
        mu = [die.loc[(model, kind, effects), "mu"] for model in of]
        return max(mu) / min(mu)

    default = apart("friction", "without", ("mujoco:default", "drake:default"))
    fitted, named = (100.0 * (apart("engine", effects) - 1.0) for effects in ("without", "with"))
    said = " ".join(FINDINGS.split())
    assert f"frictions differ by a factor of {default:.1f} where each has its default contact" in said
    assert f"by {fitted:.0f} % once the contact is fitted, and by {named:.0f} % with the effects" in said
    laws = die[die.index.get_level_values("kind") == "law"]["error"]
    saved = [
        1.0 - die.loc[(name, "engine", "with"), "error"] / die.loc[(name, "engine", "without"), "error"]
        for name in ("mujoco", "drake")
    ]
    saved.append(1.0 - laws.xs("with", level="effects").min() / laws.xs("without", level="effects").min())
    assert f"{100 * saved[0]:.0f} % off MuJoCo's error and {100 * saved[1]:.0f} % off Drake's" in said
    assert f"off the best law's {100 * saved[2]:.0f} %" in said
    assert (die["error"] > 5.0 * die["noise_floor"]).all() and "None of these models comes near the noise" in said
    assert f"Of the die the first {die['trials'].max():.0f} throws are used" in said


def test_sentences_on_the_games_are_those_of_the_stored_study():
    games = pd.read_csv(STUDY / "study_games.csv").query("refused == 0")
    won = games.pivot(index="tower", columns=["policy", "size"], values="extractions")
    said = " ".join(FINDINGS.split())
    paired = pd.read_csv(STUDY / "study_paired.csv").query("policy == 'hma' and size == rival_size")

    def ahead(first: str, second: str) -> str:
        more = (won[first, 100] - won[second, 100]).dropna()
        return f"{more.mean():.1f} ± {more.sem():.1f}"

    def told(rival: str) -> list[int]:
        own = paired[(paired["rival"] == rival) & (paired["low"] > 0.0)]
        return sorted(own["size"])

    assert f"HMA brings out {lead('hma', 100, 'mor', 100)} blocks more than MOR" in said
    assert told("mor") == [100, 200, 1000] and "HMA leads MOR with 200 and with 1,000 samples, too" in said
    assert told("network") == [] and "From the network it is not told at any number of samples" in said
    needed = pd.read_csv(STUDY / "study_needed.csv").set_index("policy")
    assert needed["needed_high"].isna().all()
    mor, network = (needed.loc[name, ["needed", "needed_low"]].astype(int).tolist() for name in ("mor", "network"))
    assert f"in the mean MOR does with {mor[0]} and the network with {network[0]}, but" in said
    assert f"MOR may do so with {mor[1]} or need more than the 1,000 that were tried" in said
    assert f"and the network with {network[1]} or more than 1,000" in said
    nobody, everybody = lead("hma_without_cost", 100, "mor", 100), lead("hma", 100, "mor_with_cost", 100)
    assert f"are not told apart ({nobody}); where all have it, HMA leads MOR by {everybody}" in said
    worth = (ahead("hma", "hma_without_cost"), ahead("mor", "mor_with_cost"), ahead("network_with_cost", "network"))
    assert f"worth {worth[0]} blocks to HMA" in said and f"costs MOR {worth[1]}" in said
    assert f"nor loses with it that could be told ({worth[2]})" in said
    sizes = [[float(x) for x in text.split(" ± ")] for text in worth]
    assert all(mean > 2.0 * std for mean, std in sizes[:2]) and abs(sizes[2][0]) < 2.0 * sizes[2][1]
    curve = pd.read_csv(STUDY / "study_curve.csv").set_index(["policy", "size"])["mean"]
    learners = [won[name, size] for name in ("hma", "mor", "network") for size in (50, 100, 200, 300, 500, 1000)]
    assert {games.count() for games in learners} == {10} and "standard error over ten towers" in said
    assert max(curve[name, 50] for name in ("hma", "mor", "network")) < curve["exploration", 0]
    assert curve["ppo"].max() < curve["mor"].min()
    assert f"no policy brings out more than {won.max(axis=None):.0f} on any tower" in said
    n = (won["oracle", 0] - won["hma", 100]).count()
    more = (won["oracle", 0] - won["hma", 100]).dropna()
    assert f"oracle brings out {more.mean():.1f} ± {more.sem():.1f} more than HMA with 100 samples (n = {n})" in said
    shares = pd.read_csv(STUDY / "study_success.csv").query("action == 'extract'").set_index(["phase", "position"])
    numbers = re.search(
        r"in (\d+) % of the attempts in exploration and in (\d+) % with the learned model \(thesis: (\d+) and (\d+) %\)"
        r".* middle blocks \((\d+) %\) more than at side blocks \((\d+) %\); .* \((\d+) and (\d+) %\)",
        said,
    )
    whole, exploration = shares.xs("all", level="position"), shares.loc["exploration"]
    found = [*whole["share"], *whole["published"], *exploration.loc[["middle", "side"], "published"]]
    found += [*exploration.loc[["middle", "side"], "share"]]
    assert [int(x) for x in numbers.groups()] == [round(100 * x) for x in found]


def test_sentences_on_crossed_training_sets_are_those_of_the_stored_games():
    said = " ".join(FINDINGS.split())
    leads = pd.read_csv(STUDY / "crossed_leads.csv").set_index("rival")
    assert leads.loc["mor", "low"] > 0.0 > leads.loc["network", "low"] and "HMA's lead over MOR stands, and" in said
    games = pd.read_csv(STUDY / "crossed_games.csv").query("refused == 0")
    assert (games.groupby(["policy", "set"])["tower"].nunique() == leads["towers"].max()).all()
    by_set = games.groupby(["policy", "set"])["extractions"].mean().groupby("policy").agg(["min", "max"])
    ends = {name: f"{low:.1f} to {high:.1f}" for name, low, high in by_set.itertuples()}
    assert f"it brings out {ends['mor']} blocks (HMA {ends['hma']}, the network {ends['network']})" in said
    assert (by_set["max"] - by_set["min"]).idxmax() == "mor" and leads["sets"].eq(games["set"].nunique()).all()
    # the games of the study, played again
    study = pd.read_csv(STUDY / "study_games.csv").query("size == 100 and refused == 0")
    both = games.merge(study, on=["policy", "tower"], suffixes=("", "_study"))
    own = both[both["set"] == both["tower"] % games["set"].nunique()]
    same = (own["extractions"] == own["extractions_study"]).sum()
    readme = (STUDY / "README.md").read_text(encoding="utf-8")
    assert f"Of the {len(own)} games that the study has, too, {same} brought out" in " ".join(readme.split())


def test_sentences_on_switches_of_the_set_up_are_those_of_the_stored_games():
    said = " ".join(FINDINGS.split())
    effects = pd.read_csv(STUDY / "switch_effects.csv")
    assert set(effects["n"]) == {6} and effects["mean"].max() < 21.0
    changed = effects.set_index(["policy", "switch"])[["difference", "difference_low", "difference_high"]]

    def told(switch: str, sign: float, policy: str = "hma") -> str:
        ends = (sign * changed.loc[(policy, switch)]).to_numpy()
        value, low, high = ends[0], *sorted(ends[1:])
        return f"{value:.1f} ({low:.1f} to {high:.1f})".replace("-", "−")

    added = f"{told('exact_states', 1.0)} to HMA's and {told('exact_states', 1.0, 'mor')} to MOR's"
    assert f"States without noise add {added}" in said
    costs = f"costs HMA {told('three_quarters', -1.0)} and MOR {told('three_quarters', -1.0, 'mor')}."
    assert f"a push of 56 mm instead of 33 mm {costs}" in said
    fewer, ends = told("exploration", -1.0).split(" (")
    assert f"brings out {fewer} fewer ({ends}" in said
    learners = changed.loc[["hma", "mor", "network"]].dropna()
    assert (learners.drop("exact_states", level="switch")["difference"] < 0.0).all()
    sure = learners[(learners["difference_low"] > 0.0) | (learners["difference_high"] < 0.0)]
    assert list(sure.index) == [("hma", "three_quarters"), ("mor", "three_quarters")]
    means = effects.set_index(["policy", "switch"])["mean"]
    assert list((means["hma"] < means["mor"]).loc[lambda below: below].index) == ["exploration"]
    success = pd.read_csv(STUDY / "switch_success.csv").query("position == 'all' and phase == 'exploration'")
    shares = (100.0 * success.set_index(["switch", "action"])[["share", "published"]]).round().astype(int)
    pushed, pulled = (shares.loc[("exploration", action)] for action in ("push", "extract"))
    before = [shares.loc[("none", action), "share"] for action in ("push", "extract")]
    assert f"completes {pushed['share']} % of its pushes and {pulled['share']} % of its extractions" in said
    published = f"(thesis: {pushed['published']} and {pulled['published']} %"
    assert f"{published}; ours without it: {before[0]} and {before[1]} %)" in said


def test_sentences_on_steering_are_those_of_the_stored_study():
    ends = pd.read_csv(ROOT / "config/reference/chapter5/showcase_steering.csv")
    stray = ends.pivot(index=["block", "edge"], columns="steered", values="stray")
    saved = stray[0] - stray[1]
    blocks = saved.groupby("block").mean()
    said = " ".join(FINDINGS.split())
    steered, straight = stray[1].max(), stray[0].max()
    assert f"within {steered:.1f} mm of the goal. Straight on they stray by up to {straight:.0f} mm," in said
    assert f"and by more in {(saved > 0).sum()} of {len(saved)} pairs; the mean over the {len(blocks)} blocks," in said
    assert f"{blocks.mean():.1f} ± {blocks.sem():.1f} mm, is too few to tell" in said
    assert blocks.mean() < 2.0 * blocks.sem()


def test_sentences_on_beliefs_and_experts_are_those_of_the_stored_tables():
    stored, said = ROOT / "config/reference/chapter5", " ".join(FINDINGS.split())
    belief = pd.read_csv(stored / "model_belief.csv").set_index("quantity")

    def told(row: pd.Series, digits: int, sign: float = 1.0) -> str:
        return f"{sign * row['value']:.{digits}f} ± {row['std']:.{digits}f}"

    resists, settles = belief.loc["stuck_resists"], belief.loc["easy_settles"]
    assert f"gain {told(resists, 2)}, as in figure 5-8" in said and resists["low"] > 0.0
    assert f"“easy move” ends at {told(settles, 2)}" in said
    assert (belief.loc[["stuck_no_block_first", "easy_no_block_first"], "value"] == 0.0).all()
    early, later = belief.loc["force_leads_early"], belief.loc["poses_gain_later"]
    assert f"forces give {told(early, 1)} nats more evidence" in said and early["low"] > 0.0
    assert f"displacements gain {told(later, 1)} nats a step: first forces" in said and later["low"] > 0.0

    curves = pd.read_csv(stored / "model_experts.csv")
    chosen = curves[curves["chosen"] == 1]
    few, many = (chosen[chosen["size"] == size] for size in (100, 1000))
    numbers = [sorted(part["experts"]) for part in (few, many)]
    assert f"Of {curves['experts'].min()} to {curves['experts'].max()} cross-validation takes" in said
    assert "takes {}, {} and {} with 100 samples of three training sets,".format(*numbers[0]) in said
    assert "{}, {} and {} with 1,000 (`model_experts.csv`)".format(*numbers[1]) in said
    gain = pd.read_csv(stored / "model_experts_summary.csv").set_index(["quantity", "size"]).loc["chosen_gain"]
    assert f"{told(gain.loc[1000], 1)} nats a sample better" in said and gain.loc[1000, "low"] > 0.0
    assert (many["cv"] > 2.0 * many["cv_std"]).all() and "each is better by two standard errors" in said
    assert f"With 100 they are {told(gain.loc[100], 1, -1.0)} worse, too noisy" in said and gain.loc[100, "high"] > 0.0
    assert "in cross-validation no mixture is better by two standard errors" in said
    few = curves[curves["size"] == 100]
    assert (few["cv"] <= 2.0 * few["cv_std"]).all()


def test_sentences_on_abstractions_and_unseen_effects_are_those_of_the_stored_tables():
    stored, said = ROOT / "config/reference/chapter5", " ".join(FINDINGS.split())
    sets = pd.read_csv(stored / "model_agreement.csv").query("set >= 0")
    assert (sets["n_stuck_abstractions"] >= 1).all() and set(sets["n_abstractions"]) == {2, 3}
    found = pd.read_csv(stored / "model_abstractions.csv").query("size >= 100")
    kinds = found.assign(kind=found["abstraction"].str.rstrip(" 12")).groupby(["size", "set"])["kind"].agg(set)
    assert all({"drags tower", "easy move"} <= kind <= {"drags tower", "easy move", "hard move"} for kind in kinds)
    assert "From 100 samples on every training set gives an abstraction of blocks that drag the tower" in said
    unseen = pd.read_csv(stored / "unseen_summary.csv").set_index("effect")
    assert list(unseen.index) == ["glued", "slippery", "heavy_tool"] and (unseen["new_abstraction"] == 0).all()
    p = unseen["p_value"]
    assert f"none is noticed (p = {p['glued']:.3f}, {p['slippery']:.2f} and {p['heavy_tool']:.2f})" in said
    failing, all_of = (unseen[f"{name}_affected"].sum() for name in ("failing", "pushes"))
    others, all_others = (unseen[f"{name}_others"].sum() for name in ("failing", "pushes"))
    assert f"Of {all_of} pushes with an effect {failing} fail the check, and of {all_others} without {others}." in said


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
