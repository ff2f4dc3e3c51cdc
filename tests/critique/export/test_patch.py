"""A patch changes the numbers of one body and nothing else; what it cannot do, it refuses or says."""

import re
from difflib import SequenceMatcher

import mujoco
import numpy as np
import pytest
from engine_runs import BODIES, MASS, TRUE, inertia_in_drake, model_of, plant_of

from thesis_lib.critique.export.export import exported, patched
from thesis_lib.foundation.errors import UserError

MJCF = """<?xml version="1.0" encoding="utf-8"?>
<!-- my  model: <body name="block"> is measured, friction='0.7' a guess -->
<mujoco model='Würfel'>\r
\t<option timestep="2e-5"   integrator='RK4' cone="elliptic" impratio="10"/>
  <default><default class="x"><geom rgba="1 1 1 1"/></default></default>
  <worldbody>
    <geom name="table" type="plane" size="1 1 .1" friction="1 .005 .0001"/>\t<!-- friction="0.3"? -->
    <body name="post"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom name="p" size=".01" pos="3 0 0"/></body>
    <body   name = "block" pos="0 0 .3" ><freejoint name="free"/>
      <inertial mass="5e-2" diaginertia="3e-5 3.2e-5  3e-5"
         pos="0 0.01 0"/>
      <geom class='x' name="hull solimp= 1" type="box" size=".03 .03 .03" solref = '0.02 1' rgba="1 0 0 1" />
      <geom name="logo" type="box" size=".01 .01 .01" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <contact><pair geom1="p" geom2="table"/>
    <pair geom1="p" geom2="hull solimp= 1" friction="1 1 .01 .001 .001"/></contact>
</mujoco>   <!-- no newline at the end -->"""
SDF = """<sdf version='1.9'>
  <model name="lab">
    <link name="table"><collision name="t"><geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link>
    <link name="block">
      <inertial>
        <mass>  0.05 <!-- kg, roughly --></mass>
        <inertia><ixx>3e-5</ixx><iyy>3.2e-5</iyy><izz>3e-5</izz><ixz>1e-6</ixz></inertia>
      </inertial>
      <collision name="hull">
        <pose>0 0.01 0 0 0 0</pose>
        <geometry><ellipsoid><radii>0.035 0.03 0.025</radii></ellipsoid></geometry>
        <surface><friction><ode><mu>1.0</mu><mu2>1.0</mu2></ode></friction></surface>
      </collision>
    </link>
  </model>
</sdf>
"""
URDF = """<robot name="lab" xmlns:drake="http://drake.mit.edu">
  <link name="table"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <link name="block">
    <inertial><mass value="0.05"/><inertia ixx="3e-5" iyy="3.2e-5" izz='3e-5' ixy="0" ixz="0" iyz="0"/></inertial>
    <collision name="hull">
      <geometry><sphere radius="0.03"/></geometry>
      <drake:proximity_properties><drake:mu_static value="1"/></drake:proximity_properties>
    </collision>
  </link>
</robot>
"""
PAIR = 1  # MuJoCo sorts pairs
NUMBERS = TRUE | {"c_x": 0.001, "c_y": -0.002}
FILES = {"mjcf": MJCF, "sdf": SDF, "urdf": URDF}
# how lines begin in which a patch changes numbers
CHANGED = {
    "mjcf": ("<inertial mass=5e-2", "pos=0 0.01", "<geom class=x", "<pair geom1=p geom2=hull"),
    "sdf": ("<sdf", "<inertia><ixx", "<surface>"),
    "urdf": ("<robot", "<inertial><mass", "<drake:proximity"),
}


def plain(line):
    """A line without blanks and quotes that do not matter."""
    line = re.sub(r"\s+", " ", line.strip().replace('"', "").replace("'", ""))
    return re.sub(r" ?(=|/?>) ?", r"\1", line)


def model(**extra):
    return model_of("mujoco", BODIES["square"], NUMBERS, extra=extra)


def file_of(tmp_path, text, name="mine.xml"):
    path = tmp_path / name
    path.write_bytes(text.encode())
    return path


