"""A body over its surface in space, as an engine's file describes it, and comments on the origin of its numbers.

`thesis_lib/critique/export/of_plane.py` makes such a body from a planar model,
`thesis_lib/critique/export/of_space.py` from a model in space.

| on paper | in code          | unit  | shape  |                                                              |
|----------|------------------|-------|--------|--------------------------------------------------------------|
| c        | `centre`         | m     | (3,)   | true centre of mass in the frame of the body                 |
| I        | `inertia`        | kg m² | (3, 3) | about the centre of mass, in the axes of the body            |
| T        | `contact_time`   | s     |        | of a central contact                                         |
| m_t      | `twist`          | m     |        | torsional friction: largest couple over the normal force     |
| g        | `gravity`        | m/s²  | (3,)   | in the axes of the world                                     |
"""

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.solids import Box, Hull, Solid, Sphere
from thesis_lib.contact.compliant.compiled import SPEED
from thesis_lib.contact.compliant.normal_force import HuntCrossley, PyramidDamper
from thesis_lib.critique.contacts.contact_time import CONTACT_TIME, DAMPING_RATIO, IMPEDANCE, duration
from thesis_lib.critique.export.held import reason, written
from thesis_lib.critique.results.saved_model import SavedModel, SavedParameter
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.terminal import visible
from thesis_lib.mechanics.frame import Frame
from thesis_lib.statistics.wording import bounded

FORMATS = ("mjcf", "sdf", "urdf")
NO_MASS = 1.0  # kg, if the mass is unknown
NO_TIME = 1e-3  # s, if no trajectory determines the contact time
LIMITS = {"mu": (0.0, np.inf), "epsilon": (0.01, 1.0)}  # range that engines can represent: no damper reaches a lower ε
SHARP = 1e-6  # m; radius of the sphere at a sharp corner
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])  # no rotation
Left = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Part:
    """A solid of a body, with its pose in the body; a solid without `touches` is only visible."""

    name: str
    solid: Solid
    at: Frame
    touches: bool = True


@dataclass(frozen=True, kw_only=True)
class ExportedBody:
    """A body over its surface.

    Attributes:
        shape: solid that touches, at the pose `at` in the body; `seen`: solid shown instead, if another.
        mass_known, time_known: whether mass and contact time are known, rather than set to a default.
        points: number of points in which the body touches and that share the load.
        estimate: MuJoCo's estimate of the inverse mass, times the mass, for which an impedance was fitted.
        surface: its normal is the third axis.
        speed: m/s, at which ε holds; None if ε holds at any speed.
        damping_ratio, impedance: None if they were not fitted.
        said: lines of the comment about axes, shape, mass and inertia.
        not_patched: by effect, a line on what a patch leaves unchanged, and the correct value.
        expressed, left_out: (name, text) of the effects that the file expresses, and of those that it cannot.
    """

    model: SavedModel
    shape: Solid
    at: Frame
    seen: Solid | None = None
    mass: float
    mass_known: bool
    inertia: np.ndarray
    centre: np.ndarray
    points: int
    estimate: float
    mu: float
    epsilon: float
    contact_time: float
    time_known: bool
    speed: float | None
    damping_ratio: float | None
    impedance: float | None
    twist: float
    gravity: np.ndarray
    surface: Frame
    said: tuple[str, ...]
    not_patched: dict[str, str]
    expressed: Left
    left_out: Left

    @property
    def normal(self) -> np.ndarray:
        """Normal (3,) of the surface."""
        return self.surface.vectors_out(np.array([[0.0], [0.0], [1.0]]))[:, 0]

    @property
    def start(self) -> np.ndarray:
        """Position (3,) in m at which the body, its axes parallel to those of the world, touches the surface."""
        down = -self.normal[:, None]
        reach = self.at.vectors_out(self.shape.support(self.at.vectors_in(down)))[:, 0] + self.at.origin
        return self.surface.origin - (reach @ self.normal) * self.normal

    @property
    def on_pyramid(self) -> bool:
        """Whether friction was fitted on a pyramid."""
        return isinstance(self.model.model.law.force, PyramidDamper)

    def parts(self, at_corners: bool) -> list[Part]:
        """Return the solids of the body; `at_corners`: a box or a hull touches with balls at sharp corners, too."""
        found = [] if self.seen is None else [Part("seen", self.seen, self.at, touches=False)]
        shape = self.shape
        if not isinstance(shape, Box | Hull) or not (shape.edge_radius or at_corners):
            return [*found, Part("body", shape, self.at)]
        ball = Sphere(radius=shape.edge_radius or SHARP)
        places = self.at.origin[:, None] + self.at.vectors_out(shape.minkowski.centres)
        balls = [Part(f"corner{i}", ball, Frame(place, UPRIGHT)) for i, place in enumerate(places.T)]
        return [*found, Part("body", shape.rounded(0.0), self.at, touches=False), *balls]


