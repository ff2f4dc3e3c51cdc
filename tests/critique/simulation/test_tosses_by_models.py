"""Whole tosses by a model: closed forms, rest, energy, symmetry, what is written of them, and those of an MJCF file."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from saved_models import BOX, SPHERE, space_model

from thesis_lib.__main__ import main
from thesis_lib.bodies.solids import contact_kind
from thesis_lib.critique.export.export import exported
from thesis_lib.critique.simulation.in_mujoco import TossesInFile
from thesis_lib.critique.simulation.simulate_in_space import header_of, simulate_in_space
from thesis_lib.critique.simulation.tosses import reported, toss
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.datasets.read import read_dataset
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, multiplied, of_rotation_vector, rotated
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.causes_in_space import filmed
from thesis_lib.simulate.tosses.world import TossedWorld, released

G = 9.81
KINDS = [
    ("mirtich", {}),
    ("mirtich", {"tau": 1e-3}),
    ("compliant_contact", {"tau": 2e-3}),
]  # instant, brief, integrated


def state(place, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), attitude=(1.0, 0.0, 0.0, 0.0)) -> State:
    pose, motion = np.array([[*place, *attitude]]), np.array([[*velocity, *spin]])
    return State.of(pose, motion, np.zeros(1), np.zeros(1), None, SPACE)


def releases(model, n: int) -> State:
    at = released(TossedWorld(header_of(model, {})), n, np.random.default_rng(1))
    return State(at.pose, at.motion, np.arange(n), np.zeros(n), None, SPACE)


def every(seconds: float, rate: float, n: int) -> np.ndarray:
    return np.arange(round(seconds * rate) + 1)[:, None] / rate + np.zeros(n)


def energy(model, states: State) -> np.ndarray:
    """Per mass, J/kg."""
    spin = SPACE.turned_back(states.attitude, states.spin)
    turning = np.einsum("in,ij,jn->n", spin, np.asarray(model.believed.tensor), spin)
    return 0.5 * ((states.velocity**2).sum(axis=0) + turning) + G * states.height


def test_what_never_touches_is_a_parabola_with_an_even_turn():
    v, spin, t = np.array([0.3, -0.2, 2.0]), np.array([3.0, -5.0, 4.0]), every(0.4, 100.0, 1)
    out = toss(space_model(shape=SPHERE).dynamics, state((0.0, 0.1, 0.5), v, spin), t)
    expected = np.array([0.0, 0.1, 0.5])[:, None] + v[:, None] * t[:, 0] - 0.5 * G * np.outer([0, 0, 1], t[:, 0] ** 2)
    np.testing.assert_allclose(out.true.position, expected, atol=1e-10)
    turned = of_rotation_vector(np.outer(spin, t[:, 0]))
    np.testing.assert_allclose(np.abs((out.true.attitude * turned).sum(axis=0)), 1.0, atol=1e-12)
    assert not out.hits.any() and not out.rests.any()


def test_a_sphere_without_spin_bounces_as_newton_says():
    radius, fall, epsilon = SPHERE["radius"], 0.3, 0.6
    t = every(0.75, 200.0, 1)
    out = toss(space_model(shape=SPHERE, epsilon=epsilon).dynamics, state((0.0, 0.0, radius + fall)), t)
    v, touch = np.sqrt(2.0 * G * fall), np.sqrt(2.0 * fall / G)
    height, hits = fall - 0.5 * G * t[:, 0] ** 2, np.zeros(len(t))
    for _ in range(2):
        v *= epsilon
        since = t[:, 0] - touch
        height, hits = np.where(since > 0.0, v * since - 0.5 * G * since**2, height), hits + (since > 0.0)
        touch += 2.0 * v / G
    before_third = t[:, 0] < touch
    np.testing.assert_allclose(out.true.height[before_third] - radius, height[before_third], atol=1e-8)
    np.testing.assert_array_equal(out.hits[before_third, 0], hits[before_third])


@pytest.mark.parametrize(("law", "more"), KINDS)
def test_boxes_come_to_rest_on_a_face_and_gain_no_energy(law, more):
    model, n = space_model(law, **more), 4
    out = toss(model.dynamics, releases(model, n), every(2.5, 100.0, n))
    end, gap = out.true.select(slice(-n, None)), model.believed.gap(out.true).reshape(-1, n)
    assert out.rests.all() and set(contact_kind(model.rig.body.solid, end.attitude)) == {"face"}
    assert np.abs(gap[-1]).max() < 1e-4 and not end.motion.any()
    E = energy(model, out.true).reshape(-1, n)
    for of, above in zip(E.T, gap.T):  # in contact a spring may hold some
        assert np.diff(of[above > 5e-4]).max() < 1e-8
    assert np.diff(E[-20:], axis=0).max() < 1e-4  # of 0.3 J/kg: it hardly moves any more


@pytest.mark.parametrize(("law", "more"), KINDS)
def test_a_turn_about_the_vertical_turns_the_tosses(law, more):
    model, n, turn = space_model(law, **more), 3, of_rotation_vector(np.array([[0.0], [0.0], [1.1]]))
    start = releases(model, n)
    parts = start.position, start.attitude, start.velocity, start.spin
    moved = [multiplied(np.tile(turn, n), part) if len(part) == 4 else rotated(turn, part) for part in parts]
    times = every(0.6, 50.0, n)
    plain, turned = (toss(model.dynamics, one, times).true for one in (start, start.changed(*moved)))
    np.testing.assert_allclose(turned.position, rotated(turn, plain.position), atol=5e-6)  # where it has come to lie
    overlap = (turned.attitude * multiplied(np.tile(turn, len(plain)), plain.attitude)).sum(axis=0)
    np.testing.assert_allclose(np.abs(overlap), 1.0, atol=1e-9)


def test_a_box_slides_on_its_face_until_coulomb_has_stopped_it():
    model, v = space_model(mu=0.3), 0.5
    out = toss(model.dynamics, state((0.0, 0.0, 0.03), (v, 0.0, 0.0)), every(0.5, 100.0, 1))
    assert out.rests.all()
    np.testing.assert_allclose(out.true.position[0, -1], v**2 / (2.0 * 0.3 * G), rtol=0.02)


@pytest.mark.parametrize(("law", "more"), KINDS)
def test_a_body_that_slides_has_the_friction_of_sliding_and_one_that_hits_that_of_hits(law, more):
    plain, sliding = (
        space_model(law, mu=0.2, **more),
        space_model(law, mu=0.2, **more, **{"sliding_friction.mu_s": 0.4}),
    )
    t, on_table = every(0.5, 100.0, 1), state((0.0, 0.0, 0.03), (0.5, 0.0, 0.0))
    way = [toss(model.dynamics, on_table, t).true.position[0, -1] for model in (plain, sliding)]
    np.testing.assert_allclose(way[0], 2.0 * way[1], rtol=0.05)
    falling, first = state((0.0, 0.0, 0.2), (0.5, 0.0, 0.0)), every(0.22, 100.0, 1)  # one hit of the whole face
    fast = [toss(model.dynamics, falling, first).true.velocity[0, -1] for model in (plain, sliding)]
    assert fast[0] == pytest.approx(fast[1], abs=1e-9) and fast[0] < 0.49


def test_later_hits_have_another_restitution_after_the_first():
    fall, t = 0.3, every(0.75, 200.0, 1)
    model = space_model(shape=SPHERE, epsilon=0.5, **{"later_restitution.d": 0.4})
    height = toss(model.dynamics, state((0.0, 0.0, 0.04 + fall)), t).true.height - 0.04
    bounces = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] > height[2:])) + 1
    np.testing.assert_allclose(height[bounces[:2]], [0.25 * fall, 0.25 * 0.49 * fall], rtol=5e-3)


def test_the_camera_scales_turns_from_the_first_frame_on():
    model = space_model(shape=SPHERE, **{"rotation_scale.s_R": 0.1})
    out = toss(model.dynamics, state((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.0, 6.0)), every(0.4, 100.0, 1))
    seen = reported(model.dynamics, out)
    np.testing.assert_allclose(SPACE.turn_between(seen.attitude[:, :1], seen.attitude[:, -1:])[2], 1.1 * 2.4, rtol=1e-9)


@pytest.mark.parametrize(
    "hidden",
    [
        {"mirrored_rotation.mirrored_axis": 2.0},
        {"misread_rotation.reading": 1.0},
        {"camera_pose.b_x": 0.3, "camera_pose.b_y": 0.1, "camera_pose.b_z": 0.0},
    ],
)
def test_scaled_turns_are_scaled_back_in_the_axes_in_which_they_are_reported(hidden):
    """A model reports what the hidden causes do, and recovers the true attitudes from the reported ones."""
    model = space_model(shape=BOX, **hidden, **{"rotation_scale.s_R": 0.1})
    out = toss(model.dynamics, state((0.0, 0.0, 2.0), spin=(4.0, -3.0, 6.0)), every(0.4, 500.0, 1))
    seen = reported(model.dynamics, out)
    if "misread_rotation.reading" not in hidden:  # the camera scales the turns of the correct quaternions
        expected = filmed(out.true, model.rig, hidden | {"rotation_scale.s_R": 0.1})
        assert SPACE.turn_between(expected.attitude, seen.attitude) == pytest.approx(0.0, abs=1e-9)
    recorded = WholeTosses.of(seen, np.zeros(0), np.zeros(0))
    true = model.dynamics.on(replace(model.dynamics.rig, recorded=recorded)).to_true(seen)
    assert SPACE.turn_between(out.true.attitude, true.attitude) == pytest.approx(0.0, abs=1e-9)


def test_simulate_writes_what_the_camera_reports_of_given_states(tmp_path, capsys):
    rig = {"tracked": {"position": (0.02, 0.01, 0.03), "quaternion": (0.8, 0.6, 0.0, 0.0)}}
    model = space_model(rig=rig, **{"length_scale.s_L": 0.02})
    model.save(tmp_path / "model.json")
    states = pd.DataFrame([[4, 0.1, 0.2, 0.4, 0.6, 0.0, 0.8, 0.0, 1.0, 0.5, 0.2, 2.0, 8.0, -3.0]])
    states.columns = ["trial", *POSE_IN_SPACE, "vx", "vy", "vz", "wx", "wy", "wz"]
    states.to_csv(tmp_path / "states.csv", index=False)
    command = ["simulate", str(tmp_path / "model.json"), str(tmp_path / "states.csv"), "--duration", "0.3", "-q"]
    assert main([*command, "-o", str(tmp_path / "made")]) == 0 and not capsys.readouterr().err
    made = read_dataset(tmp_path / "made")
    table = made.trajectories
    assert made.trials.tolist() == [4] and len(table) == 73
    np.testing.assert_allclose(table[list(POSE_IN_SPACE)].iloc[0], states[list(POSE_IN_SPACE)].iloc[0], atol=1e-6)
    step = table[["x", "y"]].diff().iloc[1].to_numpy() / table["t"].iloc[1]
    np.testing.assert_allclose(step, [1.0, 0.5], atol=0.3)  # the tracked point circles about the centre of mass
    states.assign(z=0.01).to_csv(tmp_path / "states.csv", index=False)
    capsys.readouterr()
    assert main([*command, "-o", str(tmp_path / "deep")]) == 0
    warned = capsys.readouterr().err
    assert re.search(r"states.csv: 1 of 1 toss.es. begin in the surface, toss 4 by 0.0\d+ m; check height", warned)
    with pytest.raises(UserError, match="lack the column"):
        simulate_in_space(model, states=states.drop(columns="wx"), rng=np.random.default_rng(0))
    with pytest.raises(UserError, match=r"The quaternion has the length 0\.5 in 1 row"):
        simulate_in_space(model, states=states.assign(qw=0.3, qy=0.4), rng=np.random.default_rng(0))
    with pytest.raises(UserError, match="one row for each toss"):
        simulate_in_space(model, states=pd.concat([states, states]), rng=np.random.default_rng(0))


MODEL = {"law": "convex_contact", "tau": 1e-3, "damping_ratio": 10.0, "impedance": 0.9, "com_offset.c_x": 3e-3}
MODEL |= {"com_offset.c_y": 0.0, "com_offset.c_z": -2e-3, "surface_height.h": 0.02, "inertia_ratios.a_y": 0.2}
MODEL |= {"inertia_ratios.a_z": 0.1, "surface_tilt.phi_x": 0.1, "surface_tilt.phi_y": 0.0}
BODY = {"shape": BOX, "mass": 0.25, "radii_of_gyration": (0.03, 0.035, 0.04), "center_of_mass": (0.004, 0.0, 0.006)}
FILMED = {"body": BODY, "gravity": (0.0, -9.0, -3.9), "surface": {"point": (0.1, 0.2, 0.3)}}
FEW = 6  # frames after the first hit: from then on a next one may have begun, and small errors grow
CLOSE = (1e-4, 3e-3, 2e-3)  # m, rad, m: until the hit, and after it
SECOND = '<body name="lid"><freejoint/><geom size=".01"/></body>'
COARSE = 'timestep="2e-5"'


@pytest.fixture
def file(tmp_path):
    def made(model):
        path = tmp_path / "mine.xml"
        path.write_text(re.sub('timestep="[^"]+"', COARSE, exported(model, "mjcf").content.decode()))
        return path

    return made


def test_a_toss_in_the_file_is_that_of_the_model(file):
    """In axes of a camera, over a table that leans and lies higher than believed, about a centre of mass aside."""
    model, n = space_model(rig=FILMED, **MODEL), 2
    rng, dynamics = np.random.default_rng(3), model.dynamics
    pose = np.concatenate([rng.uniform(-0.1, 0.1, (2, n)), np.full((1, n), 0.12), np.zeros((4, n))])
    pose[3:] = of_rotation_vector(rng.standard_normal((3, n)))
    motion = rng.uniform(-1, 1, (6, n)) * np.r_[[0.5] * 3, [8.0] * 3][:, None]
    start = State(pose, motion, np.arange(n), np.zeros(n), None, SPACE)
    times = np.arange(50)[:, None] / 250.0 + np.zeros(n)
    own = toss(dynamics, start, times)
    found = TossesInFile(file(model), "body", model).toss(dynamics, start, times)
    off = SPACE.difference(found.true.pose, own.true.pose).reshape(6, len(times), n)
    place, turn = np.linalg.norm(off[:3], axis=0), np.linalg.norm(off[3:], axis=0)
    for i in range(n):
        hit, there = (int((hits[:, i] > 0).argmax()) for hits in (own.hits, found.hits))
        assert 10 < hit < len(times) - FEW and abs(there - hit) <= 1
        assert place[: hit - 1, i].max() < CLOSE[0] and turn[: hit - 1, i].max() < CLOSE[1]
        assert place[hit : hit + FEW, i].max() < CLOSE[2]


def test_a_timestep_that_is_too_coarse_for_the_contact_of_a_file_is_said(file):
    """MuJoCo's defaults are fine enough; an exported contact of 2.5 ms needs a twentieth of that."""
    model = space_model(**MODEL)
    path = file(model)
    assert not TossesInFile(path, "body", model).coarse
    text = path.read_text().replace(COARSE, 'timestep="1e-3"')
    path.write_text(text)
    assert re.search(r"lasts 0\.0025 s: .* needs 0\.00013 s or less", TossesInFile(path, "body", model).coarse)
    path.write_text(re.sub('solref="[^"]+" solimp="[^"]+"', "", text.replace("1e-3", "2e-3")))
    assert not TossesInFile(path, "body", model).coarse