@pytest.mark.parametrize("target", FILES)
def test_all_else_in_a_file_stays_to_the_byte(target, tmp_path):
    """Nothing of a file goes but numbers that are replaced, and what is new stands in the lines of these."""
    old = FILES[target].encode()
    new = patched(model(), target, file_of(tmp_path, FILES[target]), "block").content
    for tag, i, j, here, there in SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        assert tag == "equal" or re.fullmatch(rb"[-+.\de ]*", old[i:j]), (old[i:j], new[here:there])
    kept = [line for line in FILES[target].split("\n") if not plain(line).startswith(CHANGED[target])]
    assert [line for line in new.decode().split("\n") if line in kept] == kept
    assert len(kept) == FILES[target].count("\n") + 1 - len(CHANGED[target])


def test_the_numbers_are_those_of_the_model(tmp_path):
    new = mujoco.MjModel.from_xml_string(patched(model(), "mjcf", file_of(tmp_path, MJCF), "block").content.decode())
    block, hull = new.body("block"), new.geom("hull solimp= 1")
    k = BODIES["square"].radius_of_gyration
    np.testing.assert_allclose(block.mass, 0.05)
    np.testing.assert_allclose(block.ipos, [0.001, 0.01, -0.002])  # across the plane as it was
    assert sorted(block.inertia)[-1] == pytest.approx(0.05 * k**2)
    np.testing.assert_allclose(np.sort(block.inertia) / block.inertia.max(), [3.0 / 3.2, 3.0 / 3.2, 1.0])
    fresh = mujoco.MjModel.from_xml_string(exported(model(), "mjcf", mass=0.05).content.decode())
    for name in ("solref", "solimp", "friction", "priority"):
        np.testing.assert_allclose(getattr(hull, name), getattr(fresh.geom("body"), name))
    np.testing.assert_allclose(new.pair_friction[PAIR], [0.2, 0.2, 0.01, 0.001, 0.001])
    np.testing.assert_allclose(new.pair_solref[PAIR], fresh.geom("body").solref)


@pytest.mark.parametrize("target", FILES)
def test_patching_twice_changes_nothing_more(target, tmp_path):
    once = patched(model(), target, file_of(tmp_path, FILES[target]), "block")
    again = patched(model(), target, file_of(tmp_path, once.content.decode()), "block")
    assert again.content == once.content != FILES[target].encode()


@pytest.mark.parametrize("target", ["sdf", "urdf"])
def test_drake_reads_a_patched_file(target, tmp_path):
    """Its friction and springs do what they should: tests/critique/export/test_engine_files.py."""
    path = file_of(tmp_path, FILES[target], f"mine.{target}")
    made = patched(model(), target, path, "block", mass=0.06, surface="table").content
    path.write_bytes(made)
    mass, centre, about = inertia_in_drake(plant_of(path)[1], "block")
    assert mass == pytest.approx(0.06) and about[1, 1] == pytest.approx(0.06 * BODIES["square"].radius_of_gyration ** 2)
    np.testing.assert_allclose(centre, [0.001, 0.0, -0.002])
    if target == "sdf":
        assert b"<mu>0.2</mu><mu2>0.2</mu2>" in made and b"<mass>0.06<!-- kg, roughly --></mass>" in made


def test_spheres_behind_each_other_share_the_load(tmp_path):
    """Two collision spheres at each edge: half the stiffness each; said points win."""
    one = URDF
    two = URDF.replace(
        '<collision name="hull">',
        '<collision name="back"><origin xyz="0 0.02 0"/><geometry><sphere radius="0.03"/></geometry></collision>\n'
        '    <collision name="hull">',
    )

    def stiffness(text, **options):
        content = patched(model(), "urdf", file_of(tmp_path, text), "block", **options).content.decode()
        return float(re.search(r'point_contact_stiffness value="([^"]+)"', content)[1])

    assert stiffness(one) == pytest.approx(2.0 * stiffness(two))
    assert stiffness(one, points=2) == pytest.approx(stiffness(two))


def test_another_plane_of_the_body(tmp_path):
    """Drops in the y-x plane of the body: the offset and the moment are where they belong."""
    text = patched(model(), "mjcf", file_of(tmp_path, MJCF), "block", plane="yx").content.decode()
    new = mujoco.MjModel.from_xml_string(text).body("block")
    np.testing.assert_allclose(new.ipos, [-0.002, 0.001, 0.0])
    assert "3.00125e-05 3.20133333e-05 3.00125e-05" in text  # all by the factor that makes m k² of the one about z
    for wrong in ("x", "xx", "xw", ""):
        with pytest.raises(UserError, match="--plane must be two different letters"):
            patched(model(), "mjcf", file_of(tmp_path, MJCF), "block", plane=wrong)


