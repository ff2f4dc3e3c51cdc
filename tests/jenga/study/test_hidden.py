"""Effects that a learner has never seen: which blocks have them, errors before and after, and the whole procedure."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.learner import push_groups
from thesis_lib.jenga.play.settings import HiddenChoice
from thesis_lib.jenga.study.hidden import error_rows, hidden_of, hidden_study
from thesis_lib.jenga.tower.settings import CollectSettings, Setup

CHOICE = HiddenChoice()


def test_effects_say_which_blocks_have_them():
    for name in ("glued", "slippery"):
        hidden, own = hidden_of(name, CHOICE)
        assert own == (18, 19, 20)
        assert (hidden.glued == own) == (name == "glued")
        assert (hidden.slippery_layer == CHOICE.layer) == (name == "slippery")
    heavy, own = hidden_of("heavy_tool", CHOICE)
    assert heavy.pusher_mass == CHOICE.pusher_mass and len(own) == 45
    with pytest.raises(UserError, match="no hidden effect sticky; choose one of glued"):
        hidden_of("sticky", CHOICE)


@pytest.mark.slow
def test_errors_are_those_of_pushes_and_grow_where_the_tower_differs(learned, held):
    block = np.where(held.push % 2 == 0, 18, 3)
    held = replace(held, block=block)
    plain = error_rows(learned, held, (18, 19, 20)).set_index("group")
    groups = push_groups(held)
    assert plain["n"].sum() == len(groups)
    # blocks with the effect resist twice as much
    held.next_state[block == 18, 3] *= 2.0
    other = error_rows(learned, held, (18, 19, 20)).set_index("group")
    assert other.loc["affected", "error"] > 1.1 * plain.loc["affected", "error"]
    assert other.loc["others", "error"] == pytest.approx(plain.loc["others", "error"])


@pytest.mark.slow
def test_a_slippery_layer_goes_through_the_whole_procedure(learned, held):
    setup = Setup(collect=CollectSettings(reduced=True, retract=0.2))
    choice = HiddenChoice(towers=2, pushes=4, others=4)
    found = hidden_study("slippery", learned, held, setup, choice, 60_000, 1, np.random.default_rng(6))
    assert set(found["pushes"]["affected"]) <= {0, 1}
    row = found["summary"].iloc[0]
    assert row["pushes_affected"] + row["pushes_others"] == len(found["pushes"])
    assert row["failing_affected"] <= row["pushes_affected"]
    assert "before" in set(found["errors"]["stage"])
    # a learner of made pushes meets real ones: all of this must look new to it
    assert row["p_value"] < 0.05
