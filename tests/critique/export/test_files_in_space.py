"""Models in space as files: the engines read the body that the model means, and do with it what its law does."""

import hashlib
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from engine_runs import by_drake, by_mujoco, inertia_in_drake, inertia_in_mujoco, plant_of, require_told

from tests.critique.simulation.saved_models import BOX, SPHERE, space_model
from thesis_lib.__main__ import main
from thesis_lib.critique.contacts.episodes import Played
from thesis_lib.critique.export.export import exported, patched
from thesis_lib.critique.export.solid import FORMATS
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.effects.effect import parameters_in
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector, rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.causes_in_space import true_rig

FIRM = {"law": "convex_contact", "tau": 1e-3, "damping_ratio": 10.0, "impedance": 0.9}
SOFT = {"law": "hunt_crossley_contact", "tau": 1e-3}
SHAPES = {
    "box": BOX,
    "round box": {**BOX, "edge_radius": 0.005},
    "sphere": SPHERE,
    "ellipsoid": {"kind": "ellipsoid", "semi_axes": (0.05, 0.03, 0.04)},
    "cylinder": {"kind": "cylinder", "radius": 0.04, "half_length": 0.03},
    "capsule": {"kind": "capsule", "radius": 0.02, "half_length": 0.03},
}
COM = {"com_offset.c_x": 2e-3, "com_offset.c_y": -1e-3, "com_offset.c_z": 1e-3}
# what is hidden of body and table, where a simulator has it of its own (`true_rig`)
HIDDEN = COM | {
    "wrong_inertia.d_I": 0.2,
    "inertia_ratios.a_y": 0.1,
    "inertia_ratios.a_z": -0.05,
    "inertia_axes.b_x": 0.1,
    "inertia_axes.b_y": 0.05,
    "inertia_axes.b_z": 0.3,
    "wrong_size.s": 0.02,
    "rounded_corners.rho": 0.003,
    "surface_height.h": 0.002,
    "surface_tilt.phi_x": 0.04,
    "surface_tilt.phi_y": -0.02,
}
# axes of a camera, in which up is y and z, and the table does not go through the origin
FILMED = {"gravity": (0.0, -9.0, -3.9), "surface": {"point": (0.1, 0.2, 0.3)}}
DIGITS = 1e-8  # relative: nine digits stand in a file
LEAD, SPAN, STEP = 2e-4, 5e-3, 5e-6  # s: of flight before the touch, after it, of MuJoCo
AWAY = 0.015  # m
# m/s, median and most, of one hit: the law is integrated in 64 steps, the touch falls anywhere in one of MuJoCo's, and
# friction on a pyramid jumps from edge to edge; Drake puts its force in the middle of the overlap, the law at its end
CLOSE = {"mjcf": (2e-3, 6e-3), "sdf": (9e-3, 0.015), "urdf": (4e-3, 0.01)}
CLOSE_ON_PYRAMID = (4e-3, 0.015)
MINE = """<mujoco>
  <!-- my box: friction='0.5' is a guess -->
  <option timestep="0.00001" cone="elliptic"   gravity="0 0 -9.81"/>
  <worldbody>
    <geom type='plane' name="table" size="1 1 .1"/>
    <body name="box" pos="0 0 .3"><freejoint/>
      <inertial pos="0 0 0" mass="0.3" quat="0.9 0.1 0 0" diaginertia="2e-4 3e-4 3.4e-4"/>
      <geom name = "hull" type="box" size=".05 .04 .03" friction=".5 .005 .0001" />
    </body>
  </worldbody>
  <contact><pair geom1="hull" geom2="table"/></contact>
</mujoco>
"""


def touching(model: SavedSpaceModel, n: int) -> State:
    """Bodies that come down and touch with one point, the next one `AWAY` above it, in the frame of the surface."""
    rng = np.random.default_rng(5)
    many = 4 * n
    pose = np.concatenate([np.zeros((3, many)), of_rotation_vector(3.0 * rng.standard_normal((3, many)))])
    motion = np.concatenate([rng.uniform(-1, 1, (2, many)), rng.uniform(-3, -1.5, (1, many))])
    motion = np.concatenate([motion, rng.uniform(-8, 8, (3, many))])
    states = State(pose, motion, np.arange(many), np.zeros(many), None, SPACE)
    pose[2] -= model.dynamics.gap(states)
    heights = np.sort(model.believed.shape.minkowski.heights(pose[3:]), axis=0)
    rows = np.arange(many) if len(heights) == 1 else np.flatnonzero(heights[1] > heights[0] + AWAY)
    return State(pose, motion, states.trial, states.t, None, SPACE).select(rows[:n])


