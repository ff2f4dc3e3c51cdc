"""The first candidates: what was found leads, what was not needed has a reason, and nothing leads without a cause."""

import numpy as np
import pytest

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.results.candidates import FOUND, OTHER, candidates, choices, choices_table
from thesis_lib.critique.selection.discovery import KEPT
from thesis_lib.figures.critique.candidates import draw_candidates

QUICK = 0.3  # relative: a quick fit ends near the full one


def test_what_was_hidden_leads_and_the_others_have_a_reason(hidden_drops: DropsCritique):
    table = candidates(hidden_drops)
    assert 2 <= len(table) <= KEPT and table["effect"].is_unique and table["gain"].is_monotonic_decreasing
    first, others = table.iloc[0], table[table["standing"] == OTHER]
    assert (first["effect"], first["standing"]) == ("anisotropic_friction", FOUND)
    assert first["why"].startswith("lowers errors of velocities after impact")
    assert len(others) and others["why"].ne("").all() and (others["gain"] < 0.5 * first["gain"]).all()
    # the same gain as from one rung of the ladder to the next
    before, after = (judged for _, _, judged in hidden_drops.ladder[:2])
    assert first["gain"] == pytest.approx((after.total - before.total) / after.units, rel=QUICK)
    assert first["gain_low"] > 0.0


def test_without_a_cause_no_candidate_predicts_better(nothing_hidden: DropsCritique):
    table = candidates(nothing_hidden)
    assert (table["standing"] == OTHER).all() and table["gain"].max() < 0.2
    drawn = draw_candidates(nothing_hidden, table)
    assert drawn is not None and ", but " in drawn[0].get_suptitle().replace("\n", " ")
    assert np.isfinite(drawn[1][["gain", "gain_low", "gain_high"]]).all(axis=None)


def test_each_choice_of_effects_has_its_error(hidden_drops: DropsCritique):
    table = candidates(hidden_drops)
    made = choices(hidden_drops, table)
    rival = table["effect"][table["standing"] == OTHER].iloc[0]
    found = "anisotropic_friction"
    assert [one.effects for one in made] == [(), (found,), (rival,), (found, rival)]
    assert made[0].judged is hidden_drops.ladder[0][2] and made[1].judged is hidden_drops.ladder[-1][2]
    assert made[2].fitted.base == hidden_drops.discovery.base and made[3].fitted.base == made[1].fitted.base
    errors = choices_table(made)["error"].to_numpy()
    # the rival mends next to nothing, with the effect or without it
    assert errors[1] < 0.5 * errors[0] and errors[2] > 0.7 * errors[0] and errors[3] < 0.5 * errors[0]


def test_nothing_can_be_switched_where_nothing_was_found(nothing_hidden: DropsCritique):
    assert choices(nothing_hidden, candidates(nothing_hidden)) == []
