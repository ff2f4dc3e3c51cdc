"""Patch a body of an MJCF file: `<inertial>`, and friction, solref, solimp of its geoms and of pairs with them.

Geoms get `priority`, so MuJoCo uses their friction and solref in a contact, without averaging with the surface.
Classes and included files are not read: all numbers are written into the elements themselves.
"""

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
    geoms = [geom for geom in body.findall("geom") if not geom.get("contype") == geom.get("conaffinity") == "0"]
    if not geoms:
        raise UserError(f"{file.path}: the body {name!r} has no geom that can touch; name the body with such a geom.")
    made = mjcf.numbers(solid, points or points_of(file, geoms, solid))
    for geom in geoms:
        _contact(file, geom, made, solid.twist)
    names = {geom.get("name") for geom in geoms} - {None}
    for pair in file.root.findall("contact/pair"):
        if names & {pair.get("geom1"), pair.get("geom2")}:
            _numbers(file, f"pair in line {pair.sourceline}", pair, made, solid.twist, slides=2)
    file.left += _options(file, solid, made)
    file.left += not_patched(solid)


def points_of(file: Patch, geoms: list[Element], solid: ExportedBody) -> int:
    """Return how many points share the load: the two ends of an edge, or geoms one behind another across the plane."""
    if solid.points == 1 and (file.plane.across is None or len(geoms) == 1):
        return 1
    if all(geom.get("type", "sphere") in ("sphere", "ellipsoid") for geom in geoms):
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


def _contact(file: Patch, geom: Element, made: MujocoNumbers, twist: float) -> None:
    which = f"geom {geom.get('name', f'in line {geom.sourceline}')}"
    _numbers(file, which, geom, made, twist, slides=1)
    if not (file.numbers(geom, "priority") or [0.0])[0] > 0.0:
        file.write(f"{which}: priority", [1.0], geom, "priority")


def _numbers(file: Patch, which: str, element: Element, made: MujocoNumbers, twist: float, slides: int) -> None:
    """Write the contact of a geom or a pair; its friction begins with `slides` coefficients along the surface,
    followed by the coefficient about the normal."""
    rest = file.numbers(element, "friction")[slides:]
    friction = [made.friction] * slides + ([twist, *rest[1:]] if twist else rest)
    for attribute, values in (("friction", friction), ("solref", made.solref), ("solimp", made.solimp)):
        file.write(f"{which}: {attribute}", values, element, attribute)
    if element.get("condim", "3") in (("1", "3") if twist else ("1",)):
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
