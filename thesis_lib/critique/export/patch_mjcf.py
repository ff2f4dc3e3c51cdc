"""Patch a body of an MJCF file: `<inertial>`, and friction, solref, solimp of its geoms and of pairs with them.

Geoms get `priority`, so that MuJoCo takes their friction and solref in a contact, and does not mix in the surface's.
Classes and files that the model includes are not looked into: what is written stands in the elements themselves.
"""

import numpy as np

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.critique.export import mjcf
from thesis_lib.critique.export.patch import Plane, Report, inertia_factor, moved, named, not_patched
from thesis_lib.critique.export.solid import Solid
from thesis_lib.critique.export.text import n
from thesis_lib.critique.export.xml_edit import Edits, Element
from thesis_lib.engines.parameters import MujocoNumbers
from thesis_lib.foundation.errors import UserError

COARSEST = 20  # steps in one contact time
TURNED = ("axisangle", "euler", "xyaxes", "zaxis")
_DIAGONAL = ((0, 0), (1, 1), (2, 2))
_FULL = (*_DIAGONAL, (0, 1), (0, 2), (1, 2))


def mass_in(edits: Edits, name: str) -> float | None:
    """The mass of a body in kg; None without `<inertial>`."""
    inertial = _body(edits, name).find("inertial")
    numbers = edits.numbers(inertial, "mass") if inertial else None
    return numbers[0] if numbers else None


def patch(edits: Edits, name: str, solid: Solid, plane: Plane, points: int | None = None) -> Report:
    """Make the edits; `points` in which the body touches, None: by its geoms."""
    body, report = _body(edits, name), Report()
    _inertial(edits, body, solid, plane, report)
    geoms = [geom for geom in body.all("geom") if not _unseen(geom)]
    if not geoms:
        raise UserError(f"{edits.path}: the body {name!r} has no geom that touches anything; name the body that has.")
    of = points or points_of(edits, geoms, solid, plane)
    made = mjcf.numbers(solid, of)
    for geom in geoms:
        _contact(edits, geom, made, report)
    names = {geom.attributes["name"] for geom in geoms if "name" in geom.attributes}
    for pair in (one for contact in edits.root.all("contact") for one in contact.all("pair")):
        if names & {pair.attributes.get("geom1"), pair.attributes.get("geom2")}:
            _pair(edits, pair, made, report)
    report.left += _options(edits, solid, made)
    report.left += not_patched(solid)
    return report


def points_of(edits: Edits, geoms: list[Element], solid: Solid, plane: Plane) -> int:
    """Points that share the load: both ends of an edge, or geoms that stand behind each other across the plane."""
    if isinstance(solid.shape, Ellipse) and len(geoms) == 1:
        return 1
    if all(geom.attributes.get("type", "sphere") in ("sphere", "ellipsoid") for geom in geoms):
        places = [edits.numbers(geom, "pos") or [0.0, 0.0, 0.0] for geom in geoms]
        flat = [tuple(np.round([place[i] for i in plane.indices], 9)) for place in places]
        return max(flat.count(one) for one in flat)
    return 2


def _body(edits: Edits, name: str) -> Element:
    if edits.root.tag != "mujoco":
        raise UserError(f"{edits.path} is no MJCF file: it begins with <{edits.root.tag}>, not <mujoco>.")
    bodies = [one for world in edits.root.all("worldbody") for one in world.walk() if one.tag == "body"]
    try:
        return named(edits, bodies, name, "body")
    except UserError as error:
        if any(one.tag == "include" for one in edits.root.walk()):
            raise UserError(f"{error} It includes other files; give the one with the body.") from error
        raise


def _unseen(geom: Element) -> bool:
    return geom.attributes.get("contype") == "0" and geom.attributes.get("conaffinity") == "0"


