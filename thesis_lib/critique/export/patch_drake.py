"""Patch a link of an SDF or URDF file: `<inertial>`, and Drake's contact elements of its collisions.

Drake mixes friction, stiffness and dissipation of the two bodies in a contact.  The numbers are those that both must
have, so the surface's link can be patched with it; only its contact changes then.
"""

import numpy as np

from thesis_lib.critique.export import drake_files
from thesis_lib.critique.export.patch import Plane, Report, inertia_factor, moved, named, not_patched
from thesis_lib.critique.export.solid import Solid
from thesis_lib.critique.export.text import n
from thesis_lib.critique.export.xml_edit import Edits, Element
from thesis_lib.foundation.errors import UserError

ROOTS = {"sdf": "sdf", "urdf": "robot"}
NAMESPACE = {"sdf": "drake.mit.edu", "urdf": "http://drake.mit.edu"}
PROPERTIES = "drake:proximity_properties"
_ENTRIES = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}


def mass_in(edits: Edits, name: str, target: str) -> float | None:
    """The mass of a link in kg; None without one."""
    mass = _link(edits, name, target).find("inertial", "mass")
    values = edits.numbers(mass, _attribute(target)) if mass else None
    return values[0] if values else None


def patch(
    edits: Edits, name: str, solid: Solid, plane: Plane, target: str, points: int | None = None, surface: str = ""
) -> Report:
    """Make the edits in a file of the format `target`; `points` as in `patch_mjcf`, `surface`: a link with the same."""
    link, report = _link(edits, name, target), Report()
    _inertial(edits, link, solid, plane, target, report)
    collisions = link.all("collision")
    if not collisions:
        raise UserError(f"{edits.path}: the link {name!r} has no collision; name the link that touches.")
    made = drake_files.numbers(solid, points or _points(edits, collisions, plane, target))
    others = _link(edits, surface, target).all("collision") if surface else []
    if surface and not others:
        raise UserError(f"{edits.path}: the surface's link {surface!r} has no collision.")
    for collision in (*collisions, *others):
        _contact(edits, collision, drake_files.drake_elements(made), target, report)
    if "xmlns:drake" not in edits.root.attributes:
        edits.set_attribute(edits.root, "xmlns:drake", NAMESPACE[target])
        report.changed.append(f"{edits.root.tag}: xmlns:drake: none -> {NAMESPACE[target]}")
    if not surface:
        report.left.append(
            "contact of the surface: Drake mixes both bodies' numbers; name its link (--surface), or give it the same"
        )
    report.left += not_patched(solid)
    return report


def _attribute(target: str) -> str:
    """Where numbers stand: in attributes of URDF, in the text of SDF."""
    return "value" if target == "urdf" else ""


def _link(edits: Edits, name: str, target: str) -> Element:
    if edits.root.tag != ROOTS[target]:
        raise UserError(f"{edits.path} is no {target.upper()} file: it begins with <{edits.root.tag}>.")
    return named(edits, [one for one in edits.root.walk() if one.tag == "link"], name, "link")


def _inertial(edits: Edits, link: Element, solid: Solid, plane: Plane, target: str, report: Report) -> None:
    inertial, mass, inertia = (link.find("inertial", *tag) for tag in ((), ("mass",), ("inertia",)))
    where = f"{edits.path}, line {link.line}: the link"
    if inertial is None or mass is None or inertia is None:
        raise UserError(f"{where} has no <inertial> with <mass> and <inertia>; add them, then patch.")
    values = edits.numbers(mass, _attribute(target))
    if not values:
        raise UserError(f"{where} has an empty <mass>.")
    if solid.mass_known and values != [solid.mass]:
        _set(edits, mass, n(solid.mass), target)
        report.change("mass", values, [solid.mass])
    place, turn = _pose(edits, inertial, target)
    if (new := moved(place, solid, plane, report)) is not None:
        _set_pose(edits, inertial, new, turn, target)
        report.change("centre of mass", place, new)
    tensor, found = np.zeros((3, 3)), {}
    for name, (i, j) in _ENTRIES.items():
        if target == "urdf":
            entry = edits.numbers(inertia, name)
        else:
            element = inertia.find(name)
            entry = edits.numbers(element) if element else None
        if entry:
            tensor[i, j] = tensor[j, i] = found[name] = entry[0]
        elif i == j:
            raise UserError(f"{where} has no {name} in its <inertia>.")
    R = _rotation(turn)
    factor = inertia_factor(R @ tensor @ R.T, solid, plane, where)
    for name, value in found.items():
        if target == "urdf":
            edits.set_attribute(inertia, name, n(factor * value))
        elif (element := inertia.find(name)) is not None:
            edits.set_text(element, n(factor * value))
    report.change(f"inertia ({', '.join(found)})", found.values(), [factor * value for value in found.values()])


