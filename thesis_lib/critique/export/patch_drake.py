"""Patch a link of an SDF or URDF file: `<inertial>`, and Drake's contact elements of its collisions.

Drake combines friction, stiffness and dissipation of the two bodies in a contact.  The numbers written are for both
bodies, so the link of the surface can be patched as well; only its contact elements change.

Numbers are attributes in URDF and element texts in SDF.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.critique.export import drake_files
from thesis_lib.critique.export.drake_files import ENTRIES, NAMESPACE, ROOTS
from thesis_lib.critique.export.patch import Element, Patch, not_patched
from thesis_lib.critique.export.solid import ExportedBody
from thesis_lib.foundation.errors import UserError

LEVEL = 1e-9  # of the largest moment: smaller products of inertia are rounding


def mass_in(file: Patch, name: str, target: str) -> float | None:
    """Return the mass of a link in kg; None if the link has no mass."""
    values = file.numbers(_link(file, name, target).find("inertial/mass"), _value(target))
    return values[0] if values else None


def patch(
    file: Patch, name: str, solid: ExportedBody, target: str, points: int | None = None, surface: str = ""
) -> None:
    """Edit a file of the format `target`; `points` as in `patch_mjcf`, `surface`: a link that gets the same contact."""
    link = _link(file, name, target)
    _inertial(file, link, solid, target)
    collisions = link.findall("collision")
    if not collisions:
        raise UserError(f"{file.path}: the link {name!r} has no collision; name the link that touches the surface.")
    if "drake" not in file.root.nsmap:
        file.declare("drake", NAMESPACE[target])
    # each collision touches in one point
    places = [_pose(file, one, target)[0] for one in collisions]
    made = drake_files.numbers(solid, points or (1 if file.plane.across is None else file.sharing(places)))
    touched = [link, *([_link(file, surface, target)] if surface else [])]
    others = [collision for one in touched[1:] for collision in one.findall("collision")]
    if surface and not others:
        raise UserError(f"{file.path}: the link of the surface, {surface!r}, has no collision.")
    for collision in (*collisions, *others):
        _contact(file, collision, drake_files.drake_elements(made), target)
    if not surface:
        file.left.append(
            "contact of the surface: Drake combines the numbers of both; name its link (--surface), or give it the same"
        )
    file.left += [said for one in touched for said in _of_others(file, one)]
    for other in _fixed(file, link, target):
        file.left.append(
            f"link {other}: fixed to this one, so its mass and inertia add to those here; it stays as it is"
        )
    file.left += not_patched(solid)


def _fixed(file: Patch, link: Element, target: str) -> list[str]:
    """Return the names of the links that fixed joints connect with a link, also through each other."""
    pairs = []
    for joint in file.root.iter("joint"):
        ends = [one for tag in ("parent", "child") if (one := joint.find(tag)) is not None]
        names = [(end.get("link") if target == "urdf" else end.text) or "" for end in ends]
        if joint.get("type") == "fixed" and len(names) == 2:
            pairs.append({_scoped(joint, one.strip()) for one in names if one.strip() != "world"})
    found = [_scoped(link, link.get("name", ""))]
    for one in found:
        found += sorted({other for pair in pairs if one in pair for other in pair} - {*found})
    return [other.removeprefix(_scoped(link, "")) for other in found[1:]]


def _scoped(element: Element, name: str) -> str:
    """Return a name in the scope of an element, with the models that contain it: robot::arm::name."""
    return "::".join([*reversed([one.get("name", "") for one in element.iterancestors("model")]), name])


def _of_others(file: Patch, link: Element) -> list[str]:
    """Return lines on contact parameters of a link that only other simulators read."""
    name = link.get("name", "")
    found = [one for one in file.root.findall("gazebo") if one.get("reference") == name and len(one)]
    found += link.findall("contact")
    for surface in link.findall("collision/surface"):
        found += [one for one in surface.findall("friction/*") if one.tag != "ode"]
        found += [one for one in surface if one.tag in ("bounce", "contact")]
    return [
        f"<{one.tag}> in line {one.sourceline}: Drake does not read it; it stays as it is, for simulators that do"
        for one in found
    ]


def _value(target: str) -> str:
    return "value" if target == "urdf" else ""


def _link(file: Patch, name: str, target: str) -> Element:
    if file.root.tag != ROOTS[target]:
        raise UserError(f"{file.path} is not in {target.upper()} format: it begins with <{file.root.tag}>.")
    at = -name.count("::") - 1  # in SDF the models that contain it may precede the name
    full = {link: _scoped(link, link.get("name", "")) for link in file.root.iter("link")}
    same = [one for one in full.values() if "::".join(one.split("::")[at:]) == name]
    if len(set(same)) > 1:
        raise UserError(f"{file.path} has {len(same)} links named {name!r}; name the model, too: {', '.join(same)}.")
    try:
        return file.named(full, name, "link", lambda link: "::".join(full[link].split("::")[at:]))
    except UserError as error:
        if file.root.find(".//include") is not None:
            raise UserError(f"{error} It includes other files; name the file that contains the link.") from error
        raise


def _inertial(file: Patch, link: Element, solid: ExportedBody, target: str) -> None:
    inertial, mass, inertia = (link.find(f"inertial{tag}") for tag in ("", "/mass", "/inertia"))
    where = f"{file.where(link)}: the link"
    if inertial is None or mass is None or inertia is None:
        raise UserError(f"{where} has no <inertial> with <mass> and <inertia>; add these before you patch the file.")
    values = file.numbers(mass, _value(target))
    if not values:
        raise UserError(f"{where} has an empty <mass>.")
    if solid.mass_known and values != [solid.mass]:
        file.write("mass", [solid.mass], mass, _value(target))
    place, turn = _pose(file, inertial, target)
    if (new := file.moved(place, solid)) != place:
        tag, attribute = ("origin", "xyz") if target == "urdf" else ("pose", "")
        pose = inertial.find(tag)
        pose = file.insert(inertial, tag) if pose is None else pose
        file.write("centre of mass", new if attribute else [*new, *turn], pose, attribute)
    tensor = np.zeros((3, 3))
    for name, (i, j) in ENTRIES.items():
        spot = (inertia, name) if target == "urdf" else (inertia.find(name), "")
        if entry := file.numbers(*spot):
            tensor[i, j] = tensor[j, i] = entry[0]
        elif i == j:
            raise UserError(f"{where} has no {name} in its <inertia>.")
    R = Rotation.from_euler("xyz", turn).as_matrix()  # roll, pitch, yaw about fixed axes
    new = file.inertia(tensor, R, solid, where)
    for name, (i, j) in ENTRIES.items():
        value = new[i, j] if abs(new[i, j]) > LEVEL * new.max() else 0.0
        if value or tensor[i, j]:
            spot = (inertia, name) if target == "urdf" else (file.child(inertia, name), "")
            file.write(f"inertia {name}", [value], *spot)


def _contact(file: Patch, collision: Element, elements: dict[str, float], target: str) -> None:
    which = f"collision {collision.get('name', f'in line {collision.sourceline}')}"
    drake = f"{{{collision.nsmap.get('drake', NAMESPACE[target])}}}"
    properties = collision.find(f"{drake}proximity_properties")
    if properties is None:
        properties = file.insert(collision, f"{drake}proximity_properties")
    elif properties.prefix != "drake":
        raise UserError(f"{file.where(properties)}: Drake ignores the prefix {properties.prefix}; rename it to drake.")
    for name, value in elements.items():
        file.write(f"{which}: {name}", [value], file.child(properties, drake + name), _value(target))
    # friction elements of other simulators
    for name in ("mu", "mu2"):
        if (old := collision.find(f"surface/friction/ode/{name}")) is not None:
            file.write(f"{which}: ode {name}", [elements["mu_dynamic"]], old)
    friction = collision.find("surface/friction")
    if friction is not None and friction.find("ode") is None:  # Drake 1.51 aborts without it
        file.child(friction, "ode")
        file.changed.append(f"{which}: <ode/> in its <friction>, without which Drake cannot read the file")


def _pose(file: Patch, element: Element, target: str) -> tuple[list[float], list[float]]:
    """Return position in m, and roll, pitch, yaw in rad, of an element with `<pose>` or `<origin>`."""
    if target == "urdf":
        origin = element.find("origin")
        place, turn = (file.numbers(origin, name) or [0.0] * 3 for name in ("xyz", "rpy"))
    else:
        pose = element.find("pose")
        if pose is not None and {"relative_to", "degrees", "rotation_format"} & set(pose.attrib):
            raise UserError(f"{file.where(pose)}: write this <pose> as x y z roll pitch yaw, without attributes.")
        numbers = file.numbers(pose) or [0.0] * 6
        place, turn = numbers[:3], numbers[3:]
    if len(place) != 3 or len(turn) != 3:
        raise UserError(f"{file.where(element)}: the pose of <{element.tag}> needs x y z and roll pitch yaw.")
    return place, turn
