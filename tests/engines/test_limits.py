"""What the file of an engine cannot hold: each row of the table in docs/engine_files.md was tried here."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from engine_states import DISK, SOFT, STILL, bullet, of

from thesis_lib.engines.engine import impacts

PAGE = Path(__file__).resolve().parents[2] / "docs" / "engine_files.md"
SHORT = 5e-5  # s
NONE = 0.02  # of the slip before: what is left or returned where none should be
SPEEDS = np.array([0.5, 3.0])


def landed(name, slip, speed, **contact):
    """Velocities (n, 3) of disks after central impacts."""
    slip, speed = np.broadcast_arrays(np.atleast_1d(slip), np.atleast_1d(speed))
    q = np.tile([0.0, 0.03, 0.0], (len(slip), 1))
    v = np.column_stack([slip, -speed, np.zeros(len(slip))])
    return impacts(of(name, DISK, len(slip), gravity=STILL, **contact), q, v).v


@pytest.mark.parametrize("name", SOFT)
def test_no_slip_is_returned(name):
    """A contact that sticks ends slip; a rubber ball would send it back."""
    for epsilon in (0.3, 0.8):
        v = landed(name, 0.3, 2.0, mu=2.0, epsilon=epsilon, contact_time=SHORT)
        assert v[0, 0] + 0.03 * v[0, 2] > -NONE * 0.3


def test_mujocos_restitution_knows_no_speed():
    epsilon = landed("mujoco", 0.0, SPEEDS, epsilon=0.5, contact_time=1e-3)[:, 1] / SPEEDS
    np.testing.assert_allclose(epsilon, 0.5, atol=3e-3)


def test_drakes_restitution_falls_with_the_speed():
    epsilon = landed("drake", 0.0, SPEEDS, epsilon=0.5, contact_time=1e-3)[:, 1] / SPEEDS
    assert epsilon[0] > 0.75 and epsilon[1] < 0.5


@bullet
def test_bullets_spring_knows_no_speed_and_returns_what_its_time_step_leaves():
    epsilon = landed("bullet", 0.0, SPEEDS, epsilon=0.5, contact_time=1e-3)[:, 1] / SPEEDS
    np.testing.assert_allclose(epsilon, 0.5, atol=3e-3)
    most = landed("bullet", 0.0, 2.0, epsilon=1.0, contact_time=1e-3)[:, 1] / 2.0
    assert most == pytest.approx(0.952, abs=2e-3)


@pytest.fixture
def world():
    """Bullet, and what makes a body of 50 g on a plane whose numbers are 1, without drag and gravity."""
    pybullet = pytest.importorskip("pybullet")
    pybullet.connect(pybullet.DIRECT)

    def body(step=1e-4, *, of_body=None, at, attitude=(0, 0, 0, 1), velocity=(0, 0, 0), spin=(0, 0, 0), **shape):
        pybullet.resetSimulation()
        surface = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
        pybullet.changeDynamics(surface, -1, restitution=1, lateralFriction=1)
        made = pybullet.createMultiBody(0.05, pybullet.createCollisionShape(**shape))
        pybullet.changeDynamics(made, -1, linearDamping=0, angularDamping=0, **(of_body or {}))
        pybullet.setPhysicsEngineParameter(fixedTimeStep=step)
        pybullet.resetBasePositionAndOrientation(made, at, attitude)
        pybullet.resetBaseVelocity(made, velocity, spin)
        return made

    yield pybullet, body
    pybullet.disconnect()


def came_back(world, speed, step, phase):
    """Share of its speed with which a ball comes back that flies 30 mm and so much of a step to the plane."""
    pybullet, body = world
    start = {"at": [0, 0, 0.055 + speed * step * phase], "velocity": [0, 0, -speed]}
    ball = body(step, of_body={"restitution": 0.6}, **start, shapeType=pybullet.GEOM_SPHERE, radius=0.025)
    for _ in range(int(0.06 / speed / step) + 10):
        pybullet.stepSimulation()
    return pybullet.getBaseVelocity(ball)[0][2] / speed


@bullet
def test_bullets_restitution_hangs_on_where_a_step_meets_the_surface(world):
    """Bullet brakes a body that the next step would carry in, and forgets how fast it came; then it pushes it out."""
    phases = np.arange(20) / 20
    usual, fine, finer = (
        [came_back(world, 2.0, step, phase) for phase in phases] for step in (1 / 240, 1 / 1000, 1 / 4000)
    )
    assert min(usual) == pytest.approx(0.50, abs=0.02) and max(usual) == pytest.approx(0.67, abs=0.02)
    assert min(fine) == pytest.approx(0.20, abs=0.02) and max(fine) == pytest.approx(0.64, abs=0.02)
    assert max(finer) < 0.01  # and the finer the steps, the less comes back: nothing
    slow = [came_back(world, 0.19, 1 / 240, phase) for phase in phases]
    assert max(slow) < 0.01  # below 0.2 m/s


@bullet
def test_bullet_has_no_ellipse(world):
    """Of a hull of 4096 points it keeps some hundred, and its lowest point jumps along the body."""
    pybullet, make = world
    angle = np.linspace(0.0, 2.0 * np.pi, 4096, endpoint=False)
    outline = np.column_stack([0.035 * np.cos(angle), 0.0 * angle, 0.025 * np.sin(angle)])
    body = make(at=[0, 0, 0.04], shapeType=pybullet.GEOM_MESH, vertices=outline.tolist())
    kept, _ = pybullet.getMeshData(body, -1)
    pybullet.changeDynamics(body, -1, collisionMargin=0)
    off = []
    for theta in np.linspace(0.2, 0.3, 50):
        turned = [0.0, np.sin(-theta / 2), 0.0, np.cos(theta / 2)]
        pybullet.resetBasePositionAndOrientation(body, [0, 0, 0.04], turned)
        low = pybullet.getClosestPoints(body, 0, 1.0)[0][5]
        reach = np.hypot(0.035 * np.sin(theta), 0.025 * np.cos(theta))
        off.append(low[0] + (0.035**2 - 0.025**2) * np.sin(theta) * np.cos(theta) / reach)
    assert kept < 1000 and 5e-5 < np.abs(off).max() < 1e-3


@bullet
def test_bullets_friction_is_the_same_both_ways_and_the_product_of_both_bodies(world):
    pybullet, make = world
    lost = []
    for slip in (5.0, -5.0):
        start = {"at": [0, 0, 0.0299], "velocity": [slip, 0, -2.0], "of_body": {"lateralFriction": 0.3}}
        body = make(**start, shapeType=pybullet.GEOM_SPHERE, radius=0.03)
        pybullet.changeDynamics(0, -1, lateralFriction=0.5)
        pybullet.stepSimulation()
        v = pybullet.getBaseVelocity(body)[0]
        lost.append((slip - v[0]) / (v[2] + 2.0))
    assert lost == pytest.approx([0.15, -0.15], rel=1e-6)


@bullet
def test_bullet_slows_a_flight_unless_it_is_told_not_to(world):
    """0.04 (1 + |v|) per s, and the same for the spin."""
    pybullet, make = world
    start = {"at": [0, 0, 5.0], "velocity": [2.0, 0, 0], "spin": [0, 40.0, 0]}
    body = make(**start, shapeType=pybullet.GEOM_SPHERE, radius=0.03)
    pybullet.changeDynamics(body, -1, linearDamping=0.04, angularDamping=0.04)  # its defaults
    for _ in range(100):
        pybullet.stepSimulation()
    v, w = pybullet.getBaseVelocity(body)
    assert 2.0 - v[0] == pytest.approx(0.04 * 3.0 * 2.0 * 0.01, rel=0.02)
    assert 40.0 - w[1] == pytest.approx(0.04 * 41.0 * 40.0 * 0.01, rel=0.02)


def test_mujocos_friction_is_the_same_both_ways():
    """Two coefficients are those of two axes: with one along x and one across, left is as right."""
    text = """<mujoco><option timestep="1e-5" integrator="RK4" cone="elliptic" gravity="0 0 0"/><worldbody>
      <geom name="floor" type="plane" size="1 1 1"/><body name="b" pos="0 0 .03"><freejoint/>
      <geom name="g" size=".03"/></body></worldbody><contact>
      <pair geom1="floor" geom2="g" friction=".1 .4 0 0 0" solref="-1e7 -1e3"/></contact></mujoco>"""
    model, left = mujoco.MjModel.from_xml_string(text), []
    for way in ((5.0, 0.0), (-5.0, 0.0), (0.0, 5.0)):
        data = mujoco.MjData(model)
        data.qvel[:3] = *way, -1.0
        for _ in range(200):
            mujoco.mj_step(model, data)
        left.append(5.0 - np.hypot(*data.qvel[:2]))
    assert left[0] == pytest.approx(left[1], rel=1e-6) and abs(left[2] - left[0]) > 0.5 * left[0]


def plant_of(tmp_path, text, name):
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder

    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, 0.0)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    return builder, plant, scene


WORLD = """<sdf version="1.9" xmlns:drake="drake.mit.edu"><world name="w"><gravity>0 0 -1.6</gravity>
  <model name="floor"><static>true</static><link name="floor"><collision name="c"><geometry><plane>
    <normal>0 0 1</normal></plane></geometry></collision></link></model>
  <model name="m"><link name="b"><inertial><mass>0.05</mass>
    <inertia><ixx>3e-5</ixx><iyy>3e-5</iyy><izz>3e-5</izz></inertia></inertial>
    <collision name="c"><geometry><box><size>.06 .06 .06</size></box></geometry><surface><friction><ode>
    <mu>0.9</mu><mu2>0.2</mu2></ode></friction></surface></collision></link></model></world></sdf>"""


def test_sdf_has_one_friction_and_drake_takes_no_gravity_from_it(tmp_path):
    from pydrake.geometry import Role

    _, plant, scene = plant_of(tmp_path, WORLD, "w.sdf")
    frame = plant.GetBodyFrameIdOrThrow(plant.GetBodyByName("b").index())
    (geometry,) = scene.model_inspector().GetGeometries(frame, Role.kProximity)
    properties = scene.model_inspector().GetProximityProperties(geometry)
    friction = properties.GetProperty("material", "coulomb_friction")
    assert (friction.static_friction(), friction.dynamic_friction()) == (0.9, 0.2)  # not those of two axes
    assert plant.gravity_field().gravity_vector()[2] == pytest.approx(-9.81)


def test_urdf_has_no_half_space(tmp_path):
    text = """<robot name="r"><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
      iyz="0"/></inertial><collision><geometry><plane normal="0 0 1"/></geometry></collision></link></robot>"""
    with pytest.raises(RuntimeError):
        plant_of(tmp_path, text, "r.urdf")


def test_each_row_of_the_table_names_a_test_here():
    page = PAGE.read_text(encoding="utf-8")
    named = re.findall(r"`(test_\w+)`", page)
    own = Path(__file__).read_text(encoding="utf-8")
    of_space = Path(__file__).parents[1] / "critique/export/test_files_in_space.py"
    here = own + of_space.read_text(encoding="utf-8")
    assert len(named) >= 6 and all(f"def {name}(" in here for name in named)
    tests = set(re.findall(r"def (test_\w+)", own)) - {"test_each_row_of_the_table_names_a_test_here"}
    assert tests <= set(named)
