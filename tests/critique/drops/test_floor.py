"""What no model could explain: the pairs' bound holds, and only what the model lacks is learned."""

import numpy as np
import pytest
from hidden_effects import injected_impacts

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.features import remaining
from thesis_lib.critique.drops.questions.floor import FEWEST, NEAREST, floor
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import Fit, fit
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.effects import EFFECTS

HIDDEN = "velocity_dependent_restitution"
VALUES = {f"{HIDDEN}.p": 0.5, f"{HIDDEN}.c": 0.0}
N = 1000
NEAR = 2.5  # times the error of a perfect model; the nearest of 1,000 states differ by several times the noise


@pytest.fixture(scope="module")
def impacts() -> Observations:
    return observe(injected_impacts("hidden", N, 3, HIDDEN, VALUES))


def fitted(impacts: Observations, effects: tuple = ()) -> Fit:
    return fit(Model(LAWS["anitescu_potra_newton"], effects), impacts)


def test_nothing_is_left_to_learn_where_the_model_is_true(impacts):
    true = fitted(impacts, (EFFECTS[HIDDEN],))
    found, noise = floor(true, impacts, np.random.default_rng(0)), Drops(impacts).judge(true).floor
    assert found.error == pytest.approx(noise, rel=0.1)
    assert found.gain[1] <= 0.0
    assert found.pairs < NEAR * noise


def test_what_the_model_lacks_is_learned(impacts):
    wrong = fitted(impacts)
    found, noise = floor(wrong, impacts, np.random.default_rng(0)), Drops(impacts).judge(wrong).floor
    assert found.error > 3.0 * noise
    low, high = found.gain[1:]
    assert 0.0 < low < found.gain[0] < high
    assert found.gain[0] == pytest.approx(found.error - found.learned)
    assert found.learned < 0.75 * found.error
    # near pairs share most of what is missing
    assert noise < found.pairs < 0.7 * found.error


def test_few_impacts_have_no_pairs(impacts):
    few = impacts.rows(np.arange(round(0.9 * FEWEST / NEAREST / 2)))
    found = floor(fitted(few), few, np.random.default_rng(0))
    assert found.pairs is None


@pytest.mark.parametrize("n", [0, 1, 3])
def test_structure_is_not_looked_for_in_less_than_two_impacts_a_half(impacts, n):
    found = remaining(fitted(impacts), impacts.rows(np.arange(n)), np.random.default_rng(0))
    assert found.p_value == 1.0 and not found.depends_on and found.error_before == found.error_after < 0.5
