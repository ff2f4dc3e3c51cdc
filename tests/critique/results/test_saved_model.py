"""A saved model predicts what the fitted one does, and a file that is wrong is refused with the reason."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hidden_effects import LAW, TRUTH, sizes

from tests.critique.simulation.saved_models import model_of
from thesis_lib.bodies.walls import Wall
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.contact_time import duration
from thesis_lib.critique.contacts.kinds import bind, kind_of
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_model import STATE, SavedModel, SavedReference, saved
from thesis_lib.datasets.format.impacts import V_POST, V_PRE
from thesis_lib.effects import effects_in
from thesis_lib.effects.effect import Reference, Rig
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import PLANE
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, SQUARE

SIX_DIGITS = 1e-5  # parameters are stored with six digits
EXACT = 1e-12
LONG = ["com_offset", "linear_drag", "surface_height", "surface_tilt", "time_lag", "later_friction"]
LONG += [
    "position_dependent_friction",
    "position_dependent_restitution",
    "wrong_gravity",
    "wrong_inertia",
    "wrong_size",
]


@pytest.fixture
def states() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    n = 50
    return pd.DataFrame(
        {
            "x": rng.uniform(-0.2, 0.2, n),
            "y": 0.03,
            "theta": rng.uniform(-3.0, 3.0, n),
            "vx": rng.uniform(-1.0, 1.0, n),
            "vy": -rng.uniform(1.5, 3.0, n),
            "omega": rng.uniform(-10.0, 10.0, n),
        }
    )


def model_with(**values: float) -> SavedModel:
    return model_of(law=LAW.name, **{**TRUTH, **values})


def test_a_critiques_model_comes_back_from_its_file(hidden_impacts, states, tmp_path):
    fitted, rig = hidden_impacts.ladder[-1][1], hidden_impacts.observations.rig
    path = tmp_path / "model.json"
    saved(fitted, rig, "drops").save(path)
    model = load_model(path)
    assert model.effects == ("tangential_restitution",) and model.law == hidden_impacts.discovery.base
    assert model.values == pytest.approx(fitted.values, rel=SIX_DIGITS)
    assert model.believed == rig  # what the user gave is not rounded
    assert "NaN" not in path.read_text()
    first = path.read_bytes()
    load_model(path).save(path)
    assert path.read_bytes() == first


def at_touch(state: State, rig: Rig) -> State:
    """The states flown back to where the believed body touches the believed surface."""
    back, gravity = np.zeros(len(state.x)), np.array([[0.0, -rig.gravity, 0.0]])
    earlier = state
    for _ in range(20):
        r_x = rig.shape.contact_point(earlier.theta)[:, 0]
        back += rig.shape.gap(earlier.y, earlier.theta, rig.height) / (earlier.vy + r_x * earlier.omega)
        earlier = state.flown(gravity, -back)
    return earlier


@pytest.mark.parametrize("law", ["as found", "compliant_contact"])
def test_predictions_of_held_out_drops_are_the_critiques_own(nothing_hidden, law):
    """Contacts of 1 ms: the critique predicts where the arcs meet, the file where contacts begin."""
    fitted, o = nothing_hidden.ladder[-1][1], nothing_hidden.held_out.single
    if law != "as found":
        fitted = replace(fitted, model=replace(fitted.model, law=BASES[law]))
    rig, model, values = o.rig, fitted.model, fitted.values
    before = Comparison(model, values, o).before
    # noise moves the place where the arcs meet; set the body as deep as the contact time says
    deep = rig.shape.gap(before.y, before.theta, rig.height) + bind(model, values, rig).strike(before)[1]
    before = before.moved(y=before.y - deep)
    own = bind(model, values, rig).predict(before)
    if kind_of(model).integrated:
        own = bind(model, values, rig).end(before, np.zeros(len(o)), single=True)
    touch = at_touch(before, rig)
    table = pd.DataFrame({name: getattr(touch, name) for name in STATE})
    found = saved(fitted, rig, "drops").predict(table)[["vx_post", "vy_post", "omega_post"]].to_numpy()
    found[:, 1] += rig.gravity * (bind(model, values, rig).off(touch).t - before.t)
    scale = [1.0, 1.0, rig.k_g]
    difference, instant = (
        np.median(np.linalg.norm((v - own.v) * scale, axis=1))
        for v in (found, bind(model, values | {"tau": 0.0}, rig).predict(touch).v)
    )
    assert difference < 1e-4 < 1e-3 < instant  # m/s


@pytest.mark.slow
@pytest.mark.parametrize(("law", "error"), [("mirtich", 0.004), ("compliant_contact", 0.001)])
@pytest.mark.parametrize("body", [ELLIPSE_BODY, SQUARE], ids=["ellipse", "square"])
def test_a_contact_of_a_millisecond_is_predicted_from_touch_to_its_end(body, law, error):
    """As the simulator integrates it, without noise; the square's next corner often hits in the same contact."""
    made = simulate_compliant_drops(body, PROOF_RELEASE, 60, rng=np.random.default_rng(3))
    truth = made.impacts.query("impact == 0 and separated")
    states = truth[["x", "y", "theta", *V_PRE]].set_axis(list(STATE), axis=1)

    def median_error(**tau: float) -> float:
        values = {"mu": 0.15, "epsilon": 0.55, **tau}
        rig = {"shape": body.shape, "radius_of_gyration": body.radius_of_gyration, "gravity": 9.81, "height": 0.0}
        parameters = {name: {"value": value, "unit": ""} for name, value in values.items()}
        model = SavedModel.model_validate({"law": law, "parameters": parameters, "rig": rig})
        d = model.predict(states)[list(V_POST)].to_numpy() - truth[list(V_POST)].to_numpy()
        return float(np.median(np.linalg.norm(d * [1.0, 1.0, body.radius_of_gyration], axis=1)))

    taken = median_error(tau=1e-3 / duration(1.0, 0.55))
    assert taken < error and taken < 0.4 * median_error()


