"""SDF and URDF files of a body and its surface, with Drake's own elements for contact.

Drake's point contact uses one point per pair of geometries, even if a face lies on the surface.  So a box or a hull
touches with a sphere at each corner, small or with the radius of its edges, as is usual in Drake; the box itself is
only a visual.  The surface is a half-space in SDF, and a thick box in URDF, which has no half-space.  Body and surface
have the same stiffness, dissipation and friction, because Drake combines the values of both.
"""

from dataclasses import replace

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Hull, Solid, Sphere
from thesis_lib.critique.export.patch import Element
from thesis_lib.critique.export.solid import UPRIGHT, ExportedBody, comment, n, story
from thesis_lib.engines.parameters import DrakeNumbers, drake_numbers
from thesis_lib.mechanics.frame import Frame
from thesis_lib.simulate.rig.hidden_causes import REFERENCE_SPEED

GRAVITY = {
    "sdf": "Drake ignores the gravity of an SDF world: set {} m/s^2 in the plant",
    "urdf": "gravity is not part of URDF: set {} m/s^2 where you load the file",
}
ROOTS = {"sdf": "sdf", "urdf": "robot"}
NAMESPACE = {"sdf": "drake.mit.edu", "urdf": "http://drake.mit.edu"}
ENTRIES = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}  # of the inertia
WIDE, THICK = 20.0, 1.0  # m, of the box that is the surface in URDF


def numbers(solid: ExportedBody, of: int) -> DrakeNumbers:
    """Return Drake's contact parameters for a body that touches in `of` points."""
    return drake_numbers(solid.mu, solid.epsilon, solid.contact_time, mass=solid.mass, points=of, speed=solid.speed)


def contact_story(solid: ExportedBody, of: int) -> list[str]:
    """Return comment lines: the source of stiffness and dissipation, and how the engine differs from the law."""
    speed = solid.speed or REFERENCE_SPEED
    lines = [
        f"hunt_crossley_dissipation, point_contact_stiffness: give this restitution and contact time at {speed:g} m/s,",
        f"  with {of} contact point{'s' * (of > 1)} sharing the load and the same numbers in both bodies;",
        "  Drake's epsilon falls with the speed; use a plant in continuous time (time_step = 0), or with steps of",
        "  a few microseconds and a contact approximation that uses dissipation (lagged, similar)",
    ]
    if solid.model.law == "pressure_field_contact":
        lines.append("the fitted law is a pressure field (hydroelastic): it is written as point contact")
    elif not solid.model.law.startswith("hunt_crossley"):
        lines.append(f"the fitted law, {solid.model.law.replace('_', ' ')}, differs from Drake's contact")
    return lines


def sdf(solid: ExportedBody) -> str:
    """Return the SDF file, a world with two models."""
    of, tree = solid.points, _Tree("sdf", version="1.9")
    made = numbers(solid, of)
    world = tree.add(tree.root, "world", name="drops")
    tree.add(world, "gravity", n(solid.gravity))
    surface = tree.add(world, "model", name="surface")
    tree.add(surface, "static", "true")
    tree.pose(surface, solid.surface)
    collision = tree.add(tree.add(surface, "link", name="surface"), "collision", name="plane")
    plane = tree.add(tree.add(collision, "geometry"), "plane")
    tree.values(plane, normal="0 0 1", size="1 1")
    tree.contact(collision, made)
    body = tree.add(world, "model", name="body")
    tree.pose(body, Frame(solid.start, UPRIGHT))
    _body(tree, tree.add(body, "link", name="body"), solid, made)
    return tree.text([*story(solid, contact_story(solid, of)), "", GRAVITY["sdf"].format(n(solid.gravity))])


def urdf(solid: ExportedBody) -> str:
    """Return the URDF file, a robot whose surface is fixed to the world."""
    of, tree = solid.points, _Tree("urdf", name="drops")
    made = numbers(solid, of)
    tree.add(tree.root, "link", name="world")
    collision = tree.add(tree.add(tree.root, "link", name="surface"), "collision", name="plane")
    tree.shape(collision, Box(half_extents=(0.5 * WIDE, 0.5 * WIDE, 0.5 * THICK)))
    tree.contact(collision, made)
    joint = tree.add(tree.root, "joint", name="surface", type="fixed")
    tree.add(joint, "parent", link="world")
    tree.add(joint, "child", link="surface")
    tree.pose(joint, replace(solid.surface, origin=solid.surface.origin - 0.5 * THICK * solid.normal))
    _body(tree, tree.add(tree.root, "link", name="body"), solid, made)
    return tree.text([*story(solid, contact_story(solid, of)), "", GRAVITY["urdf"].format(n(solid.gravity))])


