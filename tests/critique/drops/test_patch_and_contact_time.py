"""Patches are found where they are, and effects on contact times do no harm where contacts are instants."""

from dataclasses import replace

import numpy as np
import pytest
from plain_drops import LAW, TRUTH, observed

from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops, channel_is_material
from thesis_lib.critique.drops.world import testable_effects as usable_effects
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.effects import EFFECTS

PATCH = EFFECTS["surface_patch"]
TIMED = [effect for effect in EFFECTS.values() if effect.needs_contact_time]
SIGMAS = 4.0
NATS = 6.0  # that one more parameter gains by chance in a hundred thousand fits


def patch(**p: float) -> dict[str, float]:
    return {f"surface_patch.{q.name}": q.null for q in PATCH.parameters} | {
        f"surface_patch.{k}": v for k, v in p.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("where", [(0.05, 0.2), (-0.3, -0.15), (0.1, 2.0)], ids=["right", "left", "step"])
def test_a_fit_finds_a_patch_wherever_it_is(where):
    model = Model(LAW, (PATCH,), takes_time=True)
    true = TRUTH | {"tau": 5e-4} | patch(h_eps=-0.2, h_mu=0.4, x_1=where[0], x_2=where[1], w=0.01)
    data = synthesise(Comparison(model, true, observed(120)), np.random.default_rng(3))
    plain = fit(Model(LAW, (), takes_time=True), data)
    found = fit(model, data, plain.values)
    assert found.score > plain.score + 100.0
    for name in ("h_eps", "h_mu", "x_1"):
        key = f"surface_patch.{name}"
        assert abs(found.values[key] - true[key]) < SIGMAS * found.std[key], name
    if where[1] > 1.0:
        # the same from nothing
        assert fit(model, data).score == pytest.approx(found.score, abs=1.0)


@pytest.mark.parametrize("effect", TIMED, ids=lambda effect: effect.name)
def test_contacts_that_are_too_short_to_see_call_for_no_time_of_any_kind(effect):
    timed = Model(LAW, takes_time=True)
    plain = fit(timed, observed(120))
    with_it = fit(timed.with_effect(effect), observed(120), plain.values)
    assert with_it.score - plain.score < NATS
    assert all(abs(with_it.values[name] - plain.values[name]) < plain.std[name] for name in ("mu", "epsilon"))


def test_contacts_that_are_instants_have_no_time_to_test():
    testable, why_not = usable_effects(observed(), timed=False)
    assert {effect.name for effect in TIMED} <= set(why_not) and "surface_patch" in testable
    assert {why_not[effect.name] for effect in TIMED} == {"contacts are taken as instants"}
    assert not set(usable_effects(observed(), timed=True)[1]) & {effect.name for effect in TIMED}


def test_a_fault_of_a_quarter_of_the_touches_is_seen_and_matters():
    data = observed(120)
    plain = fit(Model(LAW, takes_time=True), data)
    value = data.value.copy()
    value[::4, :, 1] += 2e-3  # m; a fault of six times the camera's noise
    sound, faulty = (Drops(o).judge(plain) for o in (data, replace(data, value=value)))
    assert sound.sigmas["touch"] < 1.3
    # a median sees a quarter of it
    assert faulty.sigmas["touch"] > 4.0 * sound.sigmas["touch"]
    assert channel_is_material(sound, faulty, "touch", CritiqueSettings())
    assert not channel_is_material(sound, faulty, "flight", CritiqueSettings())
