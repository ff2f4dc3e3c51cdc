"""MJCF file of a body and its surface, for MuJoCo.

A hull is a mesh.  A solid with round edges touches with balls at its corners, and is itself only visible.  The contact
has the fitted impedance; without one, it acts as a spring and a damper that do not depend on the mass.  It has
`priority`, so MuJoCo does not average its parameters with those of the surface.
"""

import numpy as np

from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Hull, Solid, Sphere
from thesis_lib.critique.contacts.contact_time import EDGE_ANGLE
from thesis_lib.critique.export.solid import UPRIGHT, ExportedBody, Part, comment, n, story
from thesis_lib.engines.parameters import MujocoNumbers, mujoco_numbers

IMPEDANCE = 0.01  # if none was fitted; near 0 the force depends on depth and rate alone, as in real materials
IMPRATIO = 10.0  # if no damping ratio of friction was fitted: slip decays within a tenth of the contact
# Runge-Kutta steps in one contact time: the touch falls anywhere within a step, so the damper acts half a step late.
# This changes the velocity after an impact by 8 mm/s with 50 steps, by 1 mm/s with 200
STEPS = 200
UNSEEN = 'contype="0" conaffinity="0"'


def numbers(solid: ExportedBody, of: int) -> MujocoNumbers:
    """Return MuJoCo's contact parameters for a body that touches in `of` points."""
    ratio = IMPRATIO if solid.damping_ratio is None else solid.damping_ratio
    return mujoco_numbers(
        solid.mu,
        solid.epsilon,
        solid.contact_time,
        impedance=solid.impedance or IMPEDANCE,
        impratio=1.0 if solid.on_pyramid else ratio,
        points=of,
        estimate=solid.estimate,
        on_pyramid=solid.on_pyramid,
    )


def cone(solid: ExportedBody) -> str:
    """Return MuJoCo's friction cone that the contact needs."""
    return "pyramidal" if solid.on_pyramid else "elliptic"


def contact_story(solid: ExportedBody, of: int) -> list[str]:
    """Return comment lines: the source of solref, solimp and impratio, and how the engine differs from the law."""
    ratio = "fitted (damping_ratio)" if solid.damping_ratio is not None else "not fitted"
    ratio = "1 on a pyramid" if solid.on_pyramid else ratio
    lines = [
        f"solref, solimp: give this restitution and contact time, with {of} contact point{'s' * (of > 1)};",
        "  MuJoCo's contact is a spring and a damper: epsilon is smaller off the centre, and the same at any speed",
        f"solimp: {'fitted (impedance)' if solid.impedance else 'not fitted: spring and damper, whatever the mass'}",
        f"impratio: damping of the slip over that of the normal force, {ratio}",
        f"timestep: {STEPS} steps in one contact time",
    ]
    if solid.on_pyramid:
        angle = f"{solid.model.values[EDGE_ANGLE.name]:.3g} rad about the normal from the first axis of the surface"
        lines.append(f"the edges of the pyramid were fitted at {angle}; MuJoCo aligns them with the axes of its world")
    if solid.model.law not in ("convex_contact", "pyramid_contact", "damped_contact"):
        lines.append(f"the fitted law, {solid.model.law.replace('_', ' ')}, differs from MuJoCo's contact")
    return lines


def mjcf(solid: ExportedBody) -> str:
    """Return the MJCF file."""
    of = solid.points
    made = numbers(solid, of)
    I, parts = solid.inertia, solid.parts(at_corners=False)
    name = solid.shape.kind  # pyright: ignore[reportAttributeAccessIssue]
    return f"""<mujoco model="{name}">
{comment(story(solid, contact_story(solid, of)), "  ")}
  <compiler angle="radian"/>
  <option timestep="{n(solid.contact_time / STEPS)}" integrator="RK4" cone="{cone(solid)}" impratio="{n(made.impratio)}"
          gravity="{n(solid.gravity)}"/>
{"".join(map(_mesh, parts))}  <worldbody>
    <geom name="surface" type="plane" size="0 0 1" pos="{n(solid.surface.origin)}" zaxis="{n(solid.normal)}"/>
    <body name="body" pos="{n(solid.start)}">
      <freejoint/>
      <inertial pos="{n(solid.centre)}" mass="{n(solid.mass)}"
                fullinertia="{n(I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])}"/>
{"".join(_geom(part, _contact(made, solid.twist)) for part in parts)}    </body>
  </worldbody>
</mujoco>
"""


def _contact(made: MujocoNumbers, twist: float) -> str:
    # torsional and rolling friction are not used with condim 3
    return (
        f'condim="{4 if twist else 3}" priority="1" friction="{n(made.friction)} {n(twist or 0.005)} 0.0001"'
        f'\n            solref="{n(*made.solref)}" solimp="{n(*made.solimp)}"'
    )


def _mesh(part: Part) -> str:
    if not isinstance(part.solid, Hull):
        return ""
    vertices = "  ".join(n(*corner) for corner in part.solid.corners.T)
    return f'  <asset>\n    <mesh name="{part.name}" vertex="{vertices}"/>\n  </asset>\n'


def _geom(part: Part, contact: str) -> str:
    shape = 'type="mesh" mesh="body"' if isinstance(part.solid, Hull) else _sizes(part.solid)
    turn = f' quat="{n(part.at.attitude)}"' if np.abs(part.at.attitude - UPRIGHT).max() else ""
    place = f' pos="{n(part.at.origin)}"' if part.at.origin.any() else ""
    rest = f"\n            {contact}" if part.touches else f" {UNSEEN}"
    return f'      <geom name="{part.name}" {shape}{place}{turn}{rest}/>\n'


def _sizes(solid: Solid) -> str:
    if isinstance(solid, Sphere):
        size = (solid.radius,)
    elif isinstance(solid, Capsule | Cylinder):
        size = (solid.radius, solid.half_length)
    else:
        assert isinstance(solid, Box | Ellipsoid)
        size = solid.half_extents if isinstance(solid, Box) else solid.semi_axes
    return f'type="{solid.kind}" size="{n(*size)}"'
