"""A body and its surface as SDF or URDF, with Drake's own elements for contact.

Drake's point contact is one point for a pair of geometries, also where a face lies on the surface.  So a polygon
touches with a small sphere at each corner of its prism, as is usual in Drake; the prism itself is there to be seen (a
box; of other polygons only the spheres).  The surface is a half-space in SDF, and a thick box in URDF, which has none;
against that box a disk touches with a sphere of its radius.  Spring, dissipation and friction stand with body and
surface alike, because Drake mixes those of a pair.
"""

import numpy as np

from thesis_lib.bodies.shapes import Disk, Ellipse
from thesis_lib.critique.export.solid import ExportedBody
from thesis_lib.critique.export.text import comment, n, story
from thesis_lib.engines.parameters import DrakeNumbers, drake_numbers
from thesis_lib.simulate.compliant.forces import rounded_centres
from thesis_lib.simulate.rig.hidden_causes import REFERENCE_SPEED

SHARP = 1e-6  # m; radius of the sphere at a sharp corner
GRAVITY = {
    "sdf": "Drake ignores the gravity of an SDF world: set it in the plant",
    "urdf": "gravity is not part of URDF: set it where you load the file",
}
WIDE, THICK = 20.0, 1.0  # m, of the box that is the surface in URDF


def points(solid: ExportedBody) -> int:
    """Points in which the body touches: one of an ellipsoid or a cylinder, two spheres at an edge of a prism."""
    return 1 if isinstance(solid.shape, Ellipse | Disk) else 2


def numbers(solid: ExportedBody, of: int) -> DrakeNumbers:
    """The contact of a body that touches in so many points."""
    return drake_numbers(solid.mu, solid.epsilon, solid.contact_time, mass=solid.mass, points=of, speed=solid.speed)


def contact_story(solid: ExportedBody, of: int) -> list[str]:
    """Where stiffness and dissipation come from, and how the engine differs from the law."""
    speed = solid.speed or REFERENCE_SPEED
    lines = [
        f"hunt_crossley_dissipation, point_contact_stiffness: that restitution and contact time at {speed:g} m/s,",
        f"  of {of} contact point{'s' * (of > 1)} that share the load, with the same numbers in both bodies;",
        "  Drake's epsilon falls with the speed; it needs a plant in continuous time (time_step = 0), or one",
        "  in steps of few microseconds that uses dissipation (lagged, similar)",
    ]
    if solid.model.law == "pressure_field_contact":
        lines.append("the law of the fit is a pressure field (hydroelastic): written as point contact")
    elif not solid.model.law.startswith("hunt_crossley"):
        lines.append(f"the law of the fit, {solid.model.law.replace('_', ' ')}, is another contact than Drake's")
    return lines


def sdf(solid: ExportedBody) -> str:
    """The file as SDF, a world with two models."""
    of = points(solid)
    contact = _sdf_contact(numbers(solid, of))
    I, reach = solid.inertia, float(-solid.shape.contact_point(np.zeros(1))[0, 1])
    seen = f"""        <visual name="prism">
{_placed(solid, "          ")}        </visual>
"""
    collisions = "".join(
        f"""        <collision name="{name}">
          <pose>{n(*place)} {turn}</pose>
          <geometry>{shape}</geometry>
{contact}        </collision>
"""
        for name, place, turn, shape in _collisions(solid, _SDF)
    )
    return f"""<?xml version="1.0"?>
{comment([*story(solid, contact_story(solid, of)), "", GRAVITY["sdf"]])}
<sdf version="1.9" xmlns:drake="drake.mit.edu">
  <world name="drops">
    <gravity>0 0 {n(-solid.gravity)}</gravity>
    <model name="surface">
      <static>true</static>
      <pose>{n(solid.height * solid.normal)} 0 {n(solid.tilt)} 0</pose>
      <link name="surface">
        <collision name="plane">
          <geometry><plane><normal>0 0 1</normal><size>1 1</size></plane></geometry>
{contact}        </collision>
      </link>
    </model>
    <model name="body">
      <pose>{n((solid.height + reach) * solid.normal)} 0 0 0</pose>
      <link name="body">
        <inertial>
          <pose>{n(solid.centre)} 0 0 0</pose>
          <mass>{n(solid.mass)}</mass>
          <inertia>
            <ixx>{n(I[0, 0])}</ixx><iyy>{n(I[1, 1])}</iyy><izz>{n(I[2, 2])}</izz>
            <ixy>{n(I[0, 1])}</ixy><ixz>{n(I[0, 2])}</ixz><iyz>{n(I[1, 2])}</iyz>
          </inertia>
        </inertial>
{seen if solid.box else ""}{collisions}      </link>
    </model>
  </world>
</sdf>
"""


