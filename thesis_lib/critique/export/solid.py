"""The body in space that a planar model stands for: what its file says, where each number is from, what is left out.

The plane of the drops is the x-z plane of the body: planar (x, y) is (x, z), θ turns about −y, and the body is `depth`
deep along y.  Drops show one moment of inertia, m k² about y.  The other two are those of a uniform solid of this shape
and depth, all scaled by one factor so that the moment about y is right; so they always belong to some body.

| on paper | in code          | unit  | shape  |                                                              |
|----------|------------------|-------|--------|--------------------------------------------------------------|
| k        | `k_g`            | m     |        | true radius of gyration about y                              |
| c        | `com`            | m     | (2,)   | true centre of mass in the frame of the body                 |
| I        | `inertia`        | kg m² | (3, 3) | about the centre of mass, in the axes of the body            |
| T        | `contact_time`   | s     |        | of a central contact                                         |
| φ, H     | `tilt`, `height` | rad, m |       | of the surface; its normal is (sin φ, 0, cos φ)              |

Which effect of a model an engine's file can hold, how, and why not the others; and the comments of the file: where each
number comes from, and what the file could not hold.
"""

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon, Shape
from thesis_lib.bodies.solids import Cylinder, Ellipsoid, Hull
from thesis_lib.contact.compliant.compiled import SPEED
from thesis_lib.contact.compliant.normal_force import HuntCrossley
from thesis_lib.critique.contacts.contact_time import CONTACT_TIME, DAMPING_RATIO, IMPEDANCE, duration
from thesis_lib.critique.results.saved_model import SavedModel, SavedParameter
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.terminal import visible
from thesis_lib.statistics.wording import bounded

FORMATS = ("mjcf", "sdf", "urdf")
GEOMETRY = "geometry of the body"
# what every format holds
_EVERYWHERE = {
    "com_offset": "centre of mass of the inertia",
    "wrong_inertia": "inertia",
    "wrong_size": GEOMETRY,
    "rounded_corners": "round collision geometry at the corners",
    "surface_height": "height of the surface",
    "surface_tilt": "tilt of the surface",
    "wrong_gravity": "gravity",
}
_NOT_IN = {("urdf", "wrong_gravity"): "URDF has no gravity: set it where you load the file"}
_DRAG = "no element of the format damps a free body with one number for its way and another for its spin"
_AIR = {
    "mjcf": "MuJoCo's forces of a fluid act on an ellipsoid around the body with five coefficients; not written",
    "sdf": "SDF and Drake have no air",
    "urdf": "URDF and Drake have no air",
}
_RESTITUTION = "the format has one restitution for a pair of bodies, by stiffness and damping"
_FRICTION = "the format has one coefficient of friction for a pair of bodies, at all places and speeds"
_TIME = "the format has one stiffness for a pair of bodies"
_WHY = {
    "adhesion": "contacts of the engine push and never pull",
    "anisotropic_friction": "friction may differ between two axes in the format, not between left and right on one",
    "contact_torque": "rolling friction of the engine takes its couple from the cone of its friction, or is absent",
    "tangential_compliance": "the engine's contact has no spring along the surface",
    "tangential_restitution": "the engine's friction ends slip and returns none",
    "contact_point_offset": "the engine finds the contact point from the geometry",
    "soft_body": "a point contact acts at the surface of one geometry; a soft solid is hydroelastic, not written here",
    "moving_surface": "a velocity is a state, not a property of a model: give the surface its velocity when you run it",
    "linear_drag": _DRAG,
    "wear": "a file says what is, not how it changes from drop to drop",
    **dict.fromkeys(
        ("orientation_dependent_restitution", "position_dependent_restitution", "velocity_dependent_restitution"),
        _RESTITUTION,
    ),
    **dict.fromkeys(("position_dependent_friction", "velocity_dependent_friction"), _FRICTION),
    **dict.fromkeys(
        (*("orientation_dependent_contact_time", "position_dependent_contact_time"), "velocity_dependent_contact_time"),
        _TIME,
    ),
    "surface_patch": "one surface has one friction and one restitution: add a geometry for the patch by hand",
}
_CAMERA = "a fault of the camera, not of body or surface: correct the recorded states before you compare"


def written(name: str, target: str) -> str:
    """Where the file of a format holds an effect; "" if it cannot."""
    if (target, name) == ("sdf", "wrong_gravity"):
        return "gravity of the world, which Drake ignores: set it in the plant"
    return "" if (target, name) in _NOT_IN else _EVERYWHERE.get(name, "")


def reason(name: str, target: str) -> str:
    """Why the file of a format cannot hold an effect."""
    effect = EFFECTS[name]
    if effect.family == "measurement":
        return _CAMERA
    if (target, name) in _NOT_IN:
        return _NOT_IN[target, name]
    if name in ("quadratic_drag", "magnus"):
        return _AIR[target]
    return _WHY.get(name, f"the format has no element for {effect.equation}")


NO_MASS = 1.0  # kg, of a model whose mass nobody gave
NO_TIME = 1e-3  # s, of a contact whose time no trajectory shows
LEAST = 0.01  # ε below which no damper of an engine goes
MOST_DEPTH = 100.0  # m
ALIGNED = 1e-9  # m, how far corners may be from those of a box