def test_without_effects_it_is_the_law(states):
    found = model_with().predict(states)
    r = ELLIPSE_BODY.shape.contact_point(states["theta"].to_numpy())
    v_pre = states[["vx", "vy", "omega"]].to_numpy()
    out = LAW(v_pre, r, mass=1.0, k_g=ELLIPSE_BODY.radius_of_gyration, **TRUTH)
    assert found[["vx_post", "vy_post", "omega_post"]].to_numpy() == pytest.approx(out.v_post, abs=EXACT)
    assert list(found.columns[:6]) == list(STATE)


def test_bodies_that_do_not_touch_are_told(states):
    """By the gap of the model: an effect that moves the surface moves it."""
    states.loc[1:4, "y"] += 2.0
    with pytest.warns(UserWarning, match=r"In 4 of 50 row.*row 2 by \+2 m, .*row 4 by \+2(\.0\d)? m and 1 more"):
        model_with().predict(states)
    with pytest.warns(UserWarning, match=r"In 46 of 50 row.*row 1 by −2 m"):
        model_with(**{"surface_height.h": 2.0}).predict(states)
    model = model_with()
    between = model.model_copy(update={"rig": model.rig.model_copy(update={"gravity": 0.0, "walls": (FLOOR,)})})
    with pytest.warns(UserWarning, match=r"In 4 of 50 row.*away from \(\+\) or inside \(−\) the wall.*row 2 by \+2 m"):
        between.predict(states)


CAMERA_AND_BODY = {
    "length_scale": {"length_scale.s_L": 0.013},
    "marker_offset": {"marker_offset.d_x": 0.0013, "marker_offset.d_y": -0.0007},
    "com_offset": {"com_offset.c_x": 0.0011, "com_offset.c_y": 0.0007},
    "moving_surface": {"moving_surface.V": 0.5},
}
FLOOR = Wall(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0))


