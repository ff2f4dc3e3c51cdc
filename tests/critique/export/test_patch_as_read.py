"""MuJoCo and Drake take the numbers of a patch from the file, whatever else is there; what adds to them is said."""

import mujoco
import numpy as np
import pytest
from engine_runs import BODIES, TRUE, model_of, plant_of

from thesis_lib.critique.export.export import exported, patched
from thesis_lib.foundation.errors import UserError

MINE = """<mujoco>
  <compiler angle="degree"/>
  <option timestep="2e-5" cone="elliptic" impratio="10"/>
  <default><geom friction="1"/></default>
  <worldbody>
    <geom name="table" type="plane" size="1 1 .1"/>
    <body name="block" pos="0 0 .3">
      <freejoint/>
      <inertial pos="0 0 0" mass="0.05" diaginertia="3e-5 3e-5 3e-5"/>
      <geom name="hull" type="box" size=".03 .03 .03"/>
    </body>
  </worldbody>
</mujoco>
"""
HULL = '<geom name="hull" type="box" size=".03 .03 .03"/>'
LID = '<body name="lid"><geom size=".01" mass="0.01"/><frame><body><geom size=".01" mass="0.02"/></body></frame></body>'
DOOR = '<body name="door"><joint/><geom size=".01" mass="0.01"/><body name="knob"><geom size=".01"/></body></body>'


def patch(tmp_path, old: str = HULL, new: str = HULL):
    (tmp_path / "mine.xml").write_text(MINE.replace(old, new))
    return patched(model_of("mujoco", BODIES["square"], TRUE), "mjcf", tmp_path / "mine.xml", "block")


CHANGES = {
    "as it is": (HULL, HULL),
    "a surface with priority": ('name="table"', 'name="table" priority="2"'),
    "a class without friction": ('friction="1"', 'friction="1" condim="1"'),
    "a frame": (HULL, f'<frame pos="0 0 0">{HULL}</frame>'),
}


@pytest.mark.parametrize("change", CHANGES)
def test_the_contact_is_that_of_the_model(change, tmp_path):
    """MuJoCo's own contact of the block with the table, from a pose in which they touch."""
    model = mujoco.MjModel.from_xml_string(patch(tmp_path, *CHANGES[change]).content.decode())
    fresh = mujoco.MjModel.from_xml_string(
        exported(model_of("mujoco", BODIES["square"], TRUE), "mjcf", mass=0.05).content.decode()
    )
    data = mujoco.MjData(model)
    data.qpos[2] = 0.0299
    mujoco.mj_forward(model, data)
    assert data.ncon and data.contact.dim.tolist() == [3] * data.ncon
    np.testing.assert_allclose(data.contact.friction[:, 0], TRUE["mu"], rtol=1e-5)
    # the fresh file has one contact point, the box two on an edge
    np.testing.assert_allclose(data.contact.solref[:, 1], fresh.geom("body").solref[1], rtol=1e-5)


def test_what_adds_to_the_mass_is_said(tmp_path):
    said = "\n".join(patch(tmp_path, HULL, HULL + LID + DOOR).left_out)
    assert "body lid: has no joint" in said and "body in line 10: has no joint" in said
    assert "door" not in said and "knob" not in said
    assert "no joint" not in "\n".join(patch(tmp_path).left_out)
    settings = 'settotalmass="2" boundmass="0.1" boundinertia="0"'
    said = "\n".join(patch(tmp_path, "<compiler", f"<compiler {settings}").left_out)
    assert "compiler settotalmass 2: " in said and "compiler boundmass 0.1: " in said and "boundinertia" not in said


@pytest.mark.parametrize(
    "tag, attributes, said", [("include", 'file="x.xml"', "not read"), ("replicate", 'count="2"', "not patched")]
)
def test_geoms_that_are_not_read_are_named(tag, attributes, said, tmp_path):
    inner = f"<{tag} {attributes}/>" if tag == "include" else f"<{tag} {attributes}>{HULL}</{tag}>"
    with pytest.raises(UserError, match=f"no geom that can touch; <{tag}>: .*{said}; write its geoms into the body"):
        patch(tmp_path, HULL, inner)


SDF = """<sdf version='1.9'><model name='lab'>
  <link name='block'>
    <inertial><mass>0.05</mass><inertia><ixx>3e-5</ixx><iyy>3e-5</iyy><izz>3e-5</izz></inertia></inertial>
    <collision name='hull'><geometry><sphere><radius>0.03</radius></sphere></geometry></collision>
  </link>
</model></sdf>
"""
URDF = """<robot name='lab' xmlns:drake='http://drake.mit.edu'>
  <link name='block'>
    <inertial><mass value='0.05'/><inertia ixx='3e-5' iyy='3e-5' izz='3e-5' ixy='0' ixz='0' iyz='0'/></inertial>
    <collision><geometry><sphere radius='0.03'/></geometry></collision>
  </link>
</robot>
"""
OTHERS = {  # a lid on the block, a knob on the lid, a door that turns on a hinge, and the ground
    "sdf": "<joint name='{1}' type='{2}'><parent>{0}</parent><child>{1}</child></joint>",
    "urdf": "<joint name='{1}' type='{2}'><parent link='{0}'/><child link='{1}'/></joint>",
}
JOINTS = ("block", "lid", "fixed"), ("lid", "knob", "fixed"), ("block", "door", "revolute"), ("world", "block", "fixed")
FRICTION = "</geometry><surface><friction>{}</friction></surface>"


