"""Discovery in drops: score tests are fair and name what is injected, twins are known as twins, a null is stretched."""

import numpy as np
import pytest
from hidden_effects import LAW, TRUTH, injected, injected_impacts, observed

from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.drops.world import testable_effects as usable_effects
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.selection.evidence import Evidence
from thesis_lib.critique.selection.scan import Scan, scan
from thesis_lib.critique.selection.search import Search, search
from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.mechanics.space import PLANE

SIGMAS = 4.0
RESAMPLES = 999
TELL_APART = CritiqueSettings().tell_apart


def scanned(observations: Observations, seed: int = 0, names: tuple[str, ...] | None = None) -> Scan:
    world = Drops(observations)
    candidates = [world.candidates[name] for name in (world.candidates if names is None else names)]
    return scan(world.slopes(world.fit(LAW.name, ()), candidates), RESAMPLES, np.random.default_rng(seed))


@pytest.mark.parametrize(
    "name", ["anisotropic_friction", "contact_torque", "com_offset", "surface_tilt", "linear_drag", "wear"]
)
def test_the_injected_effect_gains_most(name):
    found = scanned(injected(name, factor=0.5)[0])
    assert max(found.gain, key=found.gain.get) == name
    assert found.p_value(found.gain[name]) == pytest.approx(1.0 / (RESAMPLES + 1))
    assert found.p_value(-1.0) == 1.0


@pytest.mark.slow
def test_p_values_are_fair_when_nothing_is_hidden():
    p_values = []
    for seed in range(24):
        o = synthesise(Comparison(Model(LAW), TRUTH, observed()), np.random.default_rng(100 + seed))
        found = scanned(o, seed)
        p_values.append(found.p_value(max(found.gain.values())))
    p_values = np.array(p_values)
    # uniform: mean 1/2 with standard deviation 0.29/√24; 4 of 24 below 0.01 has probability 1e-4
    assert p_values.mean() == pytest.approx(0.5, abs=SIGMAS * 0.2887 / np.sqrt(24))
    assert np.sum(p_values < 0.01) < 4
    assert p_values.min() < 0.4 and p_values.max() > 0.6


def test_p_values_count_the_candidates_tried():
    many, one, none = (scanned(observed(), names=names) for names in (None, ("wrong_inertia",), ()))
    assert one.gain["wrong_inertia"] == pytest.approx(many.gain["wrong_inertia"], rel=1e-9)
    assert np.quantile(many.null, 0.5) > np.quantile(one.null, 0.5) + 1.0
    # one parameter: twice the gain is chi² with one degree of freedom, median 0.455
    assert 2.0 * np.median(one.null) == pytest.approx(0.455, abs=0.15)
    assert none.gain == {} and (none.null == 0.0).all()


def test_a_moving_surface_cannot_be_told_from_a_drifting_camera_and_from_no_other_effect():
    moved = scanned(injected("moving_surface")[0])
    for name in moved.gain:  # nor any effect from itself
        assert moved.expected_loss(name, name) == pytest.approx(0.0, abs=1e-6 * (1 + moved.gain[name]))
    assert moved.gain["moving_surface"] > 50.0
    assert moved.expected_loss("moving_surface", "sensor_drift") < 0.1 * TELL_APART
    assert moved.expected_loss("sensor_drift", "moving_surface") < 0.1 * TELL_APART
    for other in ("linear_drag", "wrong_inertia", "surface_tilt", "tangential_restitution"):
        assert moved.expected_loss("moving_surface", other) > 10.0 * TELL_APART


@pytest.mark.slow
def test_a_moving_surface_is_named_together_with_a_drifting_camera():
    settings = CritiqueSettings()
    (step,) = search(Drops(injected("moving_surface")[0], settings), settings, np.random.default_rng(0)).steps
    assert {step.effect.name, *step.alternatives} == {"moving_surface", "sensor_drift"}


def table_only() -> Observations:
    return observe(injected_impacts("table", 40, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.4}))


def test_what_cannot_be_tested_is_said_with_the_reason():
    testable, why_not = usable_effects(table_only(), timed=False)
    assert set(testable) | set(why_not) == set(effects_in(PLANE)) and not set(testable) & set(why_not)
    assert why_not["linear_drag"] == "no trajectories"
    assert "ellipse" in why_not["rounded_corners"]
    assert "tangential_restitution" in testable


def test_of_effects_switched_on_the_one_that_is_not_there_is_small_and_superfluous():
    world, settings, rng = Drops(table_only()), CritiqueSettings(), np.random.default_rng(0)
    found = search(world, settings, rng, fixed=["wrong_inertia", "tangential_restitution"])
    assert [step.clears for step in found.steps] == [False, True]
    values, std = found.fitted.values, found.fitted.std
    assert abs(values["wrong_inertia.d_I"]) < SIGMAS * std["wrong_inertia.d_I"]
    assert abs(values["tangential_restitution.e_t"] - 0.4) < SIGMAS * std["tangential_restitution.e_t"]
    checks = Search(world, settings, rng, lambda text: None)
    assert checks.evidence.superfluous(found.steps, found.steps[:-1]) == "wrong_inertia"
    (left,) = checks.without(found.steps, "wrong_inertia")
    assert [effect.name for effect in left.fitted.model.effects] == ["tangential_restitution"]
    assert set(left.fitted.values) == {"mu", "epsilon", "tangential_restitution.e_t"}
    assert checks.evidence.superfluous([left], []) is None


def test_refits_stretch_the_null_of_the_score_test_little():
    world, rng = Drops(table_only()), np.random.default_rng(0)
    world.refits = 40
    fitted = world.fit("anitescu_potra_newton", ())
    effect = EFFECTS["wrong_inertia"]
    tests = scan(world.slopes(fitted, [effect]), 999, rng)
    stretch = Evidence(world, CritiqueSettings(), rng).stretch_of_null(fitted, effect, tests, "refits")
    # the mean of 40 halves of chi² with one degree of freedom is known to 0.22 of itself
    assert 1.0 <= stretch < 1.0 + 4.0 * 0.22
