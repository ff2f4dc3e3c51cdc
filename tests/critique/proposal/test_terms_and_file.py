"""Every term holds its units and the contract of effects; the file that is written is the effect that was fitted."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from thesis_lib.critique.proposal.effect_file import VARIABLES, effect_of, phi, source
from thesis_lib.critique.proposal.terms import FACTORS, Factor, Term, all_terms
from thesis_lib.effects import EFFECTS
from thesis_lib.extensions.contract import outcomes
from thesis_lib.extensions.effect_contract import EFFECT_CHECKS
from thesis_lib.extensions.effect_probe import RIGS, predict, random_states
from thesis_lib.extensions.loading import read_file, require_contracts
from thesis_lib.extensions.registry import NAME

TERMS = all_terms()
COMPOSES, DESCRIBED = "works together with every effect of the library", "explains its symbols and names a source"
FAST = [check for check in EFFECT_CHECKS if check.name not in (COMPOSES, DESCRIBED)]


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


def test_two_terms_share_a_file(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(source([TERMS[0], TERMS[-1]]), encoding="utf-8")
    assert [effect.name for effect in read_file(file, say=str).effects] == [TERMS[0].name, TERMS[-1].name]


def test_lines_are_short_enough_to_read() -> None:
    longest = max((line for term in TERMS for line in source([term]).splitlines()), key=len)
    assert len(longest) <= 120, longest


def test_what_is_run_is_made_of_fixed_words() -> None:
    """No word of a dataset, and no text from outside, reaches the code that runs."""
    assert set().union(*(term.variables for term in TERMS)) <= set(VARIABLES)
    assert effect_of.__wrapped__.__code__.co_varnames[: effect_of.__wrapped__.__code__.co_argcount] == ("term",)
    with pytest.raises(KeyError):
        source([Term("epsilon; import os", (FACTORS[0],))])
