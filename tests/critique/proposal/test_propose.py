"""A law that no effect names, hidden in impacts: it is proposed, with its sign; nothing is where nothing is hidden.

By the command it is written, and added with --effects the error falls.  Every term holds its units and the contract of
effects; the file that is written is the effect that was fitted.
"""

import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hidden_effects import injected_impacts

from tests.extensions.own_files import library  # noqa: F401 -- effects that a test adds are forgotten after it
from thesis_lib.__main__ import main
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.proposal.effect_file import VARIABLES, effect_of, phi, source
from thesis_lib.critique.proposal.propose import Proposal, _TermSearch, propose, regress
from thesis_lib.critique.proposal.results import content_of, proposal_path, sentences, text_of, write_source
from thesis_lib.critique.proposal.terms import FACTORS, Factor, Term, all_terms
from thesis_lib.critique.selection import discovery
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.extensions.contract import outcomes
from thesis_lib.extensions.effect_contract import EFFECT_CHECKS
from thesis_lib.extensions.effect_probe import RIGS, predict, random_states
from thesis_lib.extensions.loading import read_file, require_contracts, results
from thesis_lib.extensions.registry import NAME
from thesis_lib.foundation.files import write_json

HIDDEN, SIZE = "restitution_by_obliquity", -0.4
IMPACTS = 150
SETTINGS, STRICT = SearchSettings(), SearchSettings(material_floor=1e3)
TERMS = all_terms()
COMPOSES, DESCRIBED = "works together with every effect of the library", "explains its symbols and names a source"
FAST = [check for check in EFFECT_CHECKS if check.name not in (COMPOSES, DESCRIBED)]


def term(name: str) -> Term:
    return next(term for term in TERMS if term.name == name)


def criticised(name: str, size: float, seed: int = 3) -> DropsCritique:
    data = injected_impacts("hidden", IMPACTS, seed, effect_of(term(name)), {f"{name}.a": size})
    return criticise_drops(data, rng=np.random.default_rng(seed))


@pytest.fixture(scope="module")
def hidden() -> DropsCritique:
    return criticised(HIDDEN, SIZE)


@pytest.fixture(scope="module")
def nothing() -> DropsCritique:
    return criticised(HIDDEN, 0.0, 0)


@pytest.fixture(scope="module")
def proposal(hidden: DropsCritique) -> Proposal:
    found = propose(hidden, np.random.default_rng(0))
    assert found is not None
    return found


@pytest.mark.slow
def test_the_hidden_term_is_proposed_with_its_size_where_nothing_named_explains_it(
    hidden: DropsCritique, proposal: Proposal
) -> None:
    assert hidden.verdict == "unexplained" and hidden.is_structured
    (one,) = proposal.terms
    assert one.term.name == HIDDEN and one.step.p_value <= 0.01 and one.step.gain[1] > 0.0
    a, std = (getattr(proposal.fitted, of)[f"{HIDDEN}.a"] for of in ("values", "std"))
    assert abs(a - SIZE) < 4.0 * std
    assert proposal.after.error.mean() < 1.25 * proposal.after.floor < 0.5 * proposal.before.error.mean()
    assert proposal.held_out_gain[1] > 0.0


def test_what_had_stood_in_for_it_leaves(hidden: DropsCritique, proposal: Proposal) -> None:
    search = _TermSearch(hidden, np.random.default_rng(0), str)
    world, base, values = search.world, proposal.fitted.base, proposal.fitted.values
    (step,) = (one.step for one in proposal.terms)
    steps, effects = [], (EFFECTS["contact_torque"], *proposal.fitted.effects)
    for i, effect in enumerate(effects, 1):
        fitted = world.fit(base, effects[:i], values, "near")
        steps.append(replace(step, effect=effect, fitted=fitted, judged=search.evidence.judge(fitted)))
    path = discovery.Path(base, steps[-1].fitted, steps[-1].judged, steps)
    search.drop_superfluous(path, "immaterial")
    assert path.fitted.effects == proposal.fitted.effects and not proposal.kept
    assert path.barred == {"contact_torque"}


@pytest.mark.slow
def test_the_held_out_trials_may_strike_a_term(hidden: DropsCritique, nothing: DropsCritique) -> None:
    """Held-out trials on which the model without it is as good: those of drops with nothing hidden."""
    other = replace(hidden, held_out=nothing.held_out)
    assert propose(other, np.random.default_rng(0)) is None


@pytest.mark.slow
def test_the_same_stream_gives_the_same_proposal(hidden: DropsCritique, proposal: Proposal) -> None:
    again = propose(hidden, np.random.default_rng(0))
    assert again is not None and again.fitted.values == proposal.fitted.values
    assert again.held_out_gain == proposal.held_out_gain