def _contact(edits: Edits, collision: Element, elements: dict[str, float], target: str, report: Report) -> None:
    which = f"collision {collision.attributes.get('name', f'in line {collision.line}')}"
    properties = collision.find(PROPERTIES)

    def line(name: str, value: float) -> str:
        tag = f"drake:{name}"
        return f'<{tag} value="{n(value)}"/>' if target == "urdf" else f"<{tag}>{n(value)}</{tag}>"

    missing = []
    for name, value in elements.items():
        old = properties.find(f"drake:{name}") if properties else None
        if old is None:
            missing.append(line(name, value))
            report.change(f"{which}: {name}", None, [value])
        else:
            report.change(f"{which}: {name}", edits.numbers(old, _attribute(target)), [value])
            _set(edits, old, n(value), target)
    if properties is None:
        edits.add_child(collision, [f"<{PROPERTIES}>", *(f"  {one}" for one in missing), f"</{PROPERTIES}>"])
    elif missing:
        edits.add_child(properties, missing)
    # what other readers take for friction
    ode = collision.find("surface", "friction", "ode")
    for name in ("mu", "mu2"):
        if ode and (old := ode.find(name)) is not None:
            report.change(f"{which}: ode {name}", edits.numbers(old), [elements["mu_dynamic"]])
            edits.set_text(old, n(elements["mu_dynamic"]))


def _points(edits: Edits, collisions: list[Element], plane: Plane, target: str) -> int:
    """Each collision touches in one point; those behind each other across the plane share the load."""
    places = [_pose(edits, collision, target)[0] for collision in collisions]
    flat = [tuple(np.round([place[i] for i in plane.indices], 9)) for place in places]
    return max(flat.count(one) for one in flat)


def _set(edits: Edits, element: Element, value: str, target: str) -> None:
    if target == "urdf":
        edits.set_attribute(element, "value", value)
    else:
        edits.set_text(element, value)


def _pose(edits: Edits, element: Element, target: str) -> tuple[list[float], list[float]]:
    """Place in m, and roll, pitch, yaw in rad, of what has `<pose>` or `<origin>`."""
    if target == "urdf":
        origin = element.find("origin")
        place = (edits.numbers(origin, "xyz") if origin else None) or [0.0] * 3
        turn = (edits.numbers(origin, "rpy") if origin else None) or [0.0] * 3
    else:
        pose = element.find("pose")
        if pose and {"relative_to", "degrees", "rotation_format"} & set(pose.attributes):
            raise UserError(f"{edits.path}, line {pose.line}: write this <pose> as x y z roll pitch yaw, without more.")
        numbers = (edits.numbers(pose) if pose else None) or [0.0] * 6
        place, turn = numbers[:3], numbers[3:]
    if len(place) != 3 or len(turn) != 3:
        raise UserError(
            f"{edits.path}, line {element.line}: the pose of <{element.tag}> needs three and three numbers."
        )
    return place, turn


def _set_pose(edits: Edits, inertial: Element, place: list[float], turn: list[float], target: str) -> None:
    if target == "urdf":
        origin = inertial.find("origin")
        if origin is None:
            edits.add_child(inertial, [f'<origin xyz="{n(*place)}" rpy="0 0 0"/>'])
        else:
            edits.set_attribute(origin, "xyz", n(*place))
        return
    pose = inertial.find("pose")
    if pose is None:
        edits.add_child(inertial, [f"<pose>{n(*place, *turn)}</pose>"])
    else:
        edits.set_text(pose, n(*place, *turn))


def _rotation(turn: list[float]) -> np.ndarray:
    """R (3, 3) of roll, pitch, yaw in rad about fixed axes."""
    (a, b, c), R = turn, np.eye(3)
    for angle, (i, j) in ((a, (1, 2)), (b, (2, 0)), (c, (0, 1))):
        step = np.eye(3)
        step[i, i] = step[j, j] = np.cos(angle)
        step[i, j], step[j, i] = -np.sin(angle), np.sin(angle)
        R = step @ R
    return R
