"""Standard errors of a model that is wrong: impacts of one trial share what it misses."""

import numpy as np
import pytest
from hidden_effects import LAW, TRUTH, observed

from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.synthesis import synthesise

DRAWS = 40
OWN = 0.04  # one sigma of the restitution of a trial about the mean; the model has one for all
LEAST, MOST = 0.75, 1.35  # spread of errors over standard errors; 40 draws know it to 11 %


@pytest.mark.parametrize("own", [0.0, OWN])
def test_errors_lie_as_far_off_as_their_standard_errors_say(own: float) -> None:
    o, model = observed(), Model(LAW)
    trials, of = np.unique(o.trial, return_inverse=True)
    off = []
    for k in range(DRAWS):
        rng = np.random.default_rng([44, k])
        epsilon = TRUTH["epsilon"] + own * rng.standard_normal(len(trials))
        fitted = fit(model, synthesise(Comparison(model, {**TRUTH, "epsilon": epsilon[of]}, o), rng), TRUTH, rounds=1)  # pyright: ignore[reportArgumentType]
        off.append((fitted.values["epsilon"] - TRUTH["epsilon"]) / fitted.std["epsilon"])
    # by impacts alone, the spread is 5.6
    assert LEAST < np.std(off) < MOST
    assert np.mean(np.abs(off) < 1.96) >= 0.85