@pytest.mark.slow  # 15 s
def test_the_command_compares_files(file, tmp_path, capsys):
    """The file of the true body errs less than one that believes in another centre of mass."""
    numbers = {name: value for name, value in MODEL.items() if name not in ("damping_ratio", "impedance")}
    model = space_model(**numbers | {"law": "mirtich"})
    write_dataset(simulate_in_space(model, 4, duration=0.3, rng=np.random.default_rng(2)), tmp_path / "data")
    model.save(tmp_path / "model.json")
    better = file(model)
    other = tmp_path / "other.xml"
    text = better.read_text().replace('<inertial pos="0.003 0 -0.002"', '<inertial pos="-0.003 0 0.002"')
    other.write_text(text.replace('body name="body"', 'body name="box"'))  # as a user's file names it
    command = ["rollout", f"{tmp_path}/model.json", f"{tmp_path}/data", "--all", "--json", "-q"]
    command += ["--mjcf", str(other), str(better)]
    assert main(command) == 0
    content = json.loads(capsys.readouterr().out)
    errors = {name: of["benchmark"]["position_m"] for name, of in content["files"].items()}
    assert errors["mine.xml"] < 0.6 * errors["other.xml"]
    assert errors["mine.xml"] < 2.0 * content["floor"]["benchmark"]["position_m"] + 1e-3
    assert main([*command, "--body", "box", "body"]) == 0
    assert json.loads(capsys.readouterr().out) == content
    assert main([*command, "--body", "box"]) == 2 and "mine.xml: there is no body 'box'" in capsys.readouterr().err
    assert main([*command, "--body", *"abc"]) == 2 and "3 names and --mjcf 2 files" in capsys.readouterr().err


def test_a_file_that_cannot_be_tossed_says_why(file):
    model = space_model(**MODEL)
    path = file(model)
    text = path.read_text()
    boxed = text.replace('type="plane"', 'type="box"').replace('size="0 0 1"', 'size="1 1 1"')
    for written, body, said in (
        (text, "box", "no body 'box' with a free joint; its free bodies: body"),
        (
            text.replace("</worldbody>", f"{SECOND}</worldbody>"),
            None,
            "2 bodies with a free joint; .* bodies: body, lid",
        ),
        (text.replace("<freejoint/>", ""), None, "0 bodies with a free joint; .* none with a name"),
        (boxed, "body", "has 0 planes; it needs exactly one"),
        (text.replace("<freejoint/>", ""), "body", "no body 'body' with a free joint"),
        ("<mujoco><worldbody/></mujoc>", "body", "MuJoCo cannot read it"),
    ):
        path.write_text(written)
        with pytest.raises(UserError, match=said):
            TossesInFile(path, body, model)
