"""What the file of an engine cannot hold: each row of the table in docs/engine_files.md was tried here."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from engine_states import DISK

from thesis_lib.engines.drake_engine import DrakeEngine
from thesis_lib.engines.engine import impacts
from thesis_lib.engines.mujoco_engine import STEPS, MujocoEngine
from thesis_lib.simulate.mujoco.contact import MujocoContact
from thesis_lib.simulate.rig.hidden_causes import CompliantContact

PAGE = Path(__file__).resolve().parents[2] / "docs" / "engine_files.md"
SHORT = 5e-5  # s
NONE = 0.02  # of the slip before: what is left or returned where none should be
SPEEDS = np.array([0.5, 3.0])


def landed(engine, slip, speed, **contact):
    """Velocities (n, 3) of disks after central impacts."""
    slip, speed = np.broadcast_arrays(np.atleast_1d(slip), np.atleast_1d(speed))
    made = MujocoContact(**contact, steps=STEPS) if engine is MujocoEngine else CompliantContact(**contact)
    q = np.tile([0.0, 0.03, 0.0], (len(slip), 1))
    v = np.column_stack([slip, -speed, np.zeros(len(slip))])
    return impacts(engine(DISK, len(slip), contact=made, gravity=1e-6), q, v).v


@pytest.mark.parametrize("engine", [MujocoEngine, DrakeEngine])
def test_no_slip_is_returned(engine):
    """A contact that sticks ends slip; a rubber ball would send it back."""
    for epsilon in (0.3, 0.8):
        v = landed(engine, 0.3, 2.0, mu=2.0, epsilon=epsilon, contact_time=SHORT)
        assert v[0, 0] + 0.03 * v[0, 2] > -NONE * 0.3


def test_mujocos_restitution_knows_no_speed():
    epsilon = landed(MujocoEngine, 0.0, SPEEDS, epsilon=0.5, contact_time=1e-3)[:, 1] / SPEEDS
    np.testing.assert_allclose(epsilon, 0.5, atol=3e-3)


def test_drakes_restitution_falls_with_the_speed():
    epsilon = landed(DrakeEngine, 0.0, SPEEDS, epsilon=0.5, contact_time=1e-3)[:, 1] / SPEEDS
    assert epsilon[0] > 0.75 and epsilon[1] < 0.5


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
    here = Path(__file__).read_text(encoding="utf-8")
    assert len(named) >= 6 and all(f"def {name}(" in here for name in named)
    tests = set(re.findall(r"def (test_\w+)", here)) - {"test_each_row_of_the_table_names_a_test_here"}
    assert set(named) == tests