def patch_drake(tmp_path, target: str, text: str):
    path = tmp_path / f"mine.{target}"
    path.write_text(text)
    return patched(model_of("drake", BODIES["square"], TRUE), target, path, "block")


@pytest.mark.parametrize("target", OTHERS)
def test_links_that_add_to_the_mass_in_drake_are_said(target, tmp_path):
    text, end = {"sdf": (SDF, "</model>"), "urdf": (URDF, "</robot>")}[target]
    joints = "".join(OTHERS[target].format(*joint) for joint in JOINTS)
    said = "\n".join(patch_drake(tmp_path, target, text.replace(end, joints + end)).left_out)
    assert "link lid: fixed to this one" in said and "link knob: fixed" in said
    assert "door" not in said and "world" not in said
    assert "fixed" not in "\n".join(patch_drake(tmp_path, target, text).left_out)


@pytest.mark.parametrize("inside", ["", "<torsional/>", "<ode><mu>1</mu></ode>"])
def test_drake_reads_a_patched_file_that_has_friction_of_other_simulators(inside, tmp_path):
    """Drake 1.51 ends the process at a friction without <ode> beside its own elements."""
    text = SDF.replace("</geometry>", FRICTION.format(inside))
    made = patch_drake(tmp_path, "sdf", text)
    assert made.content.count(b"<ode") == 1  # first: Drake would end these tests, too
    path = tmp_path / "better.sdf"
    path.write_bytes(made.content)
    assert plant_of(path)[1].HasBodyNamed("block")


@pytest.mark.parametrize(
    "target, text, said",
    [
        (
            "urdf",
            URDF.replace("</coll", "<d:proximity_properties/></coll").replace("drake=", "d="),
            "ignores the pref.* d;",
        ),
        ("sdf", "<sdf><model><include/></model></sdf>", "no link named 'block'.* It includes other files"),
    ],
)
def test_what_drake_would_not_read_is_refused(target, text, said, tmp_path):
    with pytest.raises(UserError, match=said):
        patch_drake(tmp_path, target, text)


WORLD = """<sdf version="1.9"><world name="w">
  <model name="table"><static>1</static><link name="link"><collision name="top">
    <geometry><plane><normal>0 0 1</normal></plane></geometry>
    <surface><friction><bullet><friction>1</friction></bullet></friction></surface>
  </collision></link></model>
  <model name="box"><link name="link">
    <inertial><mass>0.05</mass><inertia><ixx>3e-5</ixx><iyy>3.2e-5</iyy><izz>3e-5</izz></inertia></inertial>
    <collision name="hull"><geometry><sphere><radius>0.03</radius></sphere></geometry></collision>
  </link></model>
  <model name="lamp"><link name="link"/><link name="arm"/>
    <joint name="j" type="fixed"><parent>link</parent><child>arm</child></joint></model>
</world></sdf>
"""


def test_links_of_several_models_may_have_one_name(tmp_path):
    model, path = model_of("mujoco", BODIES["square"], TRUE), tmp_path / "world.sdf"
    path.write_text(WORLD)
    made = patched(model, "sdf", path, "box::link", surface="table::link")
    assert sum(line.endswith("mu_dynamic: none -> 0.2") for line in made.held) == 2
    assert not any("arm" in line for line in made.left_out)  # it is fixed to the link of another model
    assert "<bullet> in line 4: Drake does not read it; it stays as it is" in "\n".join(made.left_out)
    with pytest.raises(UserError, match="3 links named 'link'; name the model, too: table::link, box::link, lamp"):
        patched(model, "sdf", path, "link")
    with pytest.raises(UserError, match=r"no link named 'crate::link'.*it has box::link, lamp::arm"):
        patched(model, "sdf", path, "crate::link")


GAZEBO = """<robot name="lab"><link name="block">
  <inertial><mass value="0.05"/><inertia ixx="3e-5" iyy="3e-5" izz="3e-5" ixy="0" ixz="0" iyz="0"/></inertial>
  <contact><lateral_friction value="1"/></contact>
  <collision><geometry><sphere radius="0.03"/></geometry></collision>
</link><gazebo reference="block"><mu1>1</mu1></gazebo><gazebo reference="other"><mu1>1</mu1></gazebo></robot>
"""


def test_what_drake_does_not_read_of_a_urdf_file_is_said(tmp_path):
    model, path = model_of("mujoco", BODIES["square"], TRUE), tmp_path / "block.urdf"
    path.write_text(GAZEBO)
    said = [line.split(":")[0] for line in patched(model, "urdf", path, "block").left_out if "not read" in line]
    assert said == ["<gazebo> in line 5", "<contact> in line 3"]
    path.write_text(GAZEBO.replace("<geometry>", "<drake:proximity_properties/><geometry>"))
    with pytest.raises(UserError, match=r'drake on .* not defined in line 4; .*<robot xmlns:drake="http://drake\.'):
        patched(model, "urdf", path, "block")
