"""Another effect or law in the library changes no other number of a critique, but for those that count candidates."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / "critique"))
from hidden_effects import injected_impacts

import thesis_lib.figures.critique.pictures
import thesis_lib.report.critique.page
from thesis_lib.contact import CANDIDATE_LAWS, LAWS
from thesis_lib.critique import criticise
from thesis_lib.critique.drops import world as drops_world
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Effect, Parameter
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.impact_study import study as impact_study

SETTINGS = CritiqueSettings(folds=2, finalists=2, rivals=1, max_effects=2)
SEED = 20190906

# What counts candidates, and so may change when one is added.
# diagnosis.json: p-values against the largest gain of any candidate, sizes that would clear that null, the rows of the
# candidate itself
COUNTS_EFFECTS = (
    ("effects", "gain", "p_value"),
    ("detectable", "significant"),
    ("detectable", "smallest"),
    ("detectable", "drops_for_half"),
)
# comparison.csv: the best of all laws for each impact; budget.csv: what another law would gain, and what is left then
COUNTS_LAWS = {"comparison.csv": ("model", ["best_post_hoc"]), "budget.csv": ("part", ["choice_of_law", "rest"])}


class ThirdHarmonic(Effect):
    """Nothing like it is at work."""

    name = "third_harmonic"
    family = "contact_law"
    title = "restitution depends on three times the body angle"
    equation = "ε = ε₀ (1 + a sin 3θ)"
    parameters = (Parameter("a", "1", null=0.0, low=-0.9, high=0.9, scale=0.1),)

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + p["a"] * np.sin(3.0 * state.theta)), 0.0, 1.0)


def half_of_whittaker(space, mu, epsilon):
    """A law that no impact follows."""
    return tuple(0.5 * c for c in LAWS["whittaker"].impulse(space, mu, epsilon))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    def critique(name: str) -> Path:
        out = tmp_path_factory.mktemp("critiques") / name
        dataset = injected_impacts("made", 60, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.4})
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(thesis_lib.figures.critique.pictures, "pictures", lambda *args: {})
            patch.setattr(thesis_lib.report.critique.page, "report_html", lambda *args: "")
            criticise(dataset, settings=SETTINGS, seed=SEED).save(out)
        return out

    return critique


@pytest.fixture
def another_law(monkeypatch) -> str:
    """Name of a law that is in the library during the test."""
    law = replace(LAWS["whittaker"], name="half_of_whittaker", impulse=half_of_whittaker)
    monkeypatch.setitem(LAWS, law.name, law)
    return law.name


@pytest.fixture(scope="module")
def before(run) -> Path:
    return run("before")


def read(folder: Path, name: str) -> dict:
    return json.loads((folder / name).read_text(encoding="utf-8"))


def without(content: dict, path: tuple[str, ...]) -> None:
    """Take the value at a path away, in every item where there are lists."""
    for part in content if isinstance(content, list) else [content]:
        if len(path) == 1:
            part.pop(path[0])
        else:
            without(part[path[0]], path[1:])


@pytest.mark.slow
def test_an_effect_changes_only_what_counts_effects(run, before, monkeypatch):
    # in the middle of the library, so that a draw by position would show
    names = list(EFFECTS)
    effects = {name: EFFECTS[name] for name in names[:3]} | {"third_harmonic": ThirdHarmonic()} | EFFECTS
    monkeypatch.setattr(drops_world, "EFFECTS", effects)
    as_it_was = dict(EFFECTS)
    try:
        EFFECTS.clear()
        EFFECTS.update(effects)
        after = run("another effect")
    finally:  # in its order, which other tests see
        EFFECTS.clear()
        EFFECTS.update(as_it_was)
    for path in sorted(before.iterdir()):
        if path.name != "diagnosis.json":
            assert (after / path.name).read_bytes() == path.read_bytes(), path.name
    one, two = read(before, "diagnosis.json"), read(after, "diagnosis.json")
    assert one["verdict"] == "effects" and one["effects"][0]["name"] == "tangential_restitution"
    assert "third_harmonic" in [row["name"] for row in two["detectable"]]
    assert one != two  # it was tried
    two["detectable"] = [row for row in two["detectable"] if row["name"] != "third_harmonic"]
    for content in (one, two):
        for path in COUNTS_EFFECTS:
            without(content, path)
    assert one == two


@pytest.mark.slow
def test_a_law_changes_only_what_counts_laws(run, before, another_law, monkeypatch):
    laws = (CANDIDATE_LAWS[0], another_law, *CANDIDATE_LAWS[1:])
    monkeypatch.setattr(drops_world, "CANDIDATE_LAWS", laws)
    after = run("another law")
    for path in sorted(before.iterdir()):
        if path.name in COUNTS_LAWS:
            key, counting = COUNTS_LAWS[path.name]
            ours, theirs = (pd.read_csv(folder / path.name) for folder in (before, after))
            assert another_law in set(theirs[key]) or path.name == "budget.csv"
            ours, theirs = (t[~t[key].isin([*counting, another_law])].reset_index(drop=True) for t in (ours, theirs))
            pd.testing.assert_frame_equal(ours, theirs, check_exact=True)
        elif path.name != "diagnosis.json":
            assert (after / path.name).read_bytes() == path.read_bytes(), path.name
    one, two = read(before, "diagnosis.json"), read(after, "diagnosis.json")
    assert two["laws"].pop(another_law)
    assert one == two


def test_a_law_changes_no_ensemble_of_another(another_law):
    impacts = injected_impacts(
        "made", 30, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.0}
    ).stated_impacts()

    def table(laws: list[str]) -> pd.DataFrame:
        rng = generator(SEED, "any")
        found = impact_study.ensemble_table(impacts, laws, ("kinetic",), 5, rng)
        return found[found["law"] != another_law].reset_index(drop=True)

    pd.testing.assert_frame_equal(
        table(["mirtich", "whittaker"]), table(["mirtich", another_law, "whittaker"]), check_exact=True
    )