def apart(model: SavedSpaceModel, one: State, other: State) -> np.ndarray:
    """Distances (n,) of two motions in m/s, those of spins by the inertia."""
    spin = SPACE.turned_back(one.attitude, one.spin - other.spin)
    G = np.asarray(model.believed.tensor)
    return np.sqrt(((one.velocity - other.velocity) ** 2).sum(axis=0) + np.einsum("in,ij,jn->n", spin, G, spin))


def started(model: SavedSpaceModel, touch: State):
    """Place, quaternion, velocity and spin of each body's frame, `LEAD` before it touches."""
    before = model.dynamics.flown(touch, np.full(len(touch), -LEAD))
    for q, v in zip(before.q, before.v):
        o = -rotation_matrix(q[3:, None])[..., 0] @ model.rig.body.centre
        yield q[:3] + o, q[3:], v[:3] + np.cross(v[3:], o), v[3:]


def ended(model: SavedSpaceModel, touch: State, ends) -> State:
    """The states of the believed centre of mass, from those of the body's frame."""
    rows = []
    for place, q, v, w in ends:
        o = rotation_matrix(q[:, None])[..., 0] @ model.rig.body.centre
        rows.append([*(place + o), *q, *(v + np.cross(w, o)), *w])
    pose, motion = np.split(np.array(rows).T, [7])
    return State(pose, motion, touch.trial, touch.t, None, SPACE)


CASES = [
    *(("mjcf", shape, FIRM) for shape in SHAPES),
    ("mjcf", "box", FIRM | {"impedance": 0.01}),
    ("mjcf", "box", {"law": "pyramid_contact", "tau": 1e-3, "impedance": 0.9, "edge_angle": 0.0}),
    ("mjcf", "sphere", FIRM | {"torsional_friction.m_t": 1e-3}),
    *(("sdf", shape, SOFT) for shape in ("round box", "capsule")),
    *(("urdf", shape, SOFT) for shape in ("box", "ellipsoid")),
]


@pytest.mark.slow  # 40 s
@pytest.mark.parametrize(("target", "shape", "contact"), CASES)
def test_a_hit_in_the_engine_is_that_of_the_law(target, shape, contact, tmp_path):
    """Over the table as it lies in the world, from the touch until the body is off it again."""
    model = space_model(shape=SHAPES[shape], **contact, **COM)
    touch = touching(model, 6)
    after = Played(model.dynamics, touch, np.full(len(touch), SPAN)).after
    found = hit(model, target, touch, tmp_path)
    off = apart(model, after, found)
    typical, most = CLOSE_ON_PYRAMID if contact["law"] == "pyramid_contact" else CLOSE[target]
    assert np.median(off) < typical and off.max() < most, off
    assert np.median(apart(model, after, touch)) > 1.0
    if "torsional_friction.m_t" in contact:
        without = space_model(shape=SHAPES[shape], **FIRM, **COM)
        assert np.median(apart(model, hit(without, target, touch, tmp_path), after)) > 0.03


def hit(model: SavedSpaceModel, target: str, touch: State, folder: Path) -> State:
    """The bodies `LEAD` before and `SPAN` after they touch, by the engine that reads the model's file."""
    path, starts = folder / f"body.{target}", started(model, touch)
    path.write_bytes(exported(model, target).content)
    if target != "mjcf":
        return ended(model, touch, by_drake(path, starts, LEAD + SPAN))
    text = re.sub('timestep="[^"]+"', f'timestep="{STEP}"', path.read_text())
    return ended(model, touch, by_mujoco(text, starts, LEAD + SPAN))


