"""A law that no effect names, hidden in impacts: it is proposed, with its sign; nothing is where nothing is hidden."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden_effects import injected_impacts

from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.proposal.effect_file import effect_of
from thesis_lib.critique.proposal.propose import Proposal, _TermSearch, propose, regress
from thesis_lib.critique.proposal.results import content_of, sentences, text_of, write_source
from thesis_lib.critique.proposal.terms import Term, all_terms
from thesis_lib.critique.selection import discovery
from thesis_lib.effects import EFFECTS
from thesis_lib.extensions.loading import read_file, results
from thesis_lib.foundation.files import write_json

HIDDEN, SIZE = "restitution_by_obliquity", -0.4
IMPACTS = 150


def term(name: str) -> Term:
    return next(term for term in all_terms() if term.name == name)


def criticised(name: str, size: float, seed: int = 3) -> DropsCritique:
    data = injected_impacts("hidden", IMPACTS, seed, effect_of(term(name)), {f"{name}.a": size})
    return criticise_drops(data, rng=np.random.default_rng(seed))


@pytest.fixture(scope="module")
def hidden() -> DropsCritique:
    return criticised(HIDDEN, SIZE)


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
def test_the_held_out_trials_may_strike_a_term(hidden: DropsCritique, proposal: Proposal) -> None:
    """Held-out trials on which the model without it is as good: those of drops with nothing hidden."""
    other = replace(hidden, held_out=criticised(HIDDEN, 0.0).held_out)
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
    said = " ".join(sentences({"proposal": content}))
    assert "drops_proposal.py" in said and "−0.4" in said
    file = write_source(proposal, tmp_path / "drops_proposal.py")
    ((_, name, outcomes),) = results(read_file(file, say=str))
    assert name == HIDDEN and all(outcome.verdict == "pass" for outcome in outcomes)


def test_edits_of_an_earlier_file_stay(proposal: Proposal, tmp_path: Path) -> None:
    first = write_source(proposal, tmp_path / "own.py")
    assert write_source(proposal, tmp_path / "own.py") == first
    first.write_text("mine = 1\n", encoding="utf-8")
    second = write_source(proposal, tmp_path / "own.py")
    assert second != first and first.read_text(encoding="utf-8") == "mine = 1\n"
    assert second.read_text(encoding="utf-8") == text_of(proposal)


def test_the_regression_finds_it_in_every_half(hidden: DropsCritique) -> None:
    world = Drops(hidden.training)
    fitted = world.fit("anitescu_potra_newton", ())
    tests, share = regress(world, fitted, all_terms(), np.random.default_rng(0))
    assert share[HIDDEN] > 0.9
    assert tests.p_value(tests.gain[HIDDEN]) <= 0.001


@pytest.mark.slow
def test_nothing_is_proposed_where_nothing_is_hidden() -> None:
    """Asked for though the critique would not ask."""
    critique = criticised(HIDDEN, 0.0, 0)
    assert critique.verdict == "adequate"
    assert propose(critique, np.random.default_rng(0)) is None
    assert content_of(None, "") is None and "none is proposed" in sentences({"proposal": None})[0]


@pytest.mark.slow
def test_a_couple_that_follows_the_motion_is_found() -> None:
    critique = criticised("couple_by_turning", -0.3, 5)
    found = propose(critique, np.random.default_rng(5))
    assert found is not None and found.terms[0].term.name == "couple_by_turning"
    assert found.fitted.values["couple_by_turning.a"] == pytest.approx(-0.3, rel=0.15)
