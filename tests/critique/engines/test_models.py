"""Engines as laws of the critique, and the table that compares them."""

import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hidden_effects import recorded

from thesis_lib.bodies.body import Body
from thesis_lib.commands.critique import critique as command
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.engine_contact import (
    CAUSE_OF,
    DEFAULT,
    LATE,
    MASS,
    STAND_INS,
    default_values,
    engine_law,
    lacks,
    press_in_engine,
)
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.engines import compare
from thesis_lib.critique.engines.compare import COLUMNS, WITH, WITHOUT, compare_models, model_sentences, read_models
from thesis_lib.critique.engines.fit import fit_engine
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.engines.bullet_engine import PACKAGE
from thesis_lib.engines.engine import impacts
from thesis_lib.engines.mujoco_engine import STEPS, MujocoEngine
from thesis_lib.engines.parameters import bullet_numbers
from thesis_lib.extensions.effect_probe import random_states
from thesis_lib.figures.critique.pictures import draw_models
from thesis_lib.foundation.columns import explain
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.state import State
from thesis_lib.report.critique.tables import models as page_of_models
from thesis_lib.simulate.compliant.drops import Falls, OwnContact
from thesis_lib.simulate.drake.drops import DropsInDrake
from thesis_lib.simulate.mujoco.causes import MujocoCauses
from thesis_lib.simulate.mujoco.contact import MujocoContact
from thesis_lib.simulate.mujoco.drops import DropsInMujoco
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, SQUARE, CompliantContact, HiddenCauses

RIG = Rig(ELLIPSE_BODY.shape, ELLIPSE_BODY.radius_of_gyration, 9.81, 0.0)
T = 1e-3  # s
bullet = pytest.mark.skipif(not find_spec("pybullet"), reason=f"Bullet is optional: pip install {PACKAGE}")
MU, EPSILON = 0.2, 0.6
VALUES = {"mu": MU, "epsilon": EPSILON, "damping_ratio": 10.0, "impedance": 0.9}
OFFSET = 1e-3  # m
# of drops in Bullet, whose corners are small balls: s, m, and the energy per mass below which the recording ends, m²/s²
STEP, CORNER, REST = 1e-5, 1e-6, 0.15


def at_touch(n: int) -> State:
    return random_states(RIG, n, np.random.default_rng(0))


def model_of(engine: str, *effects: str) -> Model:
    return Model(engine_law(engine), tuple(EFFECTS[name] for name in effects), takes_time=True)


def values_of(engine: str, **more: float) -> dict:
    force = engine_law(engine).force
    loss = force.loss(np.array([EPSILON]))
    return VALUES | {"tau": T * float((force.centroid(loss) / force.duration(loss))[0])} | more


@pytest.mark.parametrize("effects", [{}, {"com_offset.c_x": OFFSET, "com_offset.c_y": 0.0, "wrong_inertia.d_I": 0.1}])
def test_mujoco_resolves_the_contact_with_those_numbers(effects):
    touch, names = at_touch(12), ["com_offset", "wrong_inertia"] if effects else []
    after, took = press_in_engine(bind(model_of("mujoco", *names), values_of("mujoco", **effects), RIG), touch)
    causes = HiddenCauses(**{CAUSE_OF[key]: value for key, value in effects.items()})
    own = {"mu": MU, "epsilon": EPSILON, "impedance": VALUES["impedance"]}
    contact = MujocoContact(contact_time=T, impratio=10.0, steps=STEPS, **own)
    body = Body(shape=RIG.shape, mass=MASS, radius_of_gyration=RIG.k_g)
    expected = impacts(MujocoEngine(body, 12, contact=contact, causes=causes), touch.q, touch.v)
    np.testing.assert_allclose(after.v, expected.v, atol=1e-6)
    np.testing.assert_allclose(took, expected.t, atol=1e-9)
    assert (took > 0.5 * T).all()
    if effects:
        without, _ = press_in_engine(bind(model_of("mujoco"), values_of("mujoco"), RIG), touch)
        assert np.abs(after.v - without.v).max() > 0.05