@dataclass(frozen=True)
class ExportedBody:
    """A body over its surface; `speed` in m/s is that of ε, None if ε holds at any; `damping_ratio` and `impedance`
    None: not fitted.

    `expressed` and `left_out` say, by name, what the file holds and what it cannot.
    """

    model: SavedModel
    shape: Shape
    depth: float
    mass: float
    mass_known: bool
    k_g: float
    com: np.ndarray
    corner_radius: float
    mu: float
    epsilon: float
    contact_time: float
    time_known: bool
    speed: float | None
    damping_ratio: float | None
    impedance: float | None
    gravity: float
    tilt: float
    height: float
    expressed: tuple[tuple[str, str], ...]
    left_out: tuple[tuple[str, str], ...]

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Centre and half sides (2,) in m of a rectangle along the axes of the body; None for other shapes."""
        if not isinstance(self.shape, Polygon) or len(self.shape.corners) != 4:
            return None
        corners = self.shape.corners
        low, high = corners.min(axis=0), corners.max(axis=0)
        off = np.minimum(np.abs(corners - low), np.abs(corners - high)).max()
        return (0.5 * (low + high), 0.5 * (high - low)) if off < ALIGNED else None

    @property
    def inertia(self) -> np.ndarray:
        """I (3, 3) in kg m² about the centre of mass."""
        uniform = _inertia_per_mass(self.shape, self.depth)
        return self.mass * self.k_g**2 / uniform[1, 1] * uniform

    @property
    def centre(self) -> np.ndarray:
        """The centre of mass (3,) in m."""
        return np.array([self.com[0], 0.0, self.com[1]])

    @property
    def normal(self) -> np.ndarray:
        """The surface's normal (3,)."""
        return np.array([np.sin(self.tilt), 0.0, np.cos(self.tilt)])


def solid(model: SavedModel, target: str, mass: float | None = None, depth: float | None = None) -> ExportedBody:
    """The body of a model for the format `target`.

    Args:
        mass: kg; None: `NO_MASS`, as a model knows only the radius of gyration.
        depth: m along y; None: the longest extent in the plane.

    Raises:
        UserError: mass or depth is not positive, or the contact has no restitution left.
    """
    for name, value, most in (("mass", mass, np.inf), ("depth", depth, MOST_DEPTH)):
        if value is not None and not 0.0 < value < most:
            raise UserError(f"--{name} must be a positive number{'' if most == np.inf else ' in m'}; got {value}.")
    values = model.values

    def of(name: str) -> float:
        return values.get(name, 0.0)

    shape = _grown(model.rig.shape, 1.0 + of("wrong_size.s"))
    longest = 2.0 * _half_width(shape)
    time, speed = _contact_time(model)
    expressed = tuple((name, said) for name in model.effects if (said := written(name, target)))
    left_out = [(name, reason(name, target)) for name in model.effects if not written(name, target)]
    if "stiction_tolerance" in values:
        left_out.append(("stiction_tolerance", "a property of Drake's plant: plant.set_stiction_tolerance(...)"))
    if DAMPING_RATIO.name in values and target != "mjcf":
        left_out.append((DAMPING_RATIO.name, "the friction of a convex program; Drake's is Coulomb's"))
        left_out.append((IMPEDANCE.name, "MuJoCo's alone: Drake's spring and damper do not know the mass behind them"))
    if model.scatter:
        left_out.append(("scatter", f"{model.scatter:g} m/s after impact that no effect explains"))
    return ExportedBody(
        model=model,
        shape=shape,
        depth=depth or longest,
        mass=mass or NO_MASS,
        mass_known=mass is not None,
        k_g=model.rig.radius_of_gyration * float(np.sqrt(1.0 + of("wrong_inertia.d_I"))),
        com=np.array([of("com_offset.c_x"), of("com_offset.c_y")]),
        corner_radius=of("rounded_corners.rho"),
        mu=of("mu"),
        epsilon=max(of("epsilon"), LEAST),
        contact_time=time or NO_TIME,
        time_known=bool(time),
        speed=speed,
        damping_ratio=values.get(DAMPING_RATIO.name),
        impedance=values.get(IMPEDANCE.name),
        gravity=model.rig.gravity + of("wrong_gravity.dg"),
        tilt=of("surface_tilt.phi"),
        height=model.rig.height + of("surface_height.h"),
        expressed=expressed,
        left_out=tuple(left_out),
    )


def _contact_time(model: SavedModel) -> tuple[float, float | None]:
    """T in s of a central contact (0 if unknown), and the speed in m/s at which ε and T hold (None: any)."""
    tau, epsilon = model.values.get(CONTACT_TIME.name, 0.0), max(model.values["epsilon"], LEAST)
    force = model.model.law.force
    speed = SPEED if isinstance(force, HuntCrossley) else None
    return (duration(tau, epsilon) if not tau or force is None else tau * force.lasting(epsilon)), speed