class _Tree:
    """A new file; numbers are attributes in URDF, and separate elements in SDF."""

    def __init__(self, target: str, **attributes: str) -> None:
        self.target = target
        self.root = etree.Element(ROOTS[target], attributes, nsmap={"drake": NAMESPACE[target]})

    def add(self, parent: Element, tag: str, text: str = "", **attributes: str) -> Element:
        """Append and return a child; Drake's own tags begin with "drake:"."""
        prefix, _, name = tag.rpartition(":")
        child = etree.SubElement(parent, f"{{{NAMESPACE[self.target]}}}{name}" if prefix else tag, attributes)
        child.text = text or None
        return child

    def values(self, element: Element, **values: str) -> None:
        for name, value in values.items():
            if self.target == "urdf":
                element.set(name, value)
            else:
                self.add(element, name, value)

    def pose(self, element: Element, at: Frame) -> None:
        """Append the pose of an element, with the rotation as roll, pitch, yaw in rad."""
        turn = n(Rotation.from_quat(at.attitude, scalar_first=True).as_euler("xyz"))
        if self.target == "urdf":
            self.add(element, "origin", xyz=n(at.origin), rpy=turn)
        else:
            self.add(element, "pose", f"{n(at.origin)} {turn}")

    def shape(self, element: Element, solid: Solid) -> None:
        own = "drake:" if self.target == "urdf" and isinstance(solid, Ellipsoid | Capsule) else ""
        if isinstance(solid, Ellipsoid):
            axes = solid.semi_axes
            sizes = {name: n(value) for name, value in zip("abc", axes)} if own else {"radii": n(*axes)}
        elif isinstance(solid, Box):
            sizes = {"size": n(*(2.0 * half for half in solid.half_extents))}
        else:
            assert isinstance(solid, Sphere | Capsule | Cylinder)
            long = {} if isinstance(solid, Sphere) else {"length": n(2.0 * solid.half_length)}
            sizes = {"radius": n(solid.radius)} | long
        self.values(self.add(self.add(element, "geometry"), own + solid.kind), **sizes)

    def number(self, element: Element, tag: str, value: float) -> None:
        """Append a child with one number."""
        self.add(element, tag, **{"value" if self.target == "urdf" else "text": n(value)})

    def contact(self, collision: Element, made: DrakeNumbers) -> None:
        properties = self.add(collision, "drake:proximity_properties")
        for name, value in drake_elements(made).items():
            self.number(properties, f"drake:{name}", value)

    def text(self, said: list[str]) -> str:
        """Return the file, with a comment at its head."""
        etree.indent(self.root)
        return f'<?xml version="1.0"?>\n{comment(said)}\n{etree.tostring(self.root, encoding="unicode")}\n'


def _body(tree: _Tree, link: Element, solid: ExportedBody, made: DrakeNumbers) -> None:
    """Append inertia, visuals and collisions to a link."""
    inertial = tree.add(link, "inertial")
    tree.pose(inertial, Frame(solid.centre, UPRIGHT))
    tree.number(inertial, "mass", solid.mass)
    tree.values(tree.add(inertial, "inertia"), **{name: n(solid.inertia[at]) for name, at in ENTRIES.items()})
    for part in solid.parts(at_corners=True):
        if isinstance(part.solid, Hull):  # its corners touch; SDF and URDF cannot contain the hull itself
            continue
        element = tree.add(link, "collision" if part.touches else "visual", name=part.name)
        tree.pose(element, part.at)
        tree.shape(element, part.solid)
        if part.touches:
            tree.contact(element, made)


def drake_elements(made: DrakeNumbers) -> dict[str, float]:
    """Return the names of Drake's contact elements with their values."""
    return {
        "mu_static": made.friction,
        "mu_dynamic": made.friction,
        "hunt_crossley_dissipation": made.dissipation,
        "point_contact_stiffness": made.stiffness,
    }
