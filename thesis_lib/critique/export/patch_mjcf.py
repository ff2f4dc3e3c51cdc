"""Patch a body of an MJCF file: `<inertial>`, and friction, solref, solimp of its geoms and of pairs with them.

Geoms get a `priority` above that of all others, so MuJoCo uses their friction and solref in a contact, without
averaging with the surface.  Classes and included files are not read: all numbers are written into the elements
themselves.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.critique.export import mjcf
from thesis_lib.critique.export.patch import Element, Patch, not_patched
from thesis_lib.critique.export.solid import ExportedBody, n
from thesis_lib.engines.parameters import MujocoNumbers
from thesis_lib.foundation.errors import UserError

COARSEST = 20  # steps in one contact time
LEVEL = 1e-9  # of the largest moment: smaller products of inertia are rounding
TURNED = ("axisangle", "euler", "xyaxes", "zaxis")
CHANGES = {  # what MuJoCo does to mass and inertia after it has read them, by attribute of <compiler>
    "settotalmass": "MuJoCo scales mass and inertia to this total",
    "boundmass": "MuJoCo replaces a smaller mass",
    "boundinertia": "MuJoCo replaces smaller moments of inertia",
}
_DIAGONAL = ((0, 0), (1, 1), (2, 2))
_FULL = (*_DIAGONAL, (0, 1), (0, 2), (1, 2))


def mass_in(file: Patch, name: str) -> float | None:
    """Return the mass of a body in kg; None without `<inertial>`."""
    values = file.numbers(_body(file, name).find("inertial"), "mass")
    return values[0] if values else None


def patch(file: Patch, name: str, solid: ExportedBody, points: int | None = None) -> None:
    """Edit the file; `points`: number of points in which the body touches; None: by its geoms."""
    body = _body(file, name)
    _inertial(file, body, solid)
    geoms = [geom for geom in _geoms(body) if not geom.get("contype") == geom.get("conaffinity") == "0"]
    if not geoms:
        raise UserError(f"{file.path}: the body {name!r} has no geom that can touch; {_instead(body)}.")
    made = mjcf.numbers(solid, points or points_of(file, geoms, solid))
    priority = 1.0 + max([0.0, *(_priority(file, geom) for geom in file.root.iter("geom") if geom not in geoms)])
    for geom in geoms:
        _contact(file, geom, made, solid.twist, priority)
    names = {geom.get("name") for geom in geoms} - {None}
    for pair in file.root.findall("contact/pair"):
        if names & {pair.get("geom1"), pair.get("geom2")}:
            _numbers(file, f"pair in line {pair.sourceline}", pair, made, solid.twist, slides=2)
    file.left += _options(file, solid, made)
    file.left += _added(file, body)
    file.left += not_patched(solid)


def _geoms(body: Element) -> list[Element]:
    """Return the geoms of a body, also those within `<frame>`, in order."""
    return [geom for geom in body.iter("geom") if next(geom.iterancestors("body", "replicate"), None) is body]


def _instead(body: Element) -> str:
    for tag, what in (("include", "included files are not read"), ("replicate", "geoms within it are not patched")):
        if body.find(f".//{tag}") is not None:
            return f"<{tag}>: {what}; write its geoms into the body"
    return "name the body with such a geom"


def _fixed(body: Element) -> Iterator[Element]:
    """Yield the bodies that move with a body because they have no joint."""
    for child in body.iterchildren("body", "frame"):
        if child.tag == "frame":
            yield from _fixed(child)
        elif child.find("joint") is None and child.find("freejoint") is None:
            yield child
            yield from _fixed(child)


def _added(file: Patch, body: Element) -> list[str]:
    """Return what else makes the mass and inertia of the body, or changes them."""
    said = [
        f"compiler {name} {compiler.get(name)}: {what}"
        for compiler in file.root.findall("compiler")
        for name, what in CHANGES.items()
        if (file.numbers(compiler, name) or [0.0])[0] > 0.0
    ]
    for child in _fixed(body):
        which = f"body {child.get('name', f'in line {child.sourceline}')}"
        said.append(f"{which}: has no joint, so its mass and inertia add to those of this body; its geoms stay")
    return said


def points_of(file: Patch, geoms: list[Element], solid: ExportedBody) -> int:
    """Return how many points share the load: the two ends of an edge, or geoms one behind another across the plane."""
    if solid.points == 1 and (file.plane.across is None or len(geoms) == 1):
        return 1
    own = len({geom.getparent() for geom in geoms}) == 1  # within a <frame> the places are others
    if own and all(geom.get("type", "sphere") in ("sphere", "ellipsoid") for geom in geoms):
        return file.sharing(file.numbers(geom, "pos") or [0.0, 0.0, 0.0] for geom in geoms)
    return 2


def _body(file: Patch, name: str) -> Element:
    if file.root.tag != "mujoco":
        raise UserError(f"{file.path} is not an MJCF file: it begins with <{file.root.tag}>, not <mujoco>.")
    try:
        return file.named(file.root.iterfind("worldbody//body"), name, "body")
    except UserError as error:
        if file.root.find(".//include") is not None:
            raise UserError(f"{error} It includes other files; name the file that contains the body.") from error
        raise


def _inertial(file: Patch, body: Element, solid: ExportedBody) -> None:
    if (compiler := file.root.find("compiler[@inertiafromgeom='true']")) is not None:
        raise UserError(f'{file.where(compiler)}: inertiafromgeom="true" makes MuJoCo ignore <inertial>; remove it.')
    inertial = body.find("inertial")
    if inertial is None:
        if not solid.mass_known:
            raise UserError(f"{file.path}: the body has no <inertial>, so its mass is not known; give --mass.")
        I, place = file.plane.turned(solid.inertia), file.plane.turned(solid.centre)
        inertial = file.insert(body, "inertial")
        file.write("centre of mass", list(place), inertial, "pos")
        file.write("mass", [solid.mass], inertial, "mass")
        file.write("inertia", [I[i, j] for i, j in _FULL], inertial, "fullinertia")
        return
    mass, position = file.numbers(inertial, "mass", 1), file.numbers(inertial, "pos", 3)
    if solid.mass_known and mass != [solid.mass]:
        file.write("mass", [solid.mass], inertial, "mass")
    if (place := file.moved(position, solid)) != position:
        file.write("centre of mass", place, inertial, "pos")
    where = f"{file.where(inertial)}: <inertial>"
    if turned := [attribute for attribute in TURNED if attribute in inertial.attrib]:
        raise UserError(f"{where} has {turned[0]}; write the inertia as fullinertia in the axes of the body.")
    attribute, entries = ("fullinertia", _FULL) if "fullinertia" in inertial.attrib else ("diaginertia", _DIAGONAL)
    old = file.numbers(inertial, attribute)
    if len(old) != len(entries):
        raise UserError(f"{where} needs three numbers in diaginertia or six in fullinertia.")
    tensor = np.zeros((3, 3))
    for (i, j), value in zip(entries, old):
        tensor[i, j] = tensor[j, i] = value
    R = np.eye(3)
    if quat := file.numbers(inertial, "quat"):
        if len(quat) != 4 or not any(quat):
            raise UserError(f"{where}: quat must be four numbers, not all 0.")
        R = Rotation.from_quat(quat, scalar_first=True).as_matrix()
    new = file.inertia(tensor, R, solid, where)
    if entries == _DIAGONAL and np.abs(new - np.diag(np.diag(new))).max() > LEVEL * new.max():
        new, entries = R @ new @ R.T, _FULL
        for name in (attribute, *["quat"] * bool(quat)):
            file.remove(inertial, name)
        attribute = "fullinertia"
    file.write("inertia", [new[i, j] for i, j in entries], inertial, attribute)


def _contact(file: Patch, geom: Element, made: MujocoNumbers, twist: float, priority: float) -> None:
    which = f"geom {geom.get('name', f'in line {geom.sourceline}')}"
    _numbers(file, which, geom, made, twist, slides=1)
    if _priority(file, geom) < priority:
        file.write(f"{which}: priority", [priority], geom, "priority")


def _priority(file: Patch, geom: Element) -> float:
    return (file.numbers(geom, "priority") or [0.0])[0]


def _numbers(file: Patch, which: str, element: Element, made: MujocoNumbers, twist: float, slides: int) -> None:
    """Write the contact of a geom or a pair; its friction begins with `slides` coefficients along the surface,
    followed by the coefficient about the normal."""
    rest = file.numbers(element, "friction")[slides:]
    friction = [made.friction] * slides + ([twist, *rest[1:]] if twist else rest)
    for attribute, values in (("friction", friction), ("solref", made.solref), ("solimp", made.solimp)):
        file.write(f"{which}: {attribute}", values, element, attribute)
    default = "1" if file.root.find(f"default//{element.tag}[@condim='1']") is not None else "3"  # of any class
    if element.get("condim", default) in (("1", "3") if twist else ("1",)):
        file.write(f"{which}: condim", [4.0 if twist else 3.0], element, "condim")


def _options(file: Patch, solid: ExportedBody, made: MujocoNumbers) -> list[str]:
    """Return the options that the fitted contact needs and that the file does not have."""
    options = {name: value for one in file.root.findall("option") for name, value in one.attrib.items()}
    coarsest, asked = solid.contact_time / COARSEST, []
    try:
        step, ratio = float(options.get("timestep", "0.002")), float(options.get("impratio", "1"))
    except ValueError as error:
        raise UserError(f"{file.path}: timestep and impratio in <option> must be numbers.") from error
    if step > coarsest:
        asked.append(f"option timestep {n(step)}: a contact of {n(solid.contact_time)} s needs {n(coarsest)} or less")
    if (has := options.get("cone", "pyramidal")) != (wanted := mjcf.cone(solid)):
        asked.append(f'option cone {has}: friction is as in the model only with cone="{wanted}"')
    if abs(ratio - made.impratio) > 1e-6 * made.impratio:
        asked.append(f'option impratio {n(ratio)}: the contact was computed for impratio="{n(made.impratio)}"')
    return asked