def test_mujoco_reads_the_body_that_is_hidden():
    """All that is fitted of body and table, in axes of a camera, against the rig of the simulator."""
    model = space_model(rig=FILMED, **FIRM, **HIDDEN, **{"wrong_gravity.dg": 0.0})
    truth, (frame, *_) = true_rig(model.rig, HIDDEN), surface_frames(model.rig)
    engine = mujoco.MjModel.from_xml_string(exported(model, "mjcf").content.decode())
    body = engine.body("body")
    np.testing.assert_allclose(body.mass, 0.25, rtol=DIGITS)
    np.testing.assert_allclose(body.ipos, truth.body.centre, rtol=DIGITS)
    tensor = 0.25 * truth.body.inertia_per_mass
    np.testing.assert_allclose(inertia_in_mujoco(body), tensor, atol=1e-7 * tensor.max())
    assert np.abs(tensor - np.diag(np.diag(tensor))).max() > 0.05 * tensor.max()
    np.testing.assert_allclose(engine.opt.gravity, truth.gravity, rtol=1e-7)
    table = engine.geom("surface")
    normal = rotation_matrix(np.array(table.quat)[:, None])[..., 0][:, 2]
    np.testing.assert_allclose(normal, truth.planes[0][1], atol=1e-8)
    np.testing.assert_allclose(table.pos, truth.surface.point, atol=1e-8)
    assert (np.array(truth.surface.point) - frame.origin) @ normal == pytest.approx(0.002)
    np.testing.assert_allclose(engine.geom("body").size, truth.body.solid.half_extents, rtol=DIGITS)
    assert not engine.geom("body").contype and engine.geom("corner0").size[0] == pytest.approx(0.003)
    # it lies on the table
    lowest = (np.array(engine.body("body").pos) + truth.body.solid.support(-normal[:, None])[:, 0]) @ normal
    assert lowest == pytest.approx(table.pos @ normal, abs=1e-8)


@pytest.mark.parametrize("target", ["sdf", "urdf"])
def test_drake_reads_the_same_body(target, tmp_path):
    model = space_model(rig=FILMED, **SOFT, **HIDDEN)
    truth, path = true_rig(model.rig, HIDDEN), tmp_path / f"body.{target}"
    made = exported(model, target, mass=0.5)
    path.write_bytes(made.content)
    mass, centre, about = inertia_in_drake(plant_of(path)[1], "body")
    assert mass == pytest.approx(0.5)
    np.testing.assert_allclose(centre, truth.body.centre, rtol=1e-7)
    np.testing.assert_allclose(about, 0.5 * truth.body.inertia_per_mass, atol=1e-7 * about.max())
    pull = " ".join(f"{value:.9g}" for value in truth.gravity)
    assert (target == "sdf") == (f"<gravity>{pull}" in made.content.decode()) and f"set {pull}" in made.content.decode()


@pytest.mark.parametrize("target", FORMATS)
def test_every_effect_in_space_is_in_the_file_or_named_as_left_out(target):
    plain = exported(space_model(**FIRM), target)
    for name in effects_in(SPACE):
        parameters = parameters_in(EFFECTS[name], SPACE)
        values = {f"{name}.{p.name}": p.null + (p.discrete or 0.5 * p.scale) for p in parameters}
        require_told(exported(space_model(**FIRM, **values), target), plain, name)


def test_what_no_file_can_hold_is_said():
    made = exported(space_model(shape={**SHAPES["cylinder"], "edge_radius": 0.002}, **FIRM), "mjcf")
    assert any("edge_radius: no format has a cylinder with round edges" in line for line in made.left_out)
    flat = {"kind": "box", "half_extents": (0.05, 0.05, 0.001)}
    made = exported(space_model(shape=flat, **{"inertia_ratios.a_y": 0.0, "inertia_ratios.a_z": 0.01}), "mjcf")
    assert any("inertia: no body has the fitted principal moments" in line for line in made.left_out)
    mujoco.MjModel.from_xml_string(made.content.decode())
    with pytest.raises(UserError, match="--depth is for planar models"):
        exported(space_model(), "mjcf", depth=0.1)


@pytest.mark.slow
def test_a_hull_is_its_corners(tmp_path):
    """Of a mesh, grown about the believed centre of mass: in MuJoCo as a mesh, in Drake as balls."""
    corners = 10.0 * np.array([[0, 0, 0], [8, 0, 0], [0, 6, 0], [0, 0, 5], [8, 6, 5]])
    faces = [[1, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 5], [3, 4, 5], [4, 2, 5]]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    (tmp_path / "rock.obj").write_text("\n".join(lines))
    content = space_model(**FIRM, **{"wrong_size.s": 0.1}).model_dump(mode="json", by_alias=True)
    content["rig"]["body"]["shape"] = {"kind": "mesh", "file": "rock.obj", "scale": 0.001}
    content["rig"]["mesh_sha256"] = hashlib.sha256((tmp_path / "rock.obj").read_bytes()).hexdigest()
    mesh = SavedSpaceModel.model_validate(content, context={"folder": tmp_path})
    centre = mesh.rig.body.centre
    expected = centre + 1.1 * (0.001 * corners - centre)
    engine = mujoco.MjModel.from_xml_string(exported(mesh, "mjcf").content.decode())
    hull = engine.geom("body")
    found = np.array(hull.pos) + engine.mesh_vert @ rotation_matrix(np.array(hull.quat)[:, None])[..., 0].T
    _same_points(found, expected)
    np.testing.assert_allclose(engine.body("body").ipos, centre, rtol=1e-7)
    text = exported(mesh, "urdf").content.decode()
    balls = re.findall(r'name="corner\d">\s*<origin xyz="([^"]+)"', text)
    _same_points(np.array([ball.split() for ball in balls], float), expected)