@pytest.mark.parametrize("engine", ["mujoco", "drake", pytest.param("bullet", marks=bullet)])
def test_a_central_impact_gives_back_epsilon_at_one_metre_a_second(engine):
    """Gravity acts for a millisecond: 0.01 m/s."""
    pose, v = np.array([[0.0, RIG.shape.semi_axes[1], 0.0]]), np.array([[0.0, -1.0, 0.0]])
    flat = State.of(pose, v, np.zeros(1, int), np.zeros(1))
    after, took = press_in_engine(bind(model_of(engine), values_of(engine), RIG), flat)
    assert after.vy[0] == pytest.approx(EPSILON, abs=0.02)
    assert took[0] > 0.9 * T


def test_each_body_has_its_own_values():
    touch = at_touch(6)
    model, values = model_of("mujoco", "com_offset"), values_of("mujoco", **{"com_offset.c_y": 0.0})
    sizes = np.repeat([0.0, OFFSET], 3)
    mu = np.tile([0.1, 0.2, 0.3], 2)
    together, _ = press_in_engine(bind(model, values | {"com_offset.c_x": sizes, "mu": mu}, RIG), touch)
    for i in range(6):
        own = values | {"com_offset.c_x": sizes[i], "mu": mu[i]}
        alone, _ = press_in_engine(bind(model, own, RIG), touch.select(np.array([i])))
        np.testing.assert_allclose(together.v[i], alone.v[0], atol=1e-9)


def test_a_moving_surface_is_a_change_of_frame():
    touch, speed = at_touch(5), 0.3
    carried = touch.moved(vx=touch.vx + speed)
    still, took = press_in_engine(bind(model_of("mujoco"), values_of("mujoco"), RIG), touch)
    moving = values_of("mujoco", **{"moving_surface.V": speed})
    after, _ = press_in_engine(bind(model_of("mujoco", "moving_surface"), moving, RIG), carried)
    np.testing.assert_allclose(after.vx, still.vx + speed, atol=1e-9)
    np.testing.assert_allclose(after.x, still.x + speed * took, atol=1e-9)


@pytest.mark.parametrize("engine", ["mujoco", "drake"])
def test_the_default_contact_is_that_of_the_engine(engine):
    """MuJoCo's contact lasts 40 ms and gives back a seventh; Drake's hardly gives anything back."""
    values, mass = default_values(engine, 0.05), 0.05
    touch = at_touch(12)
    after, took = press_in_engine(bind(model_of(f"{engine}{DEFAULT}"), values, RIG), touch)
    energy = [v[:, 0] ** 2 + v[:, 1] ** 2 + (RIG.k_g * v[:, 2]) ** 2 for v in (touch.v, after.v)]
    assert (energy[1] < 0.6 * energy[0]).all() and (took <= LATE).all()
    lighter = default_values(engine, 0.5 * mass)
    assert (lighter == values) == (engine == "mujoco")  # Drake's stiffness is in N/m


@bullet
def test_bullets_default_is_a_rigid_contact_that_gives_nothing_back():
    """μ of two bodies is the product; it is over in one step of 1/240 s, in which the body sticks or slides on."""
    values, touch = default_values("bullet", 0.05), at_touch(12)
    assert (values["mu"], values["epsilon"]) == (0.25, 0.0) and default_values("bullet", 1.0) == values
    after, took = press_in_engine(bind(model_of(f"bullet{DEFAULT}"), values, RIG), touch)
    r = RIG.shape.contact_point(touch.theta)
    still = replace(RIG, gravity=0.0)
    free, _ = press_in_engine(bind(model_of(f"bullet{DEFAULT}"), values, still), touch)
    law = LAWS["anitescu_potra_newton"](touch.v, r, mass=1.0, k_g=RIG.k_g, mu=0.25, epsilon=0.0).v_post
    np.testing.assert_allclose(free.v, law, atol=0.03)
    np.testing.assert_allclose(after.v[:, 1] + r[:, 0] * after.omega, 0.0, atol=0.03)
    assert (took <= 1.0 / 240.0).all()