def test_the_content_and_the_file(proposal: Proposal, tmp_path: Path) -> None:
    content = content_of(proposal, "drops_proposal.py")
    assert content is not None
    write_json(content, tmp_path / "proposal.json")
    stored = json.loads((tmp_path / "proposal.json").read_text())
    assert stored["terms"][0]["equation"] == "ε = ε₀ (1 + a |v_t|/v)"
    assert stored["error"]["after"] < stored["error"]["before"]
    said = " ".join(sentences({"proposal": content}, SETTINGS))
    assert "drops_proposal.py" in said and "−0.4" in said
    for settings, word in ((SETTINGS, "falls from"), (STRICT, "hardly changes, from")):
        assert f"error {word}" in " ".join(sentences({"proposal": content}, settings))
        assert f"error {word}" in text_of(proposal, settings)
    file = write_source(proposal, tmp_path / "drops_proposal.py", SETTINGS)
    ((_, name, found),) = results(read_file(file, say=str))
    assert name == HIDDEN and all(outcome.verdict == "pass" for outcome in found)


def test_edits_of_an_earlier_file_stay(proposal: Proposal, tmp_path: Path) -> None:
    first = write_source(proposal, tmp_path / "own.py", SETTINGS)
    assert write_source(proposal, tmp_path / "own.py", SETTINGS) == first
    first.write_text("mine = 1\n", encoding="utf-8")
    second = write_source(proposal, tmp_path / "own.py", SETTINGS)
    assert second != first and first.read_text(encoding="utf-8") == "mine = 1\n"
    assert second.read_text(encoding="utf-8") == text_of(proposal, SETTINGS)


def test_the_regression_finds_it_in_every_half(hidden: DropsCritique) -> None:
    world = Drops(hidden.training)
    fitted = world.fit("anitescu_potra_newton", ())
    tests, share = regress(world, fitted, TERMS, np.random.default_rng(0))
    assert share[HIDDEN] > 0.9
    assert tests.p_value(tests.gain[HIDDEN]) <= 0.001


@pytest.mark.slow
def test_nothing_is_proposed_where_nothing_is_hidden(nothing: DropsCritique) -> None:
    """Asked for though the critique would not ask."""
    assert nothing.verdict == "adequate"
    assert propose(nothing, np.random.default_rng(0)) is None
    assert content_of(None, "") is None and "none is proposed" in sentences({"proposal": None}, SETTINGS)[0]


@pytest.mark.slow
def test_a_couple_that_follows_the_motion_is_found() -> None:
    critique = criticised("couple_by_turning", -0.3, 5)
    found = propose(critique, np.random.default_rng(5))
    assert found is not None and found.terms[0].term.name == "couple_by_turning"
    assert found.fitted.values["couple_by_turning.a"] == pytest.approx(-0.3, rel=0.15)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    effect = effect_of(term(HIDDEN))
    folder = tmp_path_factory.mktemp("drops") / "hidden"
    write_dataset(injected_impacts("hidden", 100, 3, effect, {f"{HIDDEN}.a": SIZE}), folder)
    return folder