def test_a_turned_inertia_keeps_its_axes(tmp_path):
    """A quarter turn about x puts the file's third moment across the plane."""
    turned = MJCF.replace(
        'diaginertia="3e-5 3.2e-5  3e-5"',
        'quat="0.7071067811865476 0.7071067811865476 0 0" diaginertia="3e-5 2e-5 4e-5"',
    )
    new = mujoco.MjModel.from_xml_string(patched(model(), "mjcf", file_of(tmp_path, turned), "block").content.decode())
    k = BODIES["square"].radius_of_gyration
    np.testing.assert_allclose(np.sort(new.body("block").inertia), np.array([2.0, 3.0, 4.0]) / 4.0 * 0.05 * k**2)


def test_a_body_without_inertial_gets_one(tmp_path):
    bare = re.sub(r"<inertial mass=.*?/>\n\s*", "", MJCF, flags=re.S)
    with pytest.raises(UserError, match="no <inertial>, so its mass is not known; give --mass"):
        patched(model(), "mjcf", file_of(tmp_path, bare), "block")
    new = patched(model(), "mjcf", file_of(tmp_path, bare), "block", mass=0.07, depth=0.06).content.decode()
    block = mujoco.MjModel.from_xml_string(new).body("block")
    assert block.mass == pytest.approx(0.07)
    np.testing.assert_allclose(block.inertia, 0.07 * BODIES["square"].radius_of_gyration ** 2)


def test_what_a_patch_leaves_is_said(tmp_path):
    about = {"wrong_size.s": 0.03, "surface_tilt.phi": 0.1, "wrong_gravity.dg": 0.5, "linear_drag.c_v": 0.2}
    about["linear_drag.c_w"] = 0.1
    coarse = MJCF.replace('timestep="2e-5"', "").replace('cone="elliptic" impratio="10"', "")
    said = "\n".join(patched(model(**about), "mjcf", file_of(tmp_path, coarse), "block").left_out)
    for part in ("scale it by 1.03", "leans by 0.1 rad", "it is 10.31 m/s^2", "linear_drag: ", "needs 6e-05 or less"):
        assert part in said
    assert 'cone="elliptic"' in said and 'impratio="10"' in said
    quiet = patched(model(), "mjcf", file_of(tmp_path, MJCF), "block").left_out
    assert not any(line.startswith("option") for line in quiet)
    drake = "\n".join(patched(model(), "sdf", file_of(tmp_path, SDF), "block").left_out)
    assert "name its link (--surface)" in drake


UNFOLDING = "".join(f"<!ENTITY a{i} '{10 * f'&a{i - 1};'}'>" for i in range(1, 12))
NO_MASS = SDF.replace("<mass>  0.05 <!-- kg, roughly --></mass>", "")
BAD = {  # by format and what is wrong: the text, and what is said of it
    "mjcf": {
        "not XML": ("<mujoco><worldbody></mujoco>", "is not XML: Opening and ending tag mismatch.*in line 1"),
        "cut off": (MJCF[:700], "is not XML"),
        "empty": ("", "is not XML: Document is empty"),
        "entities": ('<!DOCTYPE x [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><mujoco>&b;</mujoco>', "document type"),
        "entities in an attribute": ('<!DOCTYPE x [<!ENTITY a "aa">]><mujoco model="&a;"/>', "document type"),
        "entities that unfold": (
            f"<!DOCTYPE x [<!ENTITY a0 'a'>{UNFOLDING}]><mujoco model=\"&a11;\"/>",
            "amplification",
        ),
        "a file as an entity": ('<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><mujoco>&a;</mujoco>', "type"),
        "another body": (MJCF.replace('"block"', '"cube"'), "has no body named 'block'.*cube, post"),
        "two bodies": (MJCF.replace('"post"', '"block"'), "has 2 body named 'block' .lines 8, 9."),
        "an include": ('<mujoco><include file="b.xml"/><worldbody/></mujoco>', "includes other files"),
        "no numbers": (MJCF.replace("5e-2", "heavy"), "must be finite numbers"),
        "NaN": (MJCF.replace("3.2e-5", "nan"), "line 11: <inertial> diaginertia=.*must be finite numbers"),
        "two numbers": (MJCF.replace('"0 0.01 0"', '"0 1"'), "needs 3 number.s. in pos"),
        "no moment": (MJCF.replace("3.2e-5", "0"), "no positive moment of inertia about y"),
        "negative mass": (MJCF.replace('mass="5e-2" diag', 'mass="-1" diag'), "must be positive"),
        "from geoms": (
            MJCF.replace("<default>", '<compiler inertiafromgeom="true"/><default>', 1),
            "ignore <inertial>",
        ),
        "deep": ("<a>" * 300 + "</a>" * 300, "Excessive depth"),
    },
    "sdf": {
        "another format": (MJCF, "is not in SDF format: it begins with <mujoco>"),
        "degrees": (SDF.replace("<pose>0 0.01", '<pose degrees="true">0 0.01'), "roll pitch yaw, without attributes"),
        "no inertia": (NO_MASS, "no <inertial> with <mass> and <inertia>"),
    },
    "urdf": {"no collision": (re.sub("<collision name.*?</collision>", "", URDF, flags=re.S), "has no collision")},
}