def urdf(solid: ExportedBody) -> str:
    """The file as URDF, a robot whose surface is fixed to the world."""
    of = points(solid)
    contact = _urdf_contact(numbers(solid, of))
    I, normal = solid.inertia, solid.normal
    under = (solid.height - 0.5 * THICK) * normal
    collisions = "".join(
        f"""    <collision name="{name}">
      <origin xyz="{n(*place)}" rpy="{turn}"/>
      <geometry>{shape}</geometry>
{contact}    </collision>
"""
        for name, place, turn, shape in _collisions(solid, _URDF)
    )
    seen = ""
    if isinstance(solid.shape, Disk):
        turned = _URDF["cylinder"].format(n(solid.shape.radius), n(solid.depth))
        seen = f"""    <visual name="disk">
      <origin xyz="0 0 0" rpy="{_ALONG_Y}"/>
      <geometry>{turned}</geometry>
    </visual>
"""
    if solid.box:
        (x, z), (a, b) = solid.box
        seen = f"""    <visual name="prism">
      <origin xyz="{n(x, 0.0, z)}" rpy="0 0 0"/>
      <geometry><box size="{n(2.0 * a, solid.depth, 2.0 * b)}"/></geometry>
    </visual>
"""
    tensor = " ".join(
        f'i{name}="{n(I["xyz".index(name[0]), "xyz".index(name[1])])}"' for name in ("xx", "yy", "zz", "xy", "xz", "yz")
    )
    return f"""<?xml version="1.0"?>
{comment([*story(solid, contact_story(solid, of)), "", GRAVITY["urdf"]])}
<robot name="drops" xmlns:drake="http://drake.mit.edu">
  <link name="world"/>
  <link name="surface">
    <collision name="plane">
      <geometry><box size="{n(WIDE, WIDE, THICK)}"/></geometry>
{contact}    </collision>
  </link>
  <joint name="surface" type="fixed">
    <parent link="world"/>
    <child link="surface"/>
    <origin xyz="{n(under)}" rpy="0 {n(solid.tilt)} 0"/>
  </joint>
  <link name="body">
    <inertial>
      <origin xyz="{n(solid.centre)}" rpy="0 0 0"/>
      <mass value="{n(solid.mass)}"/>
      <inertia {tensor}/>
    </inertial>
{seen}{collisions}  </link>
</robot>
"""


_SDF = {
    "ellipsoid": "<ellipsoid><radii>{0} {1} {2}</radii></ellipsoid>",
    "cylinder": "<cylinder><radius>{0}</radius><length>{1}</length></cylinder>",
    "sphere": "<sphere><radius>{0}</radius></sphere>",
}
_URDF = {
    "ellipsoid": '<drake:ellipsoid a="{0}" b="{1}" c="{2}"/>',
    "cylinder": '<cylinder radius="{0}" length="{1}"/>',
    "sphere": '<sphere radius="{0}"/>',
}
_ALONG_Y = f"{n(0.5 * np.pi)} 0 0"  # turns the axis of a cylinder


def _collisions(solid: ExportedBody, form: dict[str, str]) -> list[tuple[str, np.ndarray, str, str]]:
    """Name, place (3,) in m, turn and shape of each collision geometry."""
    shape, half = solid.shape, 0.5 * solid.depth
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return [("body", np.zeros(3), "0 0 0", form["ellipsoid"].format(n(a), n(half), n(b)))]
    if isinstance(shape, Disk):
        if form is _URDF:  # against a box, Drake iterates for the contact of a cylinder and does not get on
            return [("body", np.zeros(3), "0 0 0", form["sphere"].format(n(shape.radius)))]
        return [("body", np.zeros(3), _ALONG_Y, form["cylinder"].format(n(shape.radius), n(solid.depth)))]
    rho = solid.corner_radius or SHARP
    ball = form["sphere"].format(n(rho))
    centres = rounded_centres(shape.corners, rho)
    places = [np.array([x, y, z]) for x, z in centres for y in (rho - half, half - rho)]
    return [(f"corner{i}", place, "0 0 0", ball) for i, place in enumerate(places)]


def _placed(solid: ExportedBody, indent: str) -> str:
    """Pose and geometry of the prism that is seen, of a box."""
    if not solid.box:
        return ""
    (x, z), (a, b) = solid.box
    size = n(2.0 * a, solid.depth, 2.0 * b)
    return f"{indent}<pose>{n(x, 0.0, z)} 0 0 0</pose>\n{indent}<geometry><box><size>{size}</size></box></geometry>\n"


def _sdf_contact(made: DrakeNumbers) -> str:
    return "".join(
        [
            "          <drake:proximity_properties>\n",
            *(f"            <drake:{name}>{n(value)}</drake:{name}>\n" for name, value in drake_elements(made).items()),
            "          </drake:proximity_properties>\n",
        ]
    )


def _urdf_contact(made: DrakeNumbers) -> str:
    return "".join(
        [
            "      <drake:proximity_properties>\n",
            *(f'        <drake:{name} value="{n(value)}"/>\n' for name, value in drake_elements(made).items()),
            "      </drake:proximity_properties>\n",
        ]
    )


def drake_elements(made: DrakeNumbers) -> dict[str, float]:
    """Drake's elements of contact with their values."""
    return {
        "mu_static": made.friction,
        "mu_dynamic": made.friction,
        "hunt_crossley_dissipation": made.dissipation,
        "point_contact_stiffness": made.stiffness,
    }
