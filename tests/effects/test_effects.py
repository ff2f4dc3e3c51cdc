"""The contract of every effect: whoever adds a file to thesis_lib/effects inherits these tests."""

import inspect
import sys
from itertools import permutations
from textwrap import dedent

import numpy as np
import pytest
from stage_predictor import RIGS, TAU, arrays, at_scale, null, predict, random_states

import thesis_lib.effects as package
from thesis_lib.bodies.shapes import Disk, Polygon
from thesis_lib.contact import LAWS
from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.effects.effect import FAMILIES, Impulse, Rig, State

N = 300
CHANNELS = ("impact", "meet", "touch", "flight")
ROUNDING = 1e-12  # relative to 1: there and back through a map of order one
IDENTITY = 1e-15  # a null effect may cost one rounding
# velocities (m/s, with ω k_g), poses (m or rad) and accelerations (m/s²) that the rig of 0.3 mm and 3 mrad resolves in
# about 100 impacts: what an effect changes at its scale must not lie far below
RESOLVED = {"impact": 3e-3, "meet": 1e-3, "touch": 1e-4, "flight": 1e-2}
BREAKS_MIRROR = {
    "anisotropic_friction",
    "orientation_dependent_restitution",
    "com_offset",
    "contact_point_offset",
    "moving_surface",
    "position_dependent_friction",
    "position_dependent_restitution",
    "position_dependent_contact_time",
    "orientation_dependent_contact_time",
    "surface_patch",
    "surface_tilt",
    "angle_offset",
    "sensor_drift",
}
HOOKS = (
    "to_true",
    "to_measured",
    "meet",
    "to_contact",
    "from_contact",
    "contact_point",
    "gap",
    "radius_of_gyration",
    "contact_time",
    "coefficients",
    "impulse",
    "acceleration",
)


@pytest.fixture(params=list(EFFECTS), ids=str)
def effect(request: pytest.FixtureRequest) -> Effect:
    return EFFECTS[request.param]


@pytest.fixture(params=list(RIGS), ids=str)
def rig(request: pytest.FixtureRequest) -> Rig:
    return RIGS[request.param]


@pytest.fixture
def states(rig: Rig) -> State:
    return random_states(rig, N, np.random.default_rng(5))


def hook_calls(effect: Effect, p: dict[str, float], rig: Rig, states: State) -> dict[str, tuple[tuple, object]]:
    """Each hook of an effect: its leading arguments and what it makes of them."""
    before = predict([], states, rig)
    r = tuple(rig.shape.contact_point(states.theta).T)
    mu, epsilon, tau = np.full(N, 0.25), np.full(N, 0.55), np.full(N, TAU)
    jump, gap = np.full((N, 3), 0.3), np.full(N, 0.2)
    a = np.random.default_rng(3).standard_normal((N, 3))
    space = before.space
    return {
        "to_true": ((states,), effect.to_true(states, p, rig)),
        "to_measured": ((states,), effect.to_measured(states, p, rig)),
        "meet": ((jump,), effect.meet(jump, states, before.after, p)),
        "to_contact": ((states,), effect.to_contact(states, p, rig)),
        "from_contact": ((states,), effect.from_contact(states, p, rig)),
        "contact_point": (r, effect.contact_point(*r, states, p, rig)),
        "gap": ((gap,), effect.gap(gap, states, p, rig)),
        "radius_of_gyration": ((rig.k_g,), effect.radius_of_gyration(rig.k_g, p)),
        "contact_time": ((tau,), effect.contact_time(tau, space, states, p, rig)),
        "coefficients": ((mu, epsilon), effect.coefficients(mu, epsilon, space, states, p, rig)),
        "impulse": ((before.impulse,), effect.impulse(before.impulse, space, mu, epsilon, r, states, p, rig)),
        "acceleration": ((a,), effect.acceleration(a, states, p, rig)),
    }


def flat(value: object) -> list[np.ndarray]:
    """All arrays in a hook's argument or result."""
    if isinstance(value, State):
        return list(arrays(value).values())
    if isinstance(value, Impulse):
        return [value.c_t, value.c_n, value.tau]
    if isinstance(value, tuple):
        return [array for part in value for array in flat(part)]
    return [np.asarray(value)]


