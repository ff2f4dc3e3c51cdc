"""A body and its surface as MJCF, for MuJoCo.

A hull is a mesh.  Where edges are round, what touches are balls at the corners, and the solid itself is there to be
seen only.  The contact has the impedance that was fitted, or else is a spring and a damper of their own, with
`priority`, so that the surface's numbers do not mix in.
"""

import numpy as np

from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Hull, Solid, Sphere
from thesis_lib.critique.contacts.contact_time import EDGE_ANGLE
from thesis_lib.critique.export.solid import UPRIGHT, ExportedBody, Part, comment, n, story
from thesis_lib.engines.parameters import MujocoNumbers, mujoco_numbers

IMPEDANCE = 0.01  # where none was fitted; near 0 the force depends on depth and rate alone, as materials have it
IMPRATIO = 10.0  # where no damping ratio of friction was fitted: slip decays within a tenth of the contact
# in one contact time, by Runge-Kutta: the touch falls anywhere in a step, and the damper acts late by half of one.
# 50 steps move the velocity after an impact by 8 mm/s, 200 by 1 mm/s
STEPS = 200
UNSEEN = 'contype="0" conaffinity="0"'


def numbers(solid: ExportedBody, of: int) -> MujocoNumbers:
    """The contact of a body that touches in so many points."""
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
    """MuJoCo's cone of friction that the contact needs."""
    return "pyramidal" if solid.on_pyramid else "elliptic"


def contact_story(solid: ExportedBody, of: int) -> list[str]:
    """Where solref, solimp and impratio come from, and how the engine differs from the law."""
    ratio = "fitted (damping_ratio)" if solid.damping_ratio is not None else "not fitted"
    ratio = "1 on a pyramid" if solid.on_pyramid else ratio
    lines = [
        f"solref, solimp: that restitution and contact time, of {of} contact point{'s' * (of > 1)} that share it;",
        "  MuJoCo's contact is a spring and a damper: off the centre epsilon is less, at any speed the same",
        f"solimp: {'fitted (impedance)' if solid.impedance else 'not fitted: a spring and a damper of their own'}",
        f"impratio: damping of the slip over that of the normal force, {ratio}",
        f"timestep: {STEPS} steps in one contact time",
    ]
    if solid.on_pyramid:
        angle = f"{solid.model.values[EDGE_ANGLE.name]:.3g} rad about the normal from the first axis of the surface"
        lines.append(f"the edges of the pyramid were fitted at {angle}; MuJoCo lays them along axes of its world")
    if solid.model.law not in ("convex_contact", "pyramid_contact", "damped_contact"):
        lines.append(f"the law of the fit, {solid.model.law.replace('_', ' ')}, is another contact than MuJoCo's")
    return lines


def mjcf(solid: ExportedBody) -> str:
    """The file."""
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
