"""A body and its surface as SDF or URDF, with Drake's own elements for contact.

Drake's point contact is one point for a pair of geometries, also where a face lies on the surface.  So a polygon
touches with a small sphere at each corner of its prism, as is usual in Drake; the prism itself is there to be seen (a
box; of other polygons only the spheres).  The surface is a half-space in SDF, and a thick box in URDF, which has none;
against that box a disk touches with a sphere of its radius.  Spring, dissipation and friction stand with body and
surface alike, because Drake mixes those of a pair.
"""

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from thesis_lib.bodies.shapes import Disk, Ellipse
from thesis_lib.critique.export.patch import Element
from thesis_lib.critique.export.solid import ExportedBody, comment, n, story
from thesis_lib.engines.parameters import DrakeNumbers, drake_numbers
from thesis_lib.simulate.compliant.forces import rounded_centres
from thesis_lib.simulate.rig.hidden_causes import REFERENCE_SPEED

SHARP = 1e-6  # m; radius of the sphere at a sharp corner
GRAVITY = {
    "sdf": "Drake ignores the gravity of an SDF world: set it in the plant",
    "urdf": "gravity is not part of URDF: set it where you load the file",
}
ROOTS = {"sdf": "sdf", "urdf": "robot"}
NAMESPACE = {"sdf": "drake.mit.edu", "urdf": "http://drake.mit.edu"}
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
    of, tree = points(solid), _Tree("sdf", version="1.9")
    reach = float(-solid.shape.contact_point(np.zeros(1))[0, 1])
    world = tree.add(tree.root, "world", name="drops")
    tree.add(world, "gravity", f"0 0 {n(-solid.gravity)}")
    surface = tree.add(world, "model", name="surface")
    tree.add(surface, "static", "true")
    tree.pose(surface, solid.height * solid.normal, f"0 {n(solid.tilt)} 0")
    collision = tree.add(tree.add(surface, "link", name="surface"), "collision", name="plane")
    plane = tree.add(tree.add(collision, "geometry"), "plane")
    tree.values(plane, normal="0 0 1", size="1 1")
    tree.contact(collision, numbers(solid, of))
    body = tree.add(world, "model", name="body")
    tree.pose(body, (solid.height + reach) * solid.normal)
    _body(tree, tree.add(body, "link", name="body"), solid, of)
    return tree.text([*story(solid, contact_story(solid, of)), "", GRAVITY["sdf"]])


def urdf(solid: ExportedBody) -> str:
    """The file as URDF, a robot whose surface is fixed to the world."""
    of, tree = points(solid), _Tree("urdf", name="drops")
    tree.add(tree.root, "link", name="world")
    collision = tree.add(tree.add(tree.root, "link", name="surface"), "collision", name="plane")
    tree.shape(collision, "box", size=n(WIDE, WIDE, THICK))
    tree.contact(collision, numbers(solid, of))
    joint = tree.add(tree.root, "joint", name="surface", type="fixed")
    tree.add(joint, "parent", link="world")
    tree.add(joint, "child", link="surface")
    tree.pose(joint, (solid.height - 0.5 * THICK) * solid.normal, f"0 {n(solid.tilt)} 0")
    _body(tree, tree.add(tree.root, "link", name="body"), solid, of)
    return tree.text([*story(solid, contact_story(solid, of)), "", GRAVITY["urdf"]])