def contact_of(model: SavedModel, target: str) -> dict:
    """Return the fields of `ExportedBody` common to all bodies: the contact, and the effects of the model."""
    values, space = model.values, model.space
    held, left_out = _held(model)
    time, speed = _contact_time(model, held["epsilon"])
    left_out += [(name, reason(name, target, space)) for name in model.effects if not written(name, target, space)]
    if "stiction_tolerance" in values:
        left_out.append(("stiction_tolerance", "a property of Drake's plant: plant.set_stiction_tolerance(...)"))
    if DAMPING_RATIO.name in values and target != "mjcf":
        left_out.append((DAMPING_RATIO.name, "friction of a convex program; Drake has Coulomb friction"))
    if IMPEDANCE.name in values and target != "mjcf":
        left_out.append((IMPEDANCE.name, "specific to MuJoCo: Drake's spring and damper do not depend on the mass"))
    if model.scatter:
        left_out.append(("scatter", f"{model.scatter:g} m/s after impact that no effect explains"))
    return {
        "model": model,
        **held,
        "contact_time": time or NO_TIME,
        "time_known": bool(time),
        "speed": speed,
        "damping_ratio": values.get(DAMPING_RATIO.name),
        "impedance": values.get(IMPEDANCE.name),
        "twist": values.get("torsional_friction.m_t", 0.0) if target == "mjcf" else 0.0,
        "expressed": tuple((name, said) for name in model.effects if (said := written(name, target, space))),
        "left_out": tuple(left_out),
    }


def require_size(name: str, value: float | None, most: float = np.inf) -> None:
    """Raise UserError unless a user's value is positive and below `most`, in m if `most` is finite."""
    if value is not None and not 0.0 < value < most:
        raise UserError(f"--{name} must be a positive number{'' if most == np.inf else ' in m'}; got {value}.")


def _held(model: SavedModel) -> tuple[dict[str, float], list[tuple[str, str]]]:
    """Return μ and ε within the range of an engine, and a text on each whose fitted value lies outside."""
    held, beyond = {}, []
    for name, limits in LIMITS.items():
        fitted = model.values.get(name, 0.0)
        held[name] = float(np.clip(fitted, *limits))
        if held[name] != fitted:
            than = "less" if fitted < held[name] else "more"
            beyond.append((name, f"fitted as {fitted:g}, {than} than engines can have; {held[name]:g} was written"))
    return held, beyond


def _contact_time(model: SavedModel, epsilon: float) -> tuple[float, float | None]:
    """Return T in s of a central contact (0 if unknown), and the speed in m/s at which ε and T hold (None: any)."""
    tau = model.values.get(CONTACT_TIME.name, 0.0)
    force = model.model.law.force
    speed = SPEED if isinstance(force, HuntCrossley) else None
    return (duration(tau, epsilon) if not tau or force is None else tau * force.lasting(epsilon)), speed


WIDTH = 110  # characters of a comment's line


def n(*values: float | np.ndarray) -> str:
    """Return numbers as text for a file: nine digits, no negative zero."""
    flat = np.concatenate([np.ravel(value) for value in values])
    return " ".join(f"{value + 0.0:.9g}" for value in np.where(np.abs(flat) < 1e-15, 0.0, flat))


def comment(lines: Iterable[str], indent: str = "") -> str:
    """Return an XML comment; double hyphens are broken up, and unprintable characters escaped."""
    safe = [" ".join(visible(line).split("\n")).replace("--", "- -").rstrip("-") for line in lines]
    wrapped = [part for line in safe for part in textwrap.wrap(line, WIDTH, subsequent_indent="    ") or [""]]
    return "\n".join([f"{indent}<!--", *(f"{indent}  {line}".rstrip() for line in wrapped), f"{indent}-->"])


def only_bounds(model: SavedModel) -> list[str]:
    """Return lines on parameters for which the drops give only a bound, with the values written instead."""
    return [
        f"{name}: {bounded(p.model_dump())}; {model.values[name]:g} is used"
        for name, p in model.parameters.items()
        if p.bound is not None
    ]


def _sized(p: SavedParameter) -> str:
    if p.bound is not None:
        return bounded(p.model_dump(), "" if p.unit == "1" else p.unit)
    return f"= {p.value:g}" + ("" if p.std is None else f" +/- {p.std:g}") + ("" if p.unit == "1" else f" {p.unit}")


def mass_said(solid_mass: float | None) -> str:
    """Return the comment on the mass, given or unknown."""
    return f"mass: {'as given' if solid_mass is not None else f'{NO_MASS:g} kg, as no mass was given'}"


def story(solid: ExportedBody, engine: Sequence[str]) -> list[str]:
    """Return comment lines: the source of each number, effects in the file and left out; `engine`: on its contact."""
    m = solid.model
    held = [f"  {name}: {where}" for name, where in solid.expressed] or ["  (none)"]
    left = [f"  {name}: {why}" for name, why in solid.left_out] or ["  (nothing)"]
    fitted = ", ".join(f"{name} {_sized(p)}" for name, p in m.parameters.items())
    time = "from the fitted tau" if solid.time_known else f"{NO_TIME:g} s, as impacts alone do not determine it"
    beyond = dict(solid.left_out)
    mu, epsilon = (f"{getattr(solid, name):g}, {'not as ' * (name in beyond)}fitted" for name in LIMITS)
    when = "at any speed" if solid.speed is None else f"at {solid.speed:g} m/s"
    return [
        f"Written by thesis-lib export from a model of {m.dataset or 'drops'}: {m.law.replace('_', ' ')}"
        + (f" with {', '.join(m.effects)}" if m.effects else ""),
        f"fitted: {fitted}",
        "",
        *solid.said,
        f"centre of mass: {'fitted (com_offset)' if 'com_offset' in m.effects else 'as believed'}",
        f"friction: mu = {mu}",
        f"restitution: {epsilon}, of a central impact {when}",
        f"contact time: {solid.contact_time:.6g} s, {time}",
        f"surface: through {n(solid.surface.origin)} m, with normal {n(solid.normal)}",
        f"gravity: {n(solid.gravity)} m/s^2",
        *engine,
        "",
        *("effects in this file:", *held),
        *("could not be expressed:", *left),
    ]