def test_declaration(effect: Effect) -> None:
    assert effect.family in FAMILIES
    assert effect.title and effect.equation and effect.reference
    assert effect.channels and set(effect.channels) <= set(CHANNELS)
    assert effect.needs_trajectories == ("impact" not in effect.channels)
    names = [p.name for p in effect.parameters]
    assert names and len(set(names)) == len(names)
    for p in effect.parameters:
        assert p.unit
        assert p.low <= p.null <= p.high and p.low < p.high
        assert p.scale > 0 and p.null + p.scale <= p.high
        assert all(p.low <= start <= p.high for start in p.starts)
        assert p.discrete is None or (p.low <= p.discrete <= p.high and p.discrete != p.null)


def test_module_says_its_symbols_and_the_effect_its_source(effect: Effect) -> None:
    text = inspect.getmodule(effect).__doc__
    assert "| on paper" in text and effect.reference
    assert all(f"`{p.name}`" in text for p in effect.parameters)


def test_names_are_unique() -> None:
    assert len(EFFECTS) >= 28
    for attribute in ("name", "title"):
        values = [getattr(effect, attribute) for effect in EFFECTS.values()]
        assert len(set(values)) == len(values)
    assert [EFFECTS[name].name for name in EFFECTS] == list(EFFECTS)


def test_null_is_identity(effect: Effect, rig: Rig, states: State) -> None:
    calls = hook_calls(effect, null(effect), rig, states)
    assert set(calls) == set(HOOKS)
    for name, (given, made) in calls.items():
        for old, new in zip(flat(given), flat(made), strict=True):
            np.testing.assert_allclose(new, old, rtol=IDENTITY, atol=0.0, err_msg=name)


