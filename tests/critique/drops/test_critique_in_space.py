"""A critique of a box that tumbles in space names what is hidden, and nothing where nothing is."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from tosses import simulate_tosses, stated_hits

from thesis_lib.bodies.solids import Sphere
from thesis_lib.contact import LAWS, LAWS_IN_SPACE
from thesis_lib.critique import criticise
from thesis_lib.critique.contacts.engine_contact import default_values, engine_law
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.few_impacts import FewImpacts
from thesis_lib.critique.drops.own_restitution import own_restitution
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.drops.world import testable_effects as usable_effects
from thesis_lib.critique.engines.compare import (
    WITH,
    WITHOUT,
    _default,
    _fitted,
    compare_models,
    missed_tosses,
    whole_tosses,
)
from thesis_lib.critique.likelihood.at_impact import lines_beside, state_beside
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.in_space.hits import observe_in_space
from thesis_lib.critique.results import findings
from thesis_lib.critique.results.findings import few_diagnosis
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.as_written import AsWritten
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE
from thesis_lib.report.critique.tables import models
from thesis_lib.simulate.tosses.drawn import SpaceCase, make
from thesis_lib.simulate.tosses.own import OwnTosses

HALF = np.array([0.05, 0.04, 0.03])
K2 = (np.sum(HALF**2) - HALF**2) / 3.0  # of the homogeneous box
OFF = {"c_x": 3e-3, "c_y": 0.0, "c_z": 0.0}  # m
TRUTH = {"mu": 0.25, "epsilon": 0.5}


def content(**changes):
    body = {"shape": {"kind": "box", "half_extents": HALF.tolist()}, "radii_of_gyration": np.sqrt(K2).tolist()}
    noise = {"position": 2e-4, "rotation": 3e-3}
    return {"schema": 2, "body": body | changes, "rate": 240.0, "noise": noise}


def tossed(trials=28, seed=5, **hidden):
    """Tosses of a body that is not as believed: `hidden` are keys of `body`."""
    made = simulate_tosses(content(**hidden), trials, np.random.default_rng(seed), **TRUTH)
    return dataset_of(content(), trajectories=made.trajectories)


@pytest.fixture(scope="module")
def observed():
    return observe_in_space(tossed(12))


@pytest.fixture(scope="module")
def nothing_hidden_in_space():
    return criticise(tossed(seed=3))


@pytest.fixture(scope="module")
def centre_hidden():
    return criticise(tossed(center_of_mass=list(OFF.values())))


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_hidden(nothing_hidden_in_space):
    found = nothing_hidden_in_space.to_dict()
    assert found["verdict"] == "adequate" and not found["effects"] and not found["remaining"]["structured"]
    assert found["base_model"]["name"] == "anitescu_potra_newton"  # that of the tosses
    for name, value in TRUTH.items():
        assert found["base_model"]["parameters"][name]["value"] == pytest.approx(value, abs=2e-3)
    assert set(found["laws"]) == set(LAWS_IN_SPACE)


@pytest.mark.slow
def test_a_displaced_centre_of_mass_is_named_alone_and_it_is_said_which_contacts_err(centre_hidden):
    found = centre_hidden.to_dict()
    assert found["verdict"] == "effects" and [e["name"] for e in found["effects"]] == ["com_offset"]
    assert found["effects"][0]["indistinguishable_from"] == []
    for name, p in found["effects"][0]["parameters"].items():
        assert abs(p["value"] - OFF[name]) < 3.0 * p["std"] and p["std"] < 2e-4
    assert found["dimensions"] == 3 and json.dumps(found, allow_nan=False)
    kinds = found["error"]["by_contact"]
    assert list(kinds) == ["corner", "edge", "face"]
    assert kinds["corner"]["augmented"] < 0.5 * kinds["corner"]["base"]
    assert kinds["corner"]["augmented"] < 1.5 * kinds["corner"]["noise_floor"]
    assert min(kinds[kind]["used_share"] for kind in ("corner", "edge")) > 0.8
    assert 0 < sum(kind["n"] for kind in kinds.values()) <= centre_hidden.found.held_out.hits.sum()
    assert centre_hidden.summary().startswith("drops: effects")


@pytest.mark.slow
def test_models_are_followed_through_whole_tosses(centre_hidden):
    """The named effect lets the toss end where it did; an engine at its defaults does not."""
    found = centre_hidden.found
    table = compare_models(found, ("laws",)).set_index(["model", "effects"])
    own, lost = (table.loc[("anitescu_potra_newton", effects)] for effects in (WITH, WITHOUT))
    of_engine = Model(engine_law("mujoco:default"), found.ladder[-1][1].effects, True, space=SPACE)
    values = found.ladder[-1][1].values | default_values("mujoco", 1.0)
    engine = whole_tosses(found, of_engine, values)
    for name in ("position", "angle"):
        assert own[f"{name}_low"] < own[name] < own[f"{name}_high"] < min(lost[f"{name}_low"], engine[f"{name}_low"])
    assert "tosses: position" in models(table.reset_index())
    cut = found.source.trajectories.groupby("trial").tail(5)  # fewer frames than a first flight has
    unseen = whole_tosses(replace(found, source=replace(found.source, trajectories=cut)), of_engine, values)
    assert unseen.keys() == engine.keys() and all(np.isnan(list(unseen.values())))
    assert missed_tosses(unseen) == ["–", "–"]


@pytest.mark.parametrize("name", ["mirtich", "mujoco"])
def test_compared_models_have_what_every_model_of_the_data_has(observed, name):
    """Attitudes of the file in another reading than that by which flights were found: without it all hits miss."""
    always = (AsWritten(np.eye(4)),)
    final = SimpleNamespace(model=Model(LAWS["whittaker"], always=always, space=SPACE))
    critique = SimpleNamespace(ladder=[("", final)], training=observed, observations=observed, source=None)
    assert _fitted(critique, name, (), {}).model.always == always
    assert all(fitted.model.always == always for fitted in _default(critique, "mujoco", (), {}))


def test_the_error_of_a_hit_counts_the_spin_by_the_inertia_where_the_body_lies(observed, rng):
    dv = rng.standard_normal((4, len(observed), 6))
    of_body = observed.lines(0).space.turned_back(observed.value[:, 0, 3:].T, np.moveaxis(dv[..., 3:], 2, 0)[:, 0])
    expected = np.sqrt((dv[0, :, :3] ** 2).sum(axis=1) + K2 @ of_body**2)
    np.testing.assert_allclose(observed.norm(dv)[0], expected, rtol=1e-12)
    np.testing.assert_allclose(observed.norm(dv)[1], observed.norm(dv[1]))


def test_scale_size_and_gravity_together_act_like_another_inertia_but_move_further(observed):
    """Lengths 1 + s times as large, with all that scales with them, leave I/m as the only change."""
    world, s, size, g = Drops(observed), 0.1, 0.01, observed.rig.gravity
    without = world.fit("mirtich", (EFFECTS["wrong_size"], EFFECTS["wrong_gravity"]), effort="quick")
    law = {name: without.values[name] for name in ("mu", "epsilon", "tau")}
    scaled = {"wrong_size.s": (1.0 + size) / (1.0 + s) - 1.0, "wrong_gravity.dg": g / (1.0 + s) - g}
    as_fitted = {
        "length_scale": law | scaled | {"length_scale.s_L": s},
        "wrong_inertia": law
        | {"wrong_size.s": size, "wrong_gravity.dg": 0.0, "wrong_inertia.d_I": (1.0 + s) ** 2 - 1.0},
    }
    models = {name: without.model.with_effect(EFFECTS[name]) for name in as_fitted}
    hits = [Comparison(models[name], values, observed.single).R for name, values in as_fitted.items()]
    hits[0][:, -1] *= 1.0 + s  # the gap is in true lengths
    np.testing.assert_allclose(hits[0][:, :-1], hits[1][:, :-1], atol=1e-9)
    np.testing.assert_allclose(hits[0][:, -1], hits[1][:, -1], atol=1e-5)  # m; noise is 0.2 mm
    fits = [replace(without, model=models[name], values=values) for name, values in as_fitted.items()]
    further, near = (world.moved(one, replace(without, values=law | {name: 0.0 for name in scaled})) for one in fits)
    assert further - near > CritiqueSettings().moved


@pytest.mark.parametrize(
    "effect", ["com_offset", "quadratic_drag", "time_lag", "wrong_gravity", "inertia_ratios", "angle_offset"]
)
def test_lines_in_space_lead_to_the_states_and_back(observed, effect):
    model = Model(LAWS["anitescu_potra_newton"], (EFFECTS[effect],), space=observed.space)
    values = TRUTH | {f"{effect}.{p.name}": p.null + p.scale for p in model.parameters_of(EFFECTS[effect])}
    dynamics = bind(model, values, observed.rig)
    for side in (0, 1):
        value, slope = lines_beside(dynamics, observed, side, state_beside(dynamics, observed, side))
        # a tenth of the noise, and less: a lag is followed to first order
        limits = np.repeat([1e-4, 1e-2], 3)
        assert np.all(np.abs(slope - observed.slope[:, side]) < limits)
        off = observed.space.difference(value.T, observed.value[:, side].T)
        assert np.all(np.abs(off.T) < 0.1 * limits)


def test_what_a_body_in_space_cannot_show_is_said_with_the_reason(observed):
    testable, why_not = usable_effects(observed, timed=False)
    assert set(testable) | set(why_not) == set(EFFECTS)
    assert {"angle_offset", "later_friction", "misread_rotation", "rounded_corners", "torsional_friction"} <= set(
        testable
    )
    assert why_not["surface_patch"] == "is not defined in 3 dimensions"
    ball = Sphere(radius=0.04).about(np.array([0.0, 0.0, 1e-3]))
    rig = replace(observed.rig, shape=ball, has_angle=False, recorded=None)
    _, why_not = usable_effects(replace(observed, rig=rig), timed=False)
    assert why_not["rounded_corners"] == "does not apply to a body of shape sphere"
    assert why_not["orientation_dependent_friction"].startswith("orientation is not measured")
    assert why_not["later_restitution"].startswith("no trajectories of whole tosses")
    # a ball shows how its rotation was read, by spin against slip, but not how its frame is turned
    rig = replace(observed.rig, shape=Sphere(radius=0.04))
    testable, why_not = usable_effects(replace(observed, rig=rig), timed=False)
    assert {"mirrored_rotation", "misread_rotation", "rotation_scale"} <= set(testable)
    assert why_not["angle_offset"] == "does not apply to a body of shape sphere"


@pytest.mark.slow
@pytest.mark.usefixtures("without_pictures")
def test_what_is_saved_predicts_further_hits(centre_hidden, tmp_path):
    out = tmp_path / "critique"
    written = centre_hidden.save(out)
    assert json.loads((out / "diagnosis.json").read_text()) == written
    page = (out / "report.html").read_text()
    assert "displaced centre of mass" in page and "IRB bound, after the fact" in page
    model = load_model(out / "model.json")
    hits = stated_hits(content(center_of_mass=list(OFF.values())), 10, 99)
    states, after = hits[[*POSE_IN_SPACE, *V_PRE_IN_SPACE]], list(V_POST_IN_SPACE)
    predicted = model.predict(hits.drop(columns=after))
    assert (predicted["status"] == "ok").all()
    # sticking or not may hang on a thousandth of μ
    off = np.abs(predicted[after].to_numpy() - hits[after].to_numpy())
    assert np.median(off[:, :3]) < 3e-3 and np.median(off[:, 3:]) < 0.1
    pd.testing.assert_frame_equal(centre_hidden.predict(states), model.predict(states))
    with pytest.raises(UserError, match="lack the column"):
        model.predict({"x": [0.0]})


def test_episodes_alone_say_restitution_by_their_fit_only_and_no_bodies_have_no_path(observed, monkeypatch):
    episodes = observed.rows(np.flatnonzero(observed.span > 0.0))
    fitted = Drops(observed).fit("mirtich", (), effort="quick")
    assert len(episodes) > 3 and not len(own_restitution(fitted, episodes).epsilon)
    few = FewImpacts("", episodes, {"mirtich": fitted})
    assert few.restitution == (fitted.values["epsilon"], fitted.std["epsilon"])
    monkeypatch.setattr(findings, "are_enough", lambda impacts, trials: True)
    content = few_diagnosis(few)
    assert content["verdict"] is None and f"only 0 of {len(episodes)} stand alone" in content["reason"]
    slow = SimpleNamespace(rate=30.0, trajectories=None)
    one = FewImpacts("", observed.rows(np.array([0])), {"mirtich": fitted}, slow)
    assert "too slow for a verdict (1 usable impact in 1 trial). At 30 Hz" in few_diagnosis(one)["reason"]
    none = observed.rows(np.zeros(0, int))
    assert fitted.on(none).dynamics.path(np.zeros((0, 8)), none.lines(0)).shape == (0, 8, 7)


@pytest.mark.slow
def test_few_hits_say_restitution(tmp_path):
    found = criticise(tossed(6))
    content = found.to_dict()
    assert content["verdict"] is None and content["dimensions"] == 3
    of = content["restitution"]
    assert abs(of["value"] - TRUTH["epsilon"]) < 4.0 * of["std"] < 0.2
    found.save(tmp_path / "few")
    assert load_model(tmp_path / "few" / "model.json").rig.body.radii_of_gyration == tuple(np.sqrt(K2))


def test_an_engine_that_has_no_bodies_in_space_is_refused_before_minutes_pass():
    dataset = tossed(2)
    with pytest.raises(UserError, match="--models has no bullet for bodies in space; laws, mujoco and drake can be"):
        criticise(dataset, models=["laws", "bullet"])


@pytest.mark.slow
def test_what_an_effect_adds_to_a_long_contact_moves_the_body_during_half_of_it():
    """A couple against rolling in contacts of 2 ms: added when the contact is over, poses miss by 2.3 times noise."""
    case = SpaceCase("own", "contact_torque", 101)
    drops = Drops(observe_in_space(make(case, OwnTosses()), episodes=False))
    fitted = drops.fit("damped_contact", (EFFECTS["contact_torque"],))
    assert drops.judge(fitted).over_noise()["meet"][0] < 1.5
    assert fitted.values["contact_torque.m_r"] == pytest.approx(case.hidden["contact_torque.m_r"], rel=0.05)