@pytest.mark.slow
@pytest.mark.usefixtures("without_pictures")
def test_from_unexplained_to_a_law_that_has_a_form(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["critique", str(data), "-o", str(out), "-q"]) == 0
    told = capsys.readouterr().out
    first = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    file = tmp_path / "out_proposal.py"
    assert first["verdict"] == "unexplained" and first["proposal"]["terms"][0]["name"] == HIDDEN
    assert first["proposal"]["file"] == file.name and file == proposal_path(out)
    assert "ε = ε₀ (1 + a |v_t|/v)" in told and f"--effects {file}" in told
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "A term that is proposed" in page and "|v_t|/v" in page

    assert main(["effects", "--check", str(file)]) == 0
    assert main(["critique", str(data), "-o", str(tmp_path / "with"), "-q", "--effects", str(file)]) == 0
    second = json.loads((tmp_path / "with" / "diagnosis.json").read_text(encoding="utf-8"))
    assert second["verdict"] == "effects" and [effect["name"] for effect in second["effects"]] == [HIDDEN]
    assert second["effects"][0]["parameters"]["a"]["value"] == pytest.approx(SIZE, rel=0.05)
    assert second["error"]["augmented"] == pytest.approx(first["proposal"]["error"]["after"], rel=0.05)
    assert second["error"]["augmented"] < 0.5 * second["error"]["base"]
    assert "proposal" not in second


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--propose", "own.txt"], "ends in .py"),
        (["--propose", "own.py", "--batch"], "give one dataset"),
        (["--propose", "there.py"], "exists already"),
        (["--propose", "DATA/own.py"], "a folder with data"),
    ],
)
def test_what_cannot_be_written_is_said_before_anything_is_computed(
    options: list[str],
    said: str,
    data: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.py").write_text("mine = 1\n", encoding="utf-8")
    options = [option.replace("DATA", str(data)) for option in options]
    assert main(["critique", str(data), *options, "-q"]) == 2
    assert said in capsys.readouterr().err
    assert (tmp_path / "there.py").read_text(encoding="utf-8") == "mine = 1\n"


def test_the_file_lies_beside_the_results(tmp_path: Path) -> None:
    assert proposal_path(tmp_path / "a" / "my_drops").name == "my_drops_proposal.py"
    assert proposal_path(tmp_path / "a" / "my_drops").parent == tmp_path / "a"
    (tmp_path / "drops").mkdir()
    (tmp_path / "drops" / "dataset.yaml").write_text("schema: 1\n")  # -o inside the dataset itself
    assert proposal_path(tmp_path / "drops" / "out" / "first") == tmp_path / "first_proposal.py"


@pytest.mark.slow
@pytest.mark.parametrize("target", ["epsilon", "mu", "direction", "couple"])
def test_every_term_is_an_effect(target: str) -> None:
    """Each factor alone, and a third of the products: all are made in the same way."""
    alone, products = ([term for term in TERMS if term.target == target and len(term.factors) == n] for n in (1, 2))
    for term in (*alone, *products[::3]):
        for outcome in outcomes(FAST, effect_of(term)):
            assert outcome.verdict == "pass", f"{term.name}: {outcome.check}: {outcome.reason}"


@pytest.mark.parametrize("term", TERMS[::17], ids=lambda term: term.name)
def test_terms_work_together_with_the_library(term: Term) -> None:
    (outcome,) = outcomes([check for check in EFFECT_CHECKS if check.name == COMPOSES], effect_of(term))
    assert outcome.verdict == "pass", outcome.reason


@pytest.mark.parametrize("factor", FACTORS, ids=lambda factor: factor.name)
def test_factors_have_no_unit(factor: Factor) -> None:
    """In mm and ms instead of m and s every factor is what it was, but those over a fixed speed."""
    rng = np.random.default_rng(0)
    si = {name: rng.uniform(0.5, 2.0, 5) * np.array([1, -1, 1, -1, 1]) for name in ("v_t", "v_n", "r_x", "x", "omega")}
    si |= {"v": np.hypot(si["v_t"], si["v_n"]), "k": 0.02, "beta": rng.uniform(-3, 3, 5), "trial": np.arange(5.0)}
    length, time = 1e3, 5e2
    by = {"v_t": length / time, "v_n": length / time, "v": length / time, "r_x": length, "x": length, "k": length}
    by["omega"] = 1.0 / time
    other = {name: value * by.get(name, 1.0) for name, value in si.items()}
    one, two = (phi(Term("epsilon", (factor,)), values) for values in (si, other))
    assert np.allclose(one, two) == (factor.group != "speed")


def test_names_titles_and_groups() -> None:
    names = [term.name for term in TERMS]
    assert len(set(names)) == len(names) == len({term.title for term in TERMS})
    assert all(NAME.fullmatch(name) for name in names) and not set(names) & set(EFFECTS)
    assert not {term.title for term in TERMS} & {effect.title for effect in EFFECTS.values()}
    assert all(one.group != two.group for term in TERMS for one, two in combinations(term.factors, 2))
    assert all(len(term.factors) == 1 or not term.breaks_mirror for term in TERMS)


@pytest.mark.parametrize("term", TERMS[::13], ids=lambda term: term.name)
def test_the_file_is_the_effect(term: Term, tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(source([term], "Found: a = 1.0."), encoding="utf-8")
    loaded = read_file(file, say=str)
    require_contracts(loaded)
    (effect,) = loaded.effects
    for outcome in outcomes(EFFECT_CHECKS[:2], effect):
        assert outcome.verdict == "pass", outcome.reason
    rig = RIGS["ellipse"]
    states = random_states(rig, 50, np.random.default_rng(1))
    (p,) = effect.parameters
    ours, theirs = (predict([(one, {"a": 2.0 * p.scale})], states, rig) for one in (effect_of(term), effect))
    np.testing.assert_array_equal(ours["impact"], theirs["impact"])


def test_two_terms_share_a_file_and_lines_are_short_enough_to_read(tmp_path: Path) -> None:
    longest = max((line for term in TERMS for line in source([term]).splitlines()), key=len)
    assert len(longest) <= 120, longest
    file = tmp_path / "own.py"
    file.write_text(source([TERMS[0], TERMS[-1]]), encoding="utf-8")
    assert [effect.name for effect in read_file(file, say=str).effects] == [TERMS[0].name, TERMS[-1].name]


def test_what_is_run_is_made_of_fixed_words() -> None:
    """No word of a dataset, and no text from outside, reaches the code that runs."""
    assert set().union(*(term.variables for term in TERMS)) <= set(VARIABLES)
    assert effect_of.__wrapped__.__code__.co_varnames[: effect_of.__wrapped__.__code__.co_argcount] == ("term",)
    with pytest.raises(KeyError):
        source([Term("epsilon; import os", (FACTORS[0],))])