def _same_points(found, expected):
    far = np.linalg.norm(found[:, None] - expected, axis=2)
    assert len(found) == len(expected) and far.min(axis=1).max() < 1e-5 and far.min(axis=0).max() < 1e-5


def test_a_patch_writes_the_whole_tensor_and_leaves_the_rest(tmp_path, capsys):
    """By the command, from a saved model: mass of the file, a tensor that is turned in the body, torsional friction."""
    model = space_model(**FIRM, **HIDDEN, **{"torsional_friction.m_t": 2e-3})
    model.save(tmp_path / "model.json")
    mine, better = tmp_path / "mine.xml", tmp_path / "better.xml"
    mine.write_text(MINE)
    command = ["export", f"{tmp_path}/model.json", "--to", "mjcf"]
    assert main([*command, "--patch", str(mine), "--body", "box", "-o", str(better)]) == 0
    said = capsys.readouterr().err
    for part in (
        "geom hull: condim",
        "pair in line 11: condim",
        "quat of <inertial>",
        "scale it by 1.02",
        "round its edges with 0.003 m",
    ):
        assert part in said
    new, truth = better.read_text(), true_rig(model.rig, HIDDEN)
    kept = [line for line in MINE.split("\n") if not re.match(r" *<(inertial|geom name|contact)", line)]
    assert [line for line in new.split("\n") if line in kept] == kept
    body = mujoco.MjModel.from_xml_string(new).body("box")
    tensor = 0.3 * truth.body.inertia_per_mass
    np.testing.assert_allclose(body.mass, 0.3)
    np.testing.assert_allclose(body.ipos, truth.body.centre, rtol=1e-7)
    np.testing.assert_allclose(inertia_in_mujoco(body), tensor, atol=1e-7 * tensor.max())
    assert 'friction="0.25 0.002 0.0001"' in new and 'condim="4"' in new and "<geom name = " in new
    again = patched(load_model(tmp_path / "model.json"), "mjcf", better, "box")
    assert again.content == better.read_bytes()
    assert main([*command, "--patch", str(mine), "--body", "box", "--plane", "xz", "-o", str(better)]) == 2
    assert "--plane is for planar models" in capsys.readouterr().err


@pytest.mark.parametrize("target", ["sdf", "urdf"])
def test_a_patch_turns_the_tensor_into_the_axes_of_a_links_inertial(target, tmp_path):
    model, path = space_model(**SOFT, **HIDDEN), tmp_path / f"mine.{target}"
    moments = {"ixx": 2e-4, "iyy": 3e-4, "izz": 3.4e-4}
    if target == "sdf":
        tensor = "".join(f"<{name}>{value}</{name}>" for name, value in moments.items())
        inside = f"<inertial><pose>0 0 0 0.3 0.2 0.1</pose><mass>0.3</mass><inertia>{tensor}</inertia></inertial>"
        head, ball = (
            "<sdf version='1.9'><model name='lab'>",
            "<geometry><sphere><radius>0.03</radius></sphere></geometry>",
        )
    else:
        tensor = " ".join(f'{name}="{value}"' for name, value in moments.items())
        inside = f'<inertial><origin xyz="0 0 0" rpy="0.3 0.2 0.1"/><mass value="0.3"/><inertia {tensor}/></inertial>'
        head, ball = "<robot name='lab'>", '<geometry><sphere radius="0.03"/></geometry>'
    link = f"<link name='block'>{inside}<collision name='hull'>{ball}</collision></link>"
    path.write_text(f"{head}{link}{'</model></sdf>' if target == 'sdf' else '</robot>'}")
    path.write_bytes(patched(model, target, path, "block").content)
    _, centre, about = inertia_in_drake(plant_of(path)[1], "block")
    truth = true_rig(model.rig, HIDDEN).body
    np.testing.assert_allclose(centre, truth.centre, rtol=1e-7)
    np.testing.assert_allclose(about, 0.3 * truth.inertia_per_mass, atol=1e-7 * about.max())
