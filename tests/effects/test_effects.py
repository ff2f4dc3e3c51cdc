"""The contract of every effect: whoever adds a file to thesis_lib/effects inherits these tests."""

import sys
from textwrap import dedent

import numpy as np
import pytest
from stage_predictor import predict

import thesis_lib.effects as package
from thesis_lib.contact import LAWS
from thesis_lib.effects import EFFECTS, Effect, effects_in
from thesis_lib.effects.effect import FAMILIES, Rig
from thesis_lib.extensions.contract import Check, outcomes
from thesis_lib.extensions.effect_contract import CHANNELS, DISK, N, checks_of, hook_calls
from thesis_lib.extensions.effect_probe import RIGS, at_scale, null, random_states
from thesis_lib.mechanics.space import PLANE

ROUNDING = 1e-12  # relative to 1: there and back through a map of order one


@pytest.mark.parametrize(
    ("effect", "check"), [pytest.param(e, c, id=f"{e.name}-{c.name}") for e in EFFECTS.values() for c in checks_of(e)]
)
def test_contract(effect: Effect, check: Check[Effect]) -> None:
    (outcome,) = outcomes([check], effect)
    assert outcome.verdict == "pass", outcome.reason


def test_every_hook_of_an_impact_and_a_flight_is_looked_at() -> None:
    hooks = {name for name, value in vars(Effect).items() if callable(value) and not name.startswith("_")}
    rig = RIGS["ellipse"]
    called = hook_calls(Effect(), {}, rig, random_states(rig, N, np.random.default_rng(5)))
    # what they leave out: where an effect exists, what of it is seen, where fits start, and the path that follows from
    # an acceleration
    assert hooks - set(called) == {"applies_to", "unseen", "shapes", "arc"}


def test_names_are_unique() -> None:
    assert len(EFFECTS) >= 28
    for attribute in ("name", "title"):
        values = [getattr(effect, attribute) for effect in EFFECTS.values()]
        assert len(set(values)) == len(values)
    assert [EFFECTS[name].name for name in EFFECTS] == list(EFFECTS)


def test_a_choice_is_said_in_words() -> None:
    (reading,), (plane,), (axis,) = (
        EFFECTS["misread_rotation"].parameters,
        EFFECTS["mirrored_rotation"].parameters,
        EFFECTS["mirrored_rotation"].own_in_space,
    )
    assert [reading.said(value) for value in reading.options][:2] == ["conjugate", "scalar last"]
    assert plane.said(1.0) == "on" and [axis.said(value) for value in axis.options] == ["x axis", "y axis", "z axis"]


@pytest.mark.parametrize("rig", RIGS.values(), ids=RIGS)
@pytest.mark.parametrize("law", LAWS)
def test_all_nulls_together_change_no_law(law: str, rig: Rig) -> None:
    states = random_states(rig, N, np.random.default_rng(5))
    mu = 0.25 if LAWS[law].mu_unit == "1" else 0.5
    everything = [(effect, null(effect, mu=mu)) for effect in effects_in(PLANE).values()]
    with_nulls, without = (predict(active, states, rig, law, mu) for active in (everything, []))
    for channel in CHANNELS:
        np.testing.assert_allclose(getattr(with_nulls, channel), getattr(without, channel), rtol=0, atol=ROUNDING)


def test_some_effects_do_not_apply_to_some_bodies() -> None:
    rigs = (DISK, *RIGS.values())
    left_out = {(e.name, rig.shape.kind) for rig in rigs for e in EFFECTS.values() if not e.applies_to(rig)}
    assert left_out >= {("rounded_corners", "ellipse"), ("rounded_corners", "disk"), ("angle_offset", "disk")}


def test_degree_one_homogeneity() -> None:
    # with constant coefficients the impulse is homogeneous in the velocity; these effects break that, the rest do not
    speed_dependent = {
        "adhesion",
        "velocity_dependent_restitution",
        "velocity_dependent_friction",
        "moving_surface",
        "sensor_drift",
        "time_lag",
        "soft_body",
    }
    rig = RIGS["quadrilateral"]
    states = random_states(rig, N, np.random.default_rng(8))
    doubled = states.moved(vx=2 * states.vx, vy=2 * states.vy, omega=2 * states.omega)
    for name, effect in effects_in(PLANE).items():
        active = [(effect, at_scale(effect))]
        one, two = predict(active, states, rig).impact, predict(active, doubled, rig).impact
        assert (np.max(np.abs(two - 2 * one)) > 1e-3) == (name in speed_dependent), name


NEW_EFFECT = '''
    """An effect that a user adds."""
    from thesis_lib.effects.effect import Effect, Parameter

    class Sticky(Effect):
        name = "{name}"
        family = "contact_law"
        title = "sticky"
        equation = "mu = mu + m"
        parameters = (Parameter("m", "1", null=0.0, low=0.0, high=1.0, scale=0.1),)

        def coefficients(self, mu, epsilon, contact, state, p, rig):
            return mu + p["m"], epsilon

    EFFECT = Sticky()
'''


@pytest.fixture
def extended_package(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """The package with a second, empty folder; what is loaded from there is forgotten afterwards."""
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        del sys.modules[name]
        delattr(package, name.rpartition(".")[2])


def test_a_new_file_is_found(extended_package) -> None:
    (extended_package / "sticky.py").write_text(dedent(NEW_EFFECT).format(name="sticky"))
    found = package._load()
    assert set(found) == set(EFFECTS) | {"sticky"}
    families = [FAMILIES.index(effect.family) for effect in found.values()]
    assert families == sorted(families)
    rig = RIGS["ellipse"]
    states = random_states(rig, N, np.random.default_rng(9))
    made = predict([(found["sticky"], {"m": 0.1})], states, rig)
    np.testing.assert_array_equal(made.impact, predict([], states, rig, mu=0.35).impact)


def test_a_file_with_another_name_is_refused(extended_package) -> None:
    (extended_package / "sticky_wrong.py").write_text(dedent(NEW_EFFECT).format(name="sticky"))
    with pytest.raises(ImportError, match="sticky_wrong"):
        package._load()