@pytest.mark.parametrize(("target", "case"), [(target, case) for target, cases in BAD.items() for case in cases])
def test_what_cannot_be_patched_is_refused_with_the_place(target, case, tmp_path):
    text, message = BAD[target][case]
    with pytest.raises(UserError, match=message):
        patched(model(), target, file_of(tmp_path, text), "block")


def test_files_that_are_no_xml_are_refused(tmp_path):
    for raw in (bytes(range(256)), MJCF.encode("latin-1")):
        path = tmp_path / "raw.xml"
        path.write_bytes(raw)
        with pytest.raises(UserError, match="is not XML"):
            patched(model(), "mjcf", path, "block")
    with pytest.raises(UserError, match="does not exist"):
        patched(model(), "mjcf", tmp_path / "nowhere.xml", "block")
    with pytest.raises(UserError, match="is a folder"):
        patched(model(), "mjcf", tmp_path, "block")


def test_encodings_and_ends_of_lines_stay(tmp_path):
    """A byte order mark, UTF-16, another encoding, carriage returns: the same edits, in the bytes of the file."""
    plain = patched(model(), "mjcf", file_of(tmp_path, MJCF), "block").content.decode()
    path = tmp_path / "other.xml"
    latin = MJCF.replace("utf-8", "iso-8859-1")
    windows, of_windows = (text.replace("\r", "").replace("\n", "\r\n") for text in (MJCF, plain))
    for raw, expected in (
        (MJCF.encode("utf-8-sig"), plain.encode("utf-8-sig")),
        (MJCF.replace("utf-8", "utf-16").encode("utf-16"), plain.replace("utf-8", "utf-16").encode("utf-16")),
        (latin.encode("latin-1"), plain.replace("utf-8", "iso-8859-1").encode("latin-1")),
        (windows.encode(), of_windows.encode()),
    ):
        path.write_bytes(raw)
        assert patched(model(), "mjcf", path, "block").content == expected


def test_the_command_patches_and_says_what(tmp_path, capsys):
    from thesis_lib.__main__ import main

    model().save(tmp_path / "model.json")
    mine, better = file_of(tmp_path, MJCF), tmp_path / "better.xml"
    export = ["export", f"{tmp_path}/model.json", "--to"]
    assert main([*export, "mjcf", "--patch", str(mine), "--body", "block", "-o", str(better)]) == 0
    said = capsys.readouterr().err
    assert "centre of mass: 0 0.01 0 -> 0.001 0.01 -0.002" in said and "solimp= 1: solref: 0.02 1 -> -" in said
    assert better.exists() and mine.read_bytes() == MJCF.encode()
    assert main([*export, "sdf", "-o", f"{tmp_path}/x.sdf", "--mass", str(MASS), "-q"]) == 0
    assert capsys.readouterr().err == ""
    for wrong, message in (
        (["--patch", str(mine)], "belong together"),
        (["--surface", "table"], "is for --patch"),
        (["-o", str(tmp_path)], "is a folder"),
    ):
        assert main([*export, "mjcf", "-o", f"{tmp_path}/y.xml", *wrong]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "y.xml").exists()