@pytest.mark.parametrize("tau", [None, 0.0, 1e-3])
@pytest.mark.parametrize("effect", CAMERA_AND_BODY)
def test_a_body_that_leaves_keeps_its_velocity_and_is_told(states, effect, tau):
    """By the contact's own v_n, whatever camera the velocities pass, at a floor and at a wall."""
    states.loc[::2, "vy"] *= -1.0
    leaves = np.arange(len(states)) % 2 == 0
    model = model_with(**CAMERA_AND_BODY[effect], **({} if tau is None else {"tau": tau}))
    between = model.model_copy(update={"rig": model.rig.model_copy(update={"gravity": 0.0, "walls": (FLOOR,)})})
    for one in (model, between):
        found = one.predict(states)
        assert found["status"].tolist() == np.where(leaves, "not_approaching", "ok").tolist()
        assert np.array_equal(found.loc[leaves, list(V_POST)], states.loc[leaves, ["vx", "vy", "omega"]])
        assert (found.loc[~leaves, "vy_post"] > states.loc[~leaves, "vy"]).all()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.drop(columns="omega"), "lack the column.*omega"),
        (lambda t: t.assign(vx=[np.nan, *t["vx"][1:]]), "vx holds no finite number in 1 row.*row 1"),
        (lambda t: t.assign(vy="fast"), "vy holds no finite number in 50 row"),
    ],
)
def test_bad_states_are_refused(states, change, says):
    with pytest.raises(UserError, match=says):
        model_with().predict(change(states))
    assert len(model_with().predict(states.iloc[:0])) == 0


def numbers(**values: float) -> dict:
    return {name: {"value": value, "unit": "1"} for name, value in (TRUTH | values).items()}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"law": "newton"}, "no law 'newton'"),
        ({"effects": ["gravity_waves"]}, "no effect 'gravity_waves'"),
        ({"effects": ["moving_surface"]}, "missing parameter.s.: moving_surface.V. Write it again"),
        ({"effects": LONG}, "missing parameter.s.: com_offset.c_x, .*, wrong_size.s. Write it again"),
        ({"parameters": numbers(m=1.0, nu=1.0)}, "json: unknown parameter.s.: m, nu. Write it again"),
        ({"parameters": numbers(**dict.fromkeys("abcdefghijkl", 1.0))}, ": a, b, .*, i, j and 2 more. Write"),
        ({"effects": ["other_friction_at_west"]}, "no wall 'west' .* there are no walls"),
        ({"parameters": numbers(tau=-1e-4)}, "tau must be between 0 and"),
        ({"parameters": numbers(tau=1.0)}, "tau must be between 0 and"),
        ({"parameters": numbers() | {"mu": {"value": 0.2, "unit": "mm"}}}, "mu must be in 1, not in 'mm'"),
        ({"schema": 2}, "schema"),
        ({"colour": "red"}, "colour"),
        ({"rig": {"shape": {"kind": "disk", "radius": -1.0}}}, "radius"),
    ],
)
def test_a_wrong_file_is_refused_with_the_reason(tmp_path, change, says):
    content = model_with().model_dump(mode="json", by_alias=True) | change
    path = tmp_path / "model.json"
    path.write_text(json.dumps(content))
    with pytest.raises(UserError, match=says):
        load_model(path)


def test_every_effect_can_be_saved_and_predicts(states, tmp_path):
    states["trial"], states["t"] = 1, 0.1
    for name, effect in effects_in(PLANE).items():
        path = tmp_path / f"{name}.json"
        model_with(**sizes(effect, 0.5)).save(path)
        found = load_model(path).predict(states)
        assert np.isfinite(found[["vx_post", "vy_post", "omega_post"]].to_numpy()).all(), name


def test_an_effect_that_needs_the_trial_asks_for_it_and_knows_where_it_counts_from(states, tmp_path):
    worn = model_with(**{"wear.w": -0.01})
    with pytest.raises(UserError, match="depends on trial"):
        worn.predict(states)
    late, early = (worn.predict(states.assign(trial=trial))["vy_post"].mean() for trial in (10, 0))
    assert late < early
    there = SavedReference(x=3.0, trial=20260106.0)
    far = worn.model_copy(update={"rig": worn.rig.model_copy(update={"reference": there})})
    far.save(tmp_path / "far.json")
    worn.save(tmp_path / "near.json")
    assert "reference" not in (tmp_path / "near.json").read_text()
    back = load_model(tmp_path / "far.json")
    assert back.believed.reference == Reference(3.0, 0.0, 20260106.0)
    after, expected = (model.predict(states.assign(trial=trial)) for model, trial in ((back, 20260116), (worn, 10)))
    assert after["vy_post"].tolist() == expected["vy_post"].tolist()
    # at release 0 restitution would stand at 1, and so would it at release 1
    with pytest.raises(UserError, match="depends on trial"):
        back.predict(states)