def _grown(shape: Shape, factor: float) -> Shape:
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return Ellipse(semi_axes=(factor * a, factor * b))
    if isinstance(shape, Disk):
        return Disk(radius=factor * shape.radius)
    corners = [(float(x), float(y)) for x, y in factor * shape.corners]
    return Polygon(vertices=tuple(corners))


def _half_width(shape: Shape) -> float:
    if isinstance(shape, Ellipse):
        return max(shape.semi_axes)
    return shape.radius if isinstance(shape, Disk) else 0.5 * float(np.ptp(shape.corners, axis=0).max())


def _inertia_per_mass(shape: Shape, depth: float) -> np.ndarray:
    """(3, 3) in m² of the uniform solid about its centre of mass."""
    half = 0.5 * depth
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return Ellipsoid(semi_axes=(a, half, b)).moments.inertia_per_mass
    if isinstance(shape, Disk):  # its axis is y here, not z
        return Cylinder(radius=shape.radius, half_length=half).moments.inertia_per_mass[np.ix_([0, 2, 1], [0, 2, 1])]
    prism = tuple((float(x), y, float(z)) for y in (-half, half) for x, z in shape.corners)
    return Hull(vertices=prism).moments.inertia_per_mass


WIDTH = 110  # characters of a comment's line


def n(*values: float | np.ndarray) -> str:
    """Numbers as they stand in a file: nine digits, no negative zero."""
    flat = np.concatenate([np.ravel(value) for value in values])
    return " ".join(f"{value + 0.0:.9g}" for value in np.where(np.abs(flat) < 1e-15, 0.0, flat))


def comment(lines: Iterable[str], indent: str = "") -> str:
    """An XML comment; what would end it early is broken up, what does not print is escaped."""
    safe = [" ".join(visible(line).split("\n")).replace("--", "- -").rstrip("-") for line in lines]
    wrapped = [part for line in safe for part in textwrap.wrap(line, WIDTH, subsequent_indent="    ") or [""]]
    return "\n".join([f"{indent}<!--", *(f"{indent}  {line}".rstrip() for line in wrapped), f"{indent}-->"])


def story(solid: ExportedBody, engine: Sequence[str]) -> list[str]:
    """Where the numbers come from, what was left out; `engine` says how the contact's numbers are made."""
    return [*provenance(solid), *engine, "", *said_of_effects(solid)]


def only_bounds(model: SavedModel) -> list[str]:
    """What the drops give only a bound of, and what was written in its place."""
    return [
        f"{name}: {bounded(p.model_dump())}; {model.values[name]:g} is used"
        for name, p in model.parameters.items()
        if p.bound is not None
    ]


def _sized(p: SavedParameter) -> str:
    if p.bound is not None:
        return bounded(p.model_dump(), "" if p.unit == "1" else p.unit)
    return f"= {p.value:g}" + ("" if p.std is None else f" +/- {p.std:g}") + ("" if p.unit == "1" else f" {p.unit}")


def provenance(solid: ExportedBody) -> list[str]:
    """Where each number comes from."""
    m = solid.model
    fitted = ", ".join(f"{name} {_sized(p)}" for name, p in m.parameters.items())
    mass = "as given" if solid.mass_known else f"{NO_MASS:g} kg, as no mass was given"
    time = "from the fitted tau" if solid.time_known else f"{NO_TIME:g} s, as impacts alone show none"
    when = "at any speed" if solid.speed is None else f"at {solid.speed:g} m/s"
    return [
        f"Written by python -m thesis_lib export from a model of {m.dataset or 'drops'}: {m.law.replace('_', ' ')}"
        + (f" with {', '.join(m.effects)}" if m.effects else ""),
        f"fitted: {fitted}",
        "",
        "axes: the plane of the drops is x-z; theta turns about -y; units m, kg, s, rad",
        "origin of the body: the believed centre of mass, as in the dataset",
        f"shape: as in dataset.yaml{' times 1 + wrong_size.s' if 'wrong_size' in m.effects else ''}",
        f"depth along y: {solid.depth:g} m, stated, not measured",
        f"mass: {mass}",
        f"inertia: about y m k^2 with k = {solid.k_g:.6g} m"
        + (" (fitted)" if "wrong_inertia" in m.effects else " (as in dataset.yaml)")
        + "; the others as of a uniform solid, scaled alike",
        f"centre of mass: {'fitted (com_offset)' if 'com_offset' in m.effects else 'as believed'}",
        f"friction: mu = {solid.mu:g}, fitted",
        f"restitution: {solid.epsilon:g}, fitted, of a central impact {when}",
        f"contact time: {solid.contact_time:.6g} s, {time}",
        f"surface: height {solid.height:g} m, tilt {solid.tilt:g} rad; gravity {solid.gravity:g} m/s^2",
    ]


def said_of_effects(solid: ExportedBody) -> list[str]:
    """The effects that the file holds, and those that it cannot."""
    held = [f"  {name}: {where}" for name, where in solid.expressed] or ["  (none)"]
    left = [f"  {name}: {why}" for name, why in solid.left_out] or ["  (nothing)"]
    return ["effects in this file:", *held, "could not be expressed:", *left]