class _Tree:
    """A new file; numbers stand in attributes of URDF and in elements of their own in SDF."""

    def __init__(self, target: str, **attributes: str) -> None:
        self.target = target
        self.root = etree.Element(ROOTS[target], attributes, nsmap={"drake": NAMESPACE[target]})

    def add(self, parent: Element, tag: str, text: str = "", **attributes: str) -> Element:
        """A new last child; Drake's own tags begin with "drake:"."""
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

    def pose(self, element: Element, place: np.ndarray, turn: str = "0 0 0") -> None:
        """Where an element is: `place` (3,) in m, `turn` as roll, pitch, yaw in rad."""
        if self.target == "urdf":
            self.add(element, "origin", xyz=n(*place), rpy=turn)
        else:
            self.add(element, "pose", f"{n(*place)} {turn}")

    def shape(self, element: Element, kind: str, **sizes: str) -> None:
        self.values(self.add(self.add(element, "geometry"), kind), **sizes)

    def contact(self, collision: Element, made: DrakeNumbers) -> None:
        properties = self.add(collision, "drake:proximity_properties")
        for name, value in drake_elements(made).items():
            said = {"value": n(value)} if self.target == "urdf" else {"text": n(value)}
            self.add(properties, f"drake:{name}", **said)

    def text(self, said: list[str]) -> str:
        """The file, headed by a comment."""
        etree.indent(self.root)
        return f'<?xml version="1.0"?>\n{comment(said)}\n{etree.tostring(self.root, encoding="unicode")}\n'


def _body(tree: _Tree, link: Element, solid: ExportedBody, of: int) -> None:
    """Inertia, what is seen, and what touches."""
    I = solid.inertia
    inertial = tree.add(link, "inertial")
    tree.pose(inertial, solid.centre)
    mass = {"value": n(solid.mass)} if tree.target == "urdf" else {"text": n(solid.mass)}
    tree.add(inertial, "mass", **mass)
    names = ("xx", "yy", "zz", "xy", "xz", "yz")
    tensor = {f"i{name}": n(I["xyz".index(name[0]), "xyz".index(name[1])]) for name in names}
    tree.values(tree.add(inertial, "inertia"), **tensor)
    if solid.box:
        (x, z), (a, b) = solid.box
        seen = tree.add(link, "visual", name="prism")
        tree.pose(seen, np.array([x, 0.0, z]))
        tree.shape(seen, "box", size=n(2.0 * a, solid.depth, 2.0 * b))
    elif isinstance(solid.shape, Disk) and tree.target == "urdf":
        seen = tree.add(link, "visual", name="disk")
        tree.pose(seen, np.zeros(3), _ALONG_Y)
        tree.shape(seen, "cylinder", radius=n(solid.shape.radius), length=n(solid.depth))
    for name, place, turn, kind, sizes in _collisions(solid, tree.target):
        collision = tree.add(link, "collision", name=name)
        tree.pose(collision, place, turn)
        tree.shape(collision, kind, **sizes)
        tree.contact(collision, numbers(solid, of))


_ALONG_Y = f"{n(0.5 * np.pi)} 0 0"  # turns the axis of a cylinder


def _collisions(solid: ExportedBody, target: str) -> list[tuple[str, np.ndarray, str, str, dict[str, str]]]:
    """Name, place (3,) in m, turn, kind and sizes of each collision geometry."""
    shape, half = solid.shape, 0.5 * solid.depth
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        if target == "urdf":
            return [("body", np.zeros(3), "0 0 0", "drake:ellipsoid", {"a": n(a), "b": n(half), "c": n(b)})]
        return [("body", np.zeros(3), "0 0 0", "ellipsoid", {"radii": n(a, half, b)})]
    if isinstance(shape, Disk):
        sizes = {"radius": n(shape.radius)}
        if target == "urdf":  # against a box, Drake iterates for the contact of a cylinder and does not get on
            return [("body", np.zeros(3), "0 0 0", "sphere", sizes)]
        return [("body", np.zeros(3), _ALONG_Y, "cylinder", sizes | {"length": n(solid.depth)})]
    rho = solid.corner_radius or SHARP
    centres = rounded_centres(shape.corners, rho)
    places = [np.array([x, y, z]) for x, z in centres for y in (rho - half, half - rho)]
    return [(f"corner{i}", place, "0 0 0", "sphere", {"radius": n(rho)}) for i, place in enumerate(places)]


def drake_elements(made: DrakeNumbers) -> dict[str, float]:
    """Drake's elements of contact with their values."""
    return {
        "mu_static": made.friction,
        "mu_dynamic": made.friction,
        "hunt_crossley_dissipation": made.dissipation,
        "point_contact_stiffness": made.stiffness,
    }
