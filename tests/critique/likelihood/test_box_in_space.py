"""A box in space goes through the likelihood: hidden causes of its corner hits come back."""

import numpy as np
import pytest
from tumbling_box import EPSILON, MU, corner_hits

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.effects import EFFECTS
from thesis_lib.mechanics.space import SPACE

LAW = LAWS["anitescu_potra_newton"]
NEAR = 0.05  # of μ and ε by 30 hits: many standard errors, and less than any two starts of a fit are apart
HIDDEN = {"com_offset.c_x": 1.5e-3, "com_offset.c_y": -1e-3, "com_offset.c_z": 8e-4, "wrong_inertia.d_I": 0.15}


@pytest.mark.slow
def test_corner_hits_give_back_what_was_hidden() -> None:
    # of 96 errors in 16 such sets their root mean square is 1.1 standard errors
    rng = np.random.default_rng(0)
    c = [HIDDEN[f"com_offset.c_{axis}"] for axis in "xyz"]
    hits = corner_hits(200, rng, c, HIDDEN["wrong_inertia.d_I"])
    model = Model(LAW, (EFFECTS["com_offset"], EFFECTS["wrong_inertia"]), space=SPACE)
    found = fit(model, hits)
    for name, value in {**HIDDEN, "mu": MU, "epsilon": EPSILON}.items():
        assert abs(found.values[name] - value) < 3.0 * found.std[name], name
        assert found.std[name] < 0.2 * abs(value)
    without = fit(Model(LAW, space=SPACE), hits)
    assert found.score > without.score + 100.0


def test_residuals_of_the_truth_are_as_large_as_their_covariance_says(rng) -> None:
    hits = corner_hits(200, rng)
    noisy = Comparison(Model(LAW, space=SPACE), {"mu": MU, "epsilon": EPSILON}, hits).noisy
    S = noisy.covariance(0.0)
    d2 = np.einsum("ni,nij,nj->n", noisy.value, np.linalg.inv(S), noisy.value)
    # chi square with 13 degrees of freedom; kinks between sticking and sliding widen a few
    assert 10.0 < np.median(d2) < 15.0


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if 3 in effect.dimensions])
def test_every_effect_that_lives_in_space_goes_through(name, rng) -> None:
    effect = EFFECTS[name]
    hits = corner_hits(20, rng)
    model = Model(LAW, (effect,), takes_time=effect.needs_contact_time, space=SPACE)
    found = fit(model, hits, {"mu": MU, "epsilon": EPSILON}, rounds=1)
    assert np.isfinite(found.score)
    for p in model.parameters_of(effect):
        assert p.low <= found.values[f"{name}.{p.name}"] <= p.high


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, law in LAWS.items() if 3 in law.dimensions])
def test_every_law_that_holds_in_space_goes_through(name, rng) -> None:
    hits = corner_hits(30, rng, law=name)
    found = fit(Model(LAWS[name], space=SPACE), hits, rounds=1)
    assert found.values["mu"] == pytest.approx(MU, abs=NEAR)
    assert found.values["epsilon"] == pytest.approx(EPSILON, abs=NEAR)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "parameter"), [("mirrored_rotation", "mirrored"), ("misread_rotation", "reading")])
def test_starts_with_different_choices_are_fitted_beside_each_other(name, parameter, rng) -> None:
    model = Model(LAW, (EFFECTS[name],), space=SPACE)
    found = fit(model, corner_hits(20, rng), rounds=1)
    choices = model.parameters[f"{name}.{parameter}"].choices
    assert found.values[f"{name}.{parameter}"] in (0.0, 1.0, *choices) and np.isfinite(found.score)