@pytest.mark.parametrize(
    ("engine", "effects", "missing"),
    [
        ("mujoco", ("com_offset", "moving_surface", "linear_drag", "mirrored_rotation"), []),
        ("mujoco", ("position_dependent_restitution", "wear"), []),
        ("drake", ("position_dependent_restitution", "surface_tilt"), ["position_dependent_restitution"]),
        ("mujoco", ("tangential_compliance", "wear"), ["tangential_compliance"]),
        ("drake", ("velocity_dependent_friction", "contact_torque"), ["velocity_dependent_friction", "contact_torque"]),
    ],
)
def test_what_an_engine_cannot_have_is_told(engine, effects, missing):
    assert lacks(engine, [EFFECTS[name] for name in effects]) == missing


def test_models_that_are_unknown_or_of_many_datasets_are_refused(tmp_path, capsys):
    for text, said in (("laws,gazebo", "there is no 'gazebo'; known are laws, mujoco, drake"), (" , ", "at least one")):
        with pytest.raises(UserError, match=said):
            read_models(text)
    assert read_models("laws, mujoco,mujoco") == ("laws", "mujoco")
    assert command(["--batch", str(tmp_path), "--models", "laws"]) == 2
    assert "--models compares models on one dataset" in capsys.readouterr().err
    assert command([str(tmp_path), "--models", "gazebo"]) == 2
    assert "there is no 'gazebo'" in capsys.readouterr().err


@pytest.fixture(scope="module")
def found():
    """Squares of MuJoCo whose centre of mass is displaced, criticised and compared."""
    contact, hidden = MujocoContact(mu=MU, epsilon=EPSILON, contact_time=T), MujocoCauses(com_offset_x=OFFSET)
    dataset = recorded(SQUARE, 48, 3, "squares", engine=DropsInMujoco(), contact=contact, hidden=hidden)
    settings = CritiqueSettings(episodes=False, folds=2, finalists=2, max_effects=1)
    judged = criticise_drops(dataset, rng=np.random.default_rng(0), settings=settings)
    said: list[str] = []
    return judged, compare_models(judged, ("laws", "mujoco"), said.append), said


@pytest.mark.slow
def test_an_engine_is_recognised_as_the_model_of_its_own_drops(found):
    judged, table, said = found
    assert [step.effect.name for step in judged.discovery.steps] == ["com_offset"]
    explain("models", table.columns)
    assert tuple(table.columns) == COLUMNS and len(said) == table["kind"].isin(["law", "engine"]).sum()
    best = table.iloc[0]
    assert (best["model"], best["effects"], best["behind"]) == ("mujoco", WITH, 0.0)
    assert best["error"] < 1.25 * best["noise_floor"]
    assert abs(best["mu"] - 0.2) < 4.0 * best["mu_std"] and abs(best["epsilon"] - 0.6) < 4.0 * best["epsilon_std"]
    assert best["contact_time"] == pytest.approx(T, rel=0.05)
    without = table[(table["model"] == "mujoco") & (table["effects"] == WITHOUT)].iloc[0]
    assert without["error"] > 2.0 * best["error"]
    rigid = table[(table["model"] == "mirtich") & (table["effects"] == WITH)].iloc[0]
    assert rigid["behind_low"] > 0.0
    rows = table[(table["model"] == "mujoco:default") & (table["effects"] == WITH)].set_index("kind")
    assert (rows["mu"]["default"], rows["mu_std"]["default"]) == (1.0, 0.0)
    assert (rows["error"] > 20.0 * best["error"]).all() and rows["mu"]["friction"] < 0.5


@pytest.mark.slow
def test_hydroelastic_bodies_are_an_engine_that_gives_back_what_made_its_drops():
    contact = CompliantContact(mu=MU, epsilon=EPSILON, contact_time=T)
    # the mesh of an ellipse takes far longer than that of a square
    made = recorded(SQUARE, 10, 5, engine=DropsInDrake("hydroelastic"), contact=contact)
    observations = observe(made, episodes=False)
    near = fit(Model(BASES[STAND_INS["drake_hydroelastic"][0]], takes_time=True), observations)
    found = fit_engine("drake_hydroelastic", near, observations)
    assert found.values["mu"] == pytest.approx(MU, abs=4.0 * found.std["mu"])
    assert found.std["mu"] < 0.01 * MU


