"""A body and its surface as MJCF, for MuJoCo.

An ellipse is an ellipsoid, a disk a cylinder, a rectangle along the axes a box, any other polygon a mesh of its prism.
Round corners are capsules along the edges of the prism, which itself is then there to be seen only.  The contact has
the impedance that was fitted, or else is a spring and a damper of their own, with `priority`, so that the surface's
numbers do not mix in.
"""

import numpy as np

from thesis_lib.bodies.shapes import Disk, Ellipse
from thesis_lib.critique.export.solid import ExportedBody, comment, n, story
from thesis_lib.engines.parameters import MujocoNumbers, mujoco_numbers
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.forces import rounded_centres

IMPEDANCE = 0.01  # where none was fitted; near 0 the force depends on depth and rate alone, as materials have it
IMPRATIO = 10.0  # where no damping ratio of friction was fitted: slip decays within a tenth of the contact
# in one contact time, by Runge-Kutta: the touch falls anywhere in a step, and the damper acts late by half of one.
# 50 steps move the velocity after an impact by 8 mm/s, 200 by 1 mm/s
STEPS = 200
UNSEEN = 'contype="0" conaffinity="0"'


def points(solid: ExportedBody) -> int:
    """Points in which the body touches: one of an ellipsoid, both ends of an edge of a prism."""
    return 1 if isinstance(solid.shape, Ellipse) else 2


def numbers(solid: ExportedBody, of: int) -> MujocoNumbers:
    """The contact of a body that touches in so many points."""
    ratio = IMPRATIO if solid.damping_ratio is None else solid.damping_ratio
    d = solid.impedance or IMPEDANCE
    return mujoco_numbers(solid.mu, solid.epsilon, solid.contact_time, impedance=d, impratio=ratio, points=of)


def contact_story(solid: ExportedBody, of: int) -> list[str]:
    """Where solref, solimp and impratio come from, and how the engine differs from the law."""
    ratio = "fitted (damping_ratio)" if solid.damping_ratio is not None else "not fitted"
    lines = [
        f"solref, solimp: that restitution and contact time, of {of} contact point{'s' * (of > 1)} that share it;",
        "  MuJoCo's contact is a spring and a damper: off the centre epsilon is less, at any speed the same",
        f"solimp: {'fitted (impedance)' if solid.impedance else 'not fitted: a spring and a damper of their own'}",
        f"impratio: damping of the slip over that of the normal force, {ratio}",
        f"timestep: {STEPS} steps in one contact time",
    ]
    if solid.model.law not in ("convex_contact", "damped_contact"):
        lines.append(f"the law of the fit, {solid.model.law.replace('_', ' ')}, is another contact than MuJoCo's")
    return lines


def mjcf(solid: ExportedBody) -> str:
    """The file; UserError for round corners that do not fit into the prism."""
    of = points(solid)
    made = numbers(solid, of)
    mesh, geoms = _geoms(solid, _contact(made))
    I = solid.inertia
    normal = solid.normal
    return f"""<mujoco model="{_name(solid)}">
{comment(story(solid, contact_story(solid, of)), "  ")}
  <compiler angle="radian"/>
  <option timestep="{n(solid.contact_time / STEPS)}" integrator="RK4" cone="elliptic" impratio="{n(made.impratio)}"
          gravity="0 0 {n(-solid.gravity)}"/>
{mesh}  <worldbody>
    <geom name="surface" type="plane" size="0 0 1" pos="{n(solid.height * normal)}" zaxis="{n(normal)}"/>
    <body name="body" pos="{n((solid.height + _reach(solid)) * normal)}">
      <freejoint/>
      <inertial pos="{n(solid.centre)}" mass="{n(solid.mass)}"
                fullinertia="{n(I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])}"/>
{geoms}    </body>
  </worldbody>
</mujoco>
"""


def _name(solid: ExportedBody) -> str:
    return {"ellipse": "ellipsoid", "disk": "cylinder", "polygon": "prism"}[solid.shape.kind]


def _reach(solid: ExportedBody) -> float:
    return float(-solid.shape.contact_point(np.zeros(1))[0, 1])


def _contact(made: MujocoNumbers) -> str:
    # torsional and rolling friction are not used with condim 3
    return (
        f'condim="3" priority="1" friction="{n(made.friction)} 0.005 0.0001"\n            '
        f'solref="{n(*made.solref)}" solimp="{n(*made.solimp)}"'
    )


def _geoms(solid: ExportedBody, contact: str) -> tuple[str, str]:
    """Assets, and the geoms of the body."""
    shape, half = solid.shape, 0.5 * solid.depth
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return "", f'      <geom name="body" type="ellipsoid" size="{n(a, half, b)}"\n            {contact}/>\n'
    if isinstance(shape, Disk):
        size = f'size="{n(shape.radius, half)}" zaxis="0 1 0"'
        return "", f'      <geom name="body" type="cylinder" {size}\n            {contact}/>\n'
    corners, mesh = shape.corners, ""
    if solid.box:
        (x, z), (a, b) = solid.box
        prism = f'name="body" type="box" size="{n(a, half, b)}" pos="{n(x, 0.0, z)}"'
    else:
        ends = [(x, y, z) for y in (-half, half) for x, z in corners]
        mesh = f'  <asset>\n    <mesh name="prism" vertex="{"  ".join(n(*end) for end in ends)}"/>\n  </asset>\n'
        prism = 'name="body" type="mesh" mesh="prism"'
    if not solid.corner_radius:
        return mesh, f"      <geom {prism}\n            {contact}/>\n"
    rho = solid.corner_radius
    if rho >= half:
        raise UserError(f"--depth {solid.depth:g} is too thin for corners of {rho:g} m radius; give more.")
    seen = f"      <geom {prism} {UNSEEN}/>\n"
    round_ = "".join(
        f'      <geom name="corner{i}" type="capsule" size="{n(rho)}" fromto="{n(x, rho - half, z, x, half - rho, z)}"'
        f"\n            {contact}/>\n"
        for i, (x, z) in enumerate(rounded_centres(corners, rho))
    )
    return mesh, seen + round_