def _inertial(edits: Edits, body: Element, solid: Solid, plane: Plane, report: Report) -> None:
    inertial = body.find("inertial")
    compiler = [one for one in edits.root.all("compiler") if one.attributes.get("inertiafromgeom") == "true"]
    if compiler:
        raise UserError(
            f'{edits.path}, line {compiler[0].line}: inertiafromgeom="true" makes MuJoCo ignore <inertial>; remove it.'
        )
    if inertial is None:
        if not solid.mass_known:
            raise UserError(f"{edits.path}: the body has no <inertial>, so its mass is not known here; give --mass.")
        I = plane.turned(solid.inertia)
        place = np.zeros(3)
        place[plane.indices] = solid.com
        tensor = n(*(I[i, j] for i, j in _FULL))
        edits.add_child(body, [f'<inertial pos="{n(place)}" mass="{n(solid.mass)}" fullinertia="{tensor}"/>'])
        report.changed.append(f"inertial: none -> mass {n(solid.mass)}, pos {n(place)}, fullinertia {tensor}")
        return
    where = f"{edits.path}, line {inertial.line}: <inertial>"
    mass = _count(edits, inertial, "mass", 1)
    if solid.mass_known and mass != [solid.mass]:
        edits.set_attribute(inertial, "mass", n(solid.mass))
        report.change("mass", mass, [solid.mass])
    position = _count(edits, inertial, "pos", 3)
    if (place := moved(position, solid, plane, report)) is not None:
        edits.set_attribute(inertial, "pos", n(*place))
        report.change("centre of mass", position, place)
    if turned := [attribute for attribute in TURNED if attribute in inertial.attributes]:
        raise UserError(f"{where} has {turned[0]}; write its inertia as fullinertia in the axes of the body.")
    full, quat = edits.numbers(inertial, "fullinertia"), edits.numbers(inertial, "quat")
    old = full or edits.numbers(inertial, "diaginertia")
    entries = _FULL if full else _DIAGONAL
    if old is None or len(old) != len(entries):
        raise UserError(f"{where} has neither three numbers of diaginertia nor six of fullinertia.")
    tensor = np.zeros((3, 3))
    for (i, j), value in zip(entries, old):
        tensor[i, j] = tensor[j, i] = value
    if quat:
        R = _rotation(quat, where)
        tensor = R @ tensor @ R.T
    factor = inertia_factor(tensor, solid, plane, where)
    # principal axes stay, and with them a quat: all moments have the same factor
    edits.set_attribute(inertial, "fullinertia" if full else "diaginertia", n(*(factor * value for value in old)))
    report.change("inertia", old, [factor * value for value in old])


def _contact(edits: Edits, geom: Element, made: MujocoNumbers, report: Report) -> None:
    which = f"geom {geom.attributes.get('name', f'in line {geom.line}')}"
    old = edits.numbers(geom, "friction")
    friction = [made.friction, *(old or [])[1:]]
    edits.set_attribute(geom, "friction", n(*friction))
    report.change(f"{which}: friction", old, friction)
    for attribute, values in (("solref", made.solref), ("solimp", made.solimp)):
        report.change(f"{which}: {attribute}", edits.numbers(geom, attribute), values)
        edits.set_attribute(geom, attribute, n(*values))
    if not (edits.numbers(geom, "priority") or [0.0])[0] > 0.0:
        edits.set_attribute(geom, "priority", "1")
        report.changed.append(f"{which}: priority: {geom.attributes.get('priority', 'none')} -> 1")
    if geom.attributes.get("condim") == "1":
        edits.set_attribute(geom, "condim", "3")
        report.changed.append(f"{which}: condim: 1 -> 3")


def _pair(edits: Edits, pair: Element, made: MujocoNumbers, report: Report) -> None:
    which = f"pair in line {pair.line}"
    old = edits.numbers(pair, "friction")
    friction = [made.friction, made.friction, *(old or [])[2:]]
    for attribute, values in (("friction", friction), ("solref", made.solref), ("solimp", made.solimp)):
        report.change(f"{which}: {attribute}", edits.numbers(pair, attribute), values)
        edits.set_attribute(pair, attribute, n(*values))


def _options(edits: Edits, solid: Solid, made: MujocoNumbers) -> list[str]:
    """Options of the whole file that the fitted contact needs, and that it does not have."""
    options = {name: value for one in edits.root.all("option") for name, value in one.attributes.items()}
    coarsest, asked = solid.contact_time / COARSEST, []
    try:
        step, ratio = float(options.get("timestep", "0.002")), float(options.get("impratio", "1"))
    except ValueError as error:
        raise UserError(f"{edits.path}: timestep or impratio in <option> is no number.") from error
    if step > coarsest:
        asked.append(f"option timestep {n(step)}: a contact of {n(solid.contact_time)} s needs {n(coarsest)} or less")
    if options.get("cone", "pyramidal") != "elliptic":
        asked.append('option cone: friction is Coulomb\'s along the surface with cone="elliptic" only')
    if abs(ratio - made.impratio) > 1e-6 * made.impratio:
        asked.append(f'option impratio {n(ratio)}: the contact was made for impratio="{n(made.impratio)}"')
    return asked


def _count(edits: Edits, element: Element, attribute: str, count: int) -> list[float]:
    values = edits.numbers(element, attribute)
    if values is None or len(values) != count:
        raise UserError(f"{edits.path}, line {element.line}: <{element.tag}> needs {count} number(s) in {attribute}.")
    return values


def _rotation(quat: list[float], where: str) -> np.ndarray:
    size = float(np.linalg.norm(quat))
    if len(quat) != 4 or not size > 0.0:
        raise UserError(f"{where}: quat must be four numbers, not all 0.")
    w, x, y, z = np.array(quat) / size
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
