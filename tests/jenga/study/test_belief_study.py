"""Events along made pushes whose kind is known: what the beliefs do, and which readings move them."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.jenga.learners.abstractions import stuck_group
from thesis_lib.jenga.learners.learner import log_likelihood, push_groups
from thesis_lib.jenga.robot.samples import F_N, FREE, STUCK, UNKNOWN, X
from thesis_lib.jenga.study.belief_study import FORCES, POSES, QUANTITIES, belief_table, evidence
from thesis_lib.jenga.study.model_study import filtered


def test_beliefs_of_made_pushes_settle_as_their_blocks_behave(learned, held):
    found = belief_table([learned], held).set_index("quantity")
    assert list(found.index) == list(QUANTITIES)
    assert found.loc["stuck_resists", "low"] > 0.0
    assert found.loc["easy_settles", "value"] > 0.4
    groups = [rows for rows in push_groups(held) if len(rows) > 3]
    truth = np.array([held.truth[rows[0]] for rows in groups])
    assert found.loc["stuck_resists", "n"] == (truth == STUCK).sum()
    assert found.loc["easy_settles", "n"] == (truth == FREE).sum()
    assert found.loc["force_leads_early", "n"] == len(groups)
    both = belief_table([learned, learned], held).set_index("quantity")
    assert both["value"].to_numpy() == pytest.approx(found["value"].to_numpy())
    assert both["std"].to_numpy() == pytest.approx(found["std"].to_numpy())


def test_a_truth_that_is_turned_round_turns_the_evidence_round(learned, held):
    wrong = replace(held, truth=1 - held.truth)
    right = belief_table([learned], held).set_index("quantity")["value"]
    turned = belief_table([learned], wrong).set_index("quantity")["value"]
    assert turned["force_leads_early"] == pytest.approx(-right["force_leads_early"])
    assert turned["easy_settles"] < right["easy_settles"] and turned["stuck_resists"] < right["stuck_resists"]
    nobody = belief_table([learned], replace(held, truth=np.full(len(held), UNKNOWN)))
    assert (nobody["n"] == 0).all() and nobody["value"].isna().all()


def test_evidence_is_the_growth_of_the_odds_by_those_readings_alone(learned, held):
    belief = filtered(learned, held)
    of = {name: evidence(learned, held, belief, seen) for name, seen in (("force", FORCES), ("pose", POSES))}
    moved = held.next_state.copy()
    moved[:, X] += 0.5
    changed = replace(held, next_state=moved)
    assert evidence(learned, changed, belief, FORCES) == pytest.approx(of["force"])
    assert np.abs(evidence(learned, changed, belief, POSES) - of["pose"]).max() > 0.1
    # of one sample by hand
    row = slice(7, 8)
    out = learned.predict(held.state[row], held.action[row], held.context[row], belief[row])
    like = np.exp(log_likelihood(out.mean, out.var, held.next_state[row], learned.settings.belief, (F_N, F_N + 1)))[0]
    stuck, prior = stuck_group(learned), out.weight[0]
    odds = [(part[stuck].sum() / part[~stuck].sum()) for part in (prior * like, prior)]
    sign = 1.0 if held.truth[7] == STUCK else -1.0
    assert of["force"][7] == pytest.approx(sign * np.log(odds[0] / odds[1]))