@pytest.mark.parametrize("law", list(LAWS))
def test_all_nulls_together_change_no_law(law: str, rig: Rig, states: State) -> None:
    mu = 0.25 if LAWS[law].mu_unit == "1" else 0.5
    everything = [(effect, null(effect)) for effect in EFFECTS.values()]
    with_nulls, without = (predict(active, states, rig, law, mu) for active in (everything, []))
    for channel in CHANNELS:
        np.testing.assert_allclose(getattr(with_nulls, channel), getattr(without, channel), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("there, back", [("to_true", "to_measured"), ("to_contact", "from_contact")])
def test_maps_have_inverses(effect: Effect, rig: Rig, states: State, there: str, back: str) -> None:
    p = at_scale(effect)
    for one, other in ((there, back), (back, there)):
        returned = getattr(effect, other)(getattr(effect, one)(states, p, rig), p, rig)
        for name, values in arrays(returned).items():
            np.testing.assert_allclose(values, arrays(states)[name], rtol=ROUNDING, atol=ROUNDING, err_msg=name)


def test_arguments_stay_as_they_are(effect: Effect, rig: Rig, states: State) -> None:
    p = at_scale(effect)
    kept = dict(p)
    for array in flat(states):
        array.flags.writeable = False
    copies = [array.copy() for array in flat(states)]
    calls = hook_calls(effect, p, rig, states)
    fresh = hook_calls(EFFECTS["surface_height"], null(EFFECTS["surface_height"]), rig, states)
    for name, (given, _) in calls.items():
        for used, expected in zip(flat(given), flat(fresh[name][0]), strict=True):
            np.testing.assert_array_equal(used, expected, err_msg=name)
    assert all(np.array_equal(a, b) for a, b in zip(copies, flat(states))) and p == kept


def test_finite_everywhere_in_bounds(effect: Effect, rig: Rig, states: State) -> None:
    rng = np.random.default_rng(11)
    corners = [{p.name: bound for p, bound in zip(effect.parameters, (side,) * 9)} for side in ("low", "high")]
    draws = [{p.name: getattr(p, side[p.name]) for p in effect.parameters} for side in corners]
    draws += [{p.name: rng.uniform(p.low, p.high) for p in effect.parameters} for _ in range(8)]
    for p in draws:
        made = predict([(effect, p)], states, rig)
        for channel in CHANNELS:
            assert np.isfinite(getattr(made, channel)).all(), (p, channel)
        mu, epsilon = effect.coefficients(np.full(N, 0.25), np.full(N, 0.55), made.space, states, p, rig)
        assert (mu >= 0).all() and (epsilon >= 0).all() and (epsilon <= 1).all(), p


def test_changes_its_channels_and_no_other(effect: Effect) -> None:
    rig = RIGS["quadrilateral"]
    assert effect.applies_to(rig)
    states = random_states(rig, N, np.random.default_rng(6))
    # how long contacts last concerns effects only that act on it: elsewhere the touch would show what the impact does
    timed = type(effect).contact_time is not Effect.contact_time
    tau = TAU if timed else 0.0
    made, base = (predict(on, states, rig, contact_time=tau) for on in ([(effect, at_scale(effect))], []))
    for channel in CHANNELS:
        change = np.abs(getattr(made, channel) - getattr(base, channel)).reshape(N, -1)
        if channel in ("impact", "flight"):
            change = change * [1.0, 1.0, rig.k_g]
        size = np.sqrt(np.mean(np.sum(change**2, axis=1)))
        if channel in effect.channels:
            assert size > RESOLVED[channel], channel
        elif timed:
            # the turning during a contact is of second order, but for bodies that it puts on another corner
            assert np.median(np.sqrt(np.sum(change**2, axis=1))) < RESOLVED[channel], channel
        else:
            assert size < 1e-9, channel  # difference quotients of the flight lose three digits


def test_does_nothing_where_it_does_not_apply() -> None:
    disk = Rig(Disk(radius=0.03), 0.0212, 9.81, 0.0)
    left_out = set()
    for rig in (disk, *RIGS.values()):
        states = random_states(rig, N, np.random.default_rng(12))
        for effect in EFFECTS.values():
            if effect.applies_to(rig):
                continue
            left_out.add((effect.name, rig.shape.kind))
            made, base = predict([(effect, at_scale(effect))], states, rig), predict([], states, rig)
            for channel in CHANNELS:
                np.testing.assert_array_equal(getattr(made, channel), getattr(base, channel), err_msg=effect.name)
    assert left_out >= {("rounded_corners", "ellipse"), ("rounded_corners", "disk"), ("angle_offset", "disk")}


def test_all_pairs_compose() -> None:
    rig = RIGS["quadrilateral"]
    states = random_states(rig, N, np.random.default_rng(13))
    alone = {
        name: predict([(effect, at_scale(effect))], states, rig, contact_time=TAU) for name, effect in EFFECTS.items()
    }
    for one, other in permutations(EFFECTS.values(), 2):
        both = predict([(one, at_scale(one)), (other, at_scale(other))], states, rig, contact_time=TAU)
        for channel in CHANNELS:
            values = getattr(both, channel)
            assert np.isfinite(values).all(), (one.name, other.name)
            # neither effect may swallow the other
            if channel in one.channels:
                assert not np.array_equal(values, getattr(alone[other.name], channel)), (one.name, other.name)


def test_mirror_symmetry(effect: Effect) -> None:
    rig = RIGS["quadrilateral"]
    flipped = Polygon(vertices=tuple((-x, y) for x, y in rig.shape.vertices))
    mirror_rig = Rig(flipped, rig.k_g, rig.gravity, rig.height)
    states = random_states(rig, N, np.random.default_rng(7))
    mirrored = states.moved(x=-states.x, theta=-states.theta, vx=-states.vx, omega=-states.omega)
    active = [(effect, at_scale(effect))]
    one, other = (predict(active, at, where, contact_time=TAU) for at, where in ((states, rig), (mirrored, mirror_rig)))
    odd = {"impact": [-1, 1, -1], "meet": [-1, 1, -1], "touch": 1, "flight": [-1, 1, -1]}
    differs = max(
        np.max(np.abs(getattr(other, channel) * odd[channel] - getattr(one, channel))) / RESOLVED[channel]
        for channel in effect.channels
    )
    if effect.name in BREAKS_MIRROR:
        assert differs > 1.0
    else:
        assert differs < 1e-6


def test_mirror_breakers_exist() -> None:
    assert set(EFFECTS) >= BREAKS_MIRROR


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
    for name, effect in EFFECTS.items():
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

        def coefficients(self, mu, epsilon, space, state, p, rig):
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
    assert [FAMILIES.index(effect.family) for effect in found.values()] == sorted(
        FAMILIES.index(effect.family) for effect in found.values()
    )
    rig = RIGS["ellipse"]
    states = random_states(rig, N, np.random.default_rng(9))
    made = predict([(found["sticky"], {"m": 0.1})], states, rig)
    np.testing.assert_array_equal(made.impact, predict([], states, rig, mu=0.35).impact)


def test_a_file_with_another_name_is_refused(extended_package) -> None:
    (extended_package / "sticky_wrong.py").write_text(dedent(NEW_EFFECT).format(name="sticky"))
    with pytest.raises(ImportError, match="sticky_wrong"):
        package._load()