@pytest.mark.slow
def test_an_engine_without_a_default_contact_has_no_row_of_it(found, monkeypatch):
    """Drake presses a hydroelastic body only by a modulus that is stated."""
    judged, _, _ = found
    asked = []

    def judged_as_one(critique, fitted):
        return dict.fromkeys(COLUMNS, 0.0) | {"model": fitted}, np.ones(len(critique.held_out))

    def default(critique, name, *_):
        asked.append(name)
        return []

    monkeypatch.setattr(compare, "_fitted", lambda critique, name, *_: name)
    monkeypatch.setattr(compare, "_judged", judged_as_one)
    monkeypatch.setattr(compare, "_default", default)
    compare_models(judged, ("mujoco", "drake_hydroelastic"))
    assert set(asked) == {"mujoco"}


@pytest.mark.slow
def test_what_is_compared_is_told_and_drawn(found):
    _, table, _ = found
    first, second = model_sentences(table)  # one engine agrees with itself
    assert first.startswith("MuJoCo errs least with the named effects: ") and "noise floor" in first
    assert second.startswith("MuJoCo at its defaults errs by ") and "times as much as fitted" in second
    page = str(page_of_models(table)).replace("\N{NO-BREAK SPACE}", " ")
    assert first in page and page.count("<tr") == len(table) + 1
    figure, numbers = draw_models(table)
    assert numbers is table and len(figure.axes) == 2
    assert next(label.get_text() for label in figure.axes[0].get_yticklabels()) == "MuJoCo"


def made_up(**more) -> pd.DataFrame:
    row = {"kind": "engine", "lacks": "", "epsilon": 0.5, "mu_bound": None, "behind_low": 0.01, "noise_floor": 0.01}
    rows = [
        {"model": "mujoco", "effects": WITH, "mu": 0.20, "error": 0.010},
        {"model": "drake", "effects": WITH, "mu": 0.21, "error": 0.020, "lacks": "wear"},
        {"model": "mujoco", "effects": WITHOUT, "mu": 0.10, "error": 0.1},
        {"model": "drake", "effects": WITHOUT, "mu": 0.30, "error": 0.1},
        *(
            {"model": f"{name}:default", "effects": WITHOUT, "kind": "friction", "mu": mu, "error": 0.5}
            for name, mu in (("mujoco", 0.2), ("drake", 0.05))
        ),
    ]
    return pd.DataFrame([row | more | one for one in rows])


def test_engines_that_made_up_for_a_hidden_cause_are_told():
    first, second, alone, third = model_sentences(made_up())
    assert (
        first == "MuJoCo errs least with the named effects: 0.0100 m/s (noise floor 0.0100 m/s); all others err more."
    )
    assert "by a factor of 3 without the named effects, and of 1.05 with them: they compensated" in second
    assert alone.endswith("by a factor of 4: 0.2 in MuJoCo and 0.05 in Drake, point contact.")
    assert third == "Drake, point contact cannot have wear, and is fitted without."
    assert "cannot be told from it" in model_sentences(made_up(behind_low=-0.001))[0]


def test_bullet_is_optional_and_told_how_to_install(monkeypatch, tmp_path, capsys):
    """Before anything is fitted, and before the dataset is looked at."""
    monkeypatch.setattr("thesis_lib.critique.engines.compare.find_spec", lambda name: None)
    assert command([str(tmp_path), "--models", "laws,bullet"]) == 2
    assert "pip install pybullet==3.2.7" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(UserError, match=r"Bullet cannot be used here .*: pip install pybullet==3\.2\.7"):
        press_in_engine(bind(model_of("bullet"), values_of("bullet"), RIG), at_touch(1))
    pinned = (Path(__file__).resolve().parents[3] / "benchmarks" / "requirements.txt").read_text(encoding="utf-8")
    assert PACKAGE in pinned.splitlines()


