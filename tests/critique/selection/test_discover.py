"""Discovery: silent when nothing is hidden, names what is, names what cannot be told from it, obeys when told to."""

import numpy as np
import pytest
from hidden_effects import injected_impacts
from plain_drops import injected

from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops, DropsDiscovery
from thesis_lib.critique.drops.world import testable_effects as usable_effects
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.selection import evidence
from thesis_lib.critique.selection import search as search_module
from thesis_lib.critique.selection.scan import scan
from thesis_lib.critique.selection.search import search
from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.mechanics.space import PLANE


def table_only() -> Observations:
    return observe(injected_impacts("table", 40, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.4}))


def discover(
    training: Observations | None = None, settings: CritiqueSettings | None = None, fixed=None
) -> DropsDiscovery:
    settings = settings or CritiqueSettings()
    world = Drops(training or table_only(), settings)
    return search(world, settings, np.random.default_rng(0), fixed)


def test_an_injected_effect_is_named_with_its_size(hidden_impacts):
    first = hidden_impacts.discovery.steps[0]
    assert first.effect.name == "tangential_restitution"
    assert first.p_value <= CritiqueSettings().alpha and first.gain[1] > 0.0
    key = "tangential_restitution.e_t"
    fitted = hidden_impacts.discovery.fitted
    assert abs(fitted.values[key] - 0.4) < 4.0 * fitted.std[key]
    # what was taken has left the candidates
    assert "tangential_restitution" in first.scan.gain
    assert "tangential_restitution" not in hidden_impacts.discovery.last_scan.gain


def test_what_cannot_be_tested_is_said_with_the_reason():
    testable, why_not = usable_effects(table_only(), timed=False)
    assert set(testable) | set(why_not) == set(effects_in(PLANE)) and not set(testable) & set(why_not)
    assert why_not["linear_drag"] == "no trajectories"
    assert "ellipse" in why_not["rounded_corners"]
    assert "tangential_restitution" in testable


def test_forced_effects_are_switched_on_in_the_order_given():
    wanted = ["wrong_inertia", "tangential_restitution"]
    found = discover(fixed=wanted)
    assert [step.effect.name for step in found.steps] == wanted
    assert [effect.name for effect in found.fitted.model.effects] == wanted
    # only one of them is asked for by the data
    assert [step.clears for step in found.steps] == [False, True]
    # the one that is not there comes out small, the one that is there as it is
    values, std = found.fitted.values, found.fitted.std
    assert abs(values["wrong_inertia.d_I"]) < 4.0 * std["wrong_inertia.d_I"]
    assert abs(values["tangential_restitution.e_t"] - 0.4) < 4.0 * std["tangential_restitution.e_t"]


def test_an_effect_that_a_later_one_makes_superfluous_leaves_again():
    world, settings, rng = Drops(table_only()), CritiqueSettings(), np.random.default_rng(0)
    steps = search(world, settings, rng, fixed=["wrong_inertia", "tangential_restitution"]).steps
    checks = search_module.Search(world, settings, rng, lambda text: None)
    assert checks.evidence.superfluous(steps, steps[:-1]) == "wrong_inertia"
    (left,) = checks.without(steps, "wrong_inertia")
    assert [effect.name for effect in left.fitted.model.effects] == ["tangential_restitution"]
    assert set(left.fitted.values) == {"mu", "epsilon", "tangential_restitution.e_t"}
    assert checks.evidence.superfluous([left], []) is None


def test_refits_stretch_the_null_of_the_score_test_little():
    world, rng = Drops(table_only()), np.random.default_rng(0)
    world.refits = 40
    fitted = world.fit("anitescu_potra_newton", ())
    effect = EFFECTS["wrong_inertia"]
    tests = scan(world.slopes(fitted, [effect]), 999, rng)
    checks = evidence.Evidence(world, CritiqueSettings(), rng)
    stretch = checks.stretch_of_null(fitted, effect, tests, "refits")
    # the mean of 40 halves of chi² with one degree of freedom is known to 0.22 of itself
    assert 1.0 <= stretch < 1.0 + 4.0 * 0.22


def test_no_effects_wanted_no_effects_tried():
    for settings, fixed in ((CritiqueSettings(), []), (CritiqueSettings(max_effects=0), None)):
        assert discover(settings=settings, fixed=fixed).steps == ()


@pytest.mark.slow
def test_a_moving_surface_is_named_together_with_a_drifting_camera():
    found = discover(injected("moving_surface")[0])
    assert len(found.steps) == 1
    step = found.steps[0]
    assert {step.effect.name, *step.alternatives} == {"moving_surface", "sensor_drift"}