class DropsInBullet:
    """Drops of a square in Bullet, its corners small balls; what `simulate_compliant_drops` asks of an engine."""

    def accepts(self, contact, hidden):
        return OwnContact().accepts(contact, hidden)

    def fall(self, mechanics, pose, velocity, instants):
        import pybullet

        samples, t = instants.samples, np.zeros(len(pose))
        poses = np.full((len(pose), len(samples), 3), np.nan)
        numbers = bullet_numbers(MU, EPSILON, T, mass=mechanics.mass, step=STEP)
        world = pybullet.connect(pybullet.DIRECT)
        surface = pybullet.createMultiBody(
            0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=[0, 1, 0]), basePosition=[0, -CORNER, 0]
        )
        pybullet.changeDynamics(surface, -1, lateralFriction=1, contactStiffness=1e18, contactDamping=0)
        corners = [[x, y, 0.0] for x, y in mechanics.vertices]
        shape = pybullet.createCollisionShapeArray(
            [pybullet.GEOM_SPHERE] * 4, radii=[CORNER] * 4, collisionFramePositions=corners
        )
        body = pybullet.createMultiBody(mechanics.mass, shape)
        soft = {"contactStiffness": numbers.stiffness, "contactDamping": numbers.damping, "lateralFriction": MU}
        turning = {"localInertiaDiagonal": [mechanics.inertia] * 3, "maxJointVelocity": 1e6}
        pybullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0, **soft, **turning)
        pybullet.setGravity(0, -9.81, 0)
        pybullet.setPhysicsEngineParameter(fixedTimeStep=STEP, contactSlop=0, contactERP=0)
        for i, (q, v) in enumerate(zip(pose, velocity)):
            turn = [0, 0, np.sin(q[2] / 2), np.cos(q[2] / 2)]
            pybullet.resetBasePositionAndOrientation(body, [q[0], q[1], 0], turn)
            pybullet.resetBaseVelocity(body, [v[0], v[1], 0], [0, 0, v[2]])
            for k in range(len(samples)):
                place, turn = pybullet.getBasePositionAndOrientation(body)
                (vx, vy, _), (_, _, w) = pybullet.getBaseVelocity(body)
                poses[i, k] = place[0], place[1], 2.0 * np.arctan2(turn[2], turn[3])
                t[i] = samples[k]
                if 0.5 * (vx**2 + vy**2 + mechanics.inertia / mechanics.mass * w**2) + 9.81 * (place[1] - 0.03) < REST:
                    break
                for _ in range(round(1.0 / instants.rate / STEP)):
                    pybullet.stepSimulation()
            seen = ~np.isnan(poses[i, :, 2])
            poses[i, seen, 2] = q[2] + np.unwrap(poses[i, seen, 2] - q[2])
        pybullet.disconnect(world)
        return Falls(lambda times: poses, [], t)


@bullet
@pytest.mark.slow
def test_bullet_is_recognised_as_the_model_of_its_own_drops():
    contact = CompliantContact(mu=MU, epsilon=EPSILON, contact_time=T)
    dataset = recorded(SQUARE, 40, 3, "squares", contact=contact, engine=DropsInBullet(), duration=0.5)
    settings = CritiqueSettings(folds=2, finalists=2, max_effects=1)
    judged = criticise_drops(dataset, rng=np.random.default_rng(0), effects=[], settings=settings)
    table = compare_models(judged, ("mujoco", "bullet")).set_index("model")
    assert (table["effects"] == WITHOUT).all() and table.index[0] == "bullet"
    best, default = table.loc["bullet"], table[table["kind"] == "default"].loc["bullet:default"]
    assert best["error"] < 1.25 * best["noise_floor"]
    assert abs(best["mu"] - MU) < 4.0 * best["mu_std"] and abs(best["epsilon"] - EPSILON) < 4.0 * best["epsilon_std"]
    assert best["contact_time"] == pytest.approx(T, rel=0.05)
    assert table.loc["mujoco", "behind_low"] > 0.0
    assert (default["kind"], default["mu"], default["epsilon"]) == ("default", 0.25, 0.0)
    assert default["error"] > 10.0 * best["error"]
