"""Interface of a candidate physical effect: a name, an equation, parameters, and the stages at which it acts.

The prediction of an impact passes through the stages below.  Each stage has a method, its hook; an effect overrides the
hooks of the stages at which it acts.  Any set of effects can be active; at its null parameters an effect does nothing:

    measured state ── to_true ──► true state ── to_contact ──► state of the true centre of mass, relative to the surface
        contact_point, inertia                   where and on what the impulse acts
        contact_time                             τ, if contacts have a duration
        coefficients ──► law ──► impulse         μ, ε before the law; impulse and couple after it
    v_post as measured ◄── to_measured ── v_post ◄── from_contact ── v⁺ = v + M⁻¹ Jᵀ c

Further hooks: `acceleration` in flight between impacts, `gap` between body and surface at an impact, and `sliding`, the
friction of a body that the surface supports.
Before `to_contact` a state describes the body origin; `contact_point`, `contact_time`, `coefficients` and `impulse`
receive the state that `to_contact` returns.
A measurement effect changes the predicted measurement, never the data.

The first axis of an array holds the components: r (d, n), accelerations (d + turns, n), as in
`thesis_lib/mechanics/space.py`.  An effect written this way also works in space and declares this by `dimensions =
IN_SPACE`; a vector parameter then has a component for each axis (`vectors`).

Effects act one after the other in the order of `in_order`, whatever the order in which they were chosen.  Origins of
place, time and release number are arbitrary: an effect that depends on one of these counts from `rig.reference`, so
μ, ε and τ hold in the middle of the measured impacts.

| on paper        | in code            | unit               | shape         |                                         |
|-----------------|--------------------|--------------------|---------------|-----------------------------------------|
| q, v            | `State`            | m, rad; m/s, rad/s | (·, n)        | pose and motion                         |
| r               | `r`                | m                  | (d, n)        | contact point from the centre of mass   |
| G               | `G`                | m²                 | 1, (3, 3, ·)  | k²; in space inertia per mass, body axes |
| μ, ε            | `mu`, `epsilon`    | 1                  | (n,)          | coefficients of each impact             |
| τ               | `tau`              | s                  | (n,)          | from touch to centroid of the impulse   |
| c               | `c`                | N s/kg             | d of (n,)     | impulse on the body, per unit mass      |
|                 | `couple`           | N m s/kg           | (n,), (3, n)  | couple about the contact point          |

Masses are 1 throughout: impacts depend only on the inertia per mass.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.bodies.walls import Wall
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.free_motion import spin_rate
from thesis_lib.mechanics.space import PLANE, SPACE, Space, conjugate, rotated
from thesis_lib.mechanics.state import AS_FILMED, State

Family = Literal["contact_law", "geometry", "inertia", "surface", "flight", "measurement"]
FAMILIES: tuple[Family, ...] = ("contact_law", "geometry", "inertia", "surface", "flight", "measurement")
Channel = Literal["impact", "meet", "touch", "flight", "slide"]
Coordinate = Literal["x", "y", "t", "trial"]
Parameters = Mapping[str, float]
IN_PLANE, IN_SPACE, ONLY_SPACE = frozenset({2}), frozenset({2, 3}), frozenset({3})


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect.

    Attributes:
        name: key, a standard symbol spelled out (e_t, c_x, ...).
        unit: SI unit.
        null: value at which the effect is absent.
        low, high: bounds, inclusive; values beyond them are unphysical.
        scale: a relevant size, for finite-difference steps and starting values.
        starts: further starting values, for effects whose misfit has more than one minimum.
        discrete: the other value, for effects that are on or off (a mirrored axis); else None.
        choices: further values of a discrete parameter, for example to select one of three axes.
        words: meanings of all values except the null, for a parameter with choices.
        along: "x", "t" or "trial" if the parameter is a place, a time or a release from `Rig.reference`; else "".
        of: parameter of the law that this parameter replaces: the effect is absent if both are equal, and `null` is
            only a starting value; "" if the effect is absent at `null`.
        open_end: whether a bound is a valid result: an edge beyond all impacts, or sharper than the data resolve.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    scale: float
    starts: tuple[float, ...] = ()
    discrete: float | None = None
    choices: tuple[float, ...] = ()
    words: tuple[str, ...] = ()
    along: Coordinate | Literal[""] = ""
    of: str = ""
    open_end: bool = False

    def absent_at(self, values: Mapping[str, float]) -> float:
        """Value at which the effect is absent from a model whose law has these parameter values."""
        return values.get(self.of, self.null)

    @property
    def options(self) -> tuple[float, ...]:
        """All values of a discrete parameter except its null."""
        return () if self.discrete is None else (self.discrete, *self.choices)

    def said(self, value: float) -> str:
        """Meaning of a value of a discrete parameter: one of its `words`, or "on", with the value if in `choices`."""
        if self.words and value in self.options:
            return self.words[self.options.index(value)]
        return f"on ({value:g})" if value in self.choices else "on"


@dataclass(frozen=True)
class Reference:
    """Origin from which effects count: place x (m; in space also y, along the surface), time t (s) and release.

    All values are in the coordinates and numbering of the dataset.
    """

    x: float = 0.0
    t: float = 0.0
    trial: float = 0.0
    y: float = 0.0

    def content(self, space: Space) -> dict[str, float]:
        """Values to be saved in a file: x, t and trial; in space also y."""
        of_plane = {"x": self.x, "t": self.t, "trial": self.trial}
        return of_plane if space.is_plane else of_plane | {"y": self.y}


ORIGIN = Reference()


@dataclass(frozen=True)
class Rig:
    """Assumed body and experimental set-up: shape, radius of gyration k_g (m), gravity (m/s²), surface height (m).

    In space `tensor` (3, 3), or (3, 3, n) for n bodies, is the inertia per mass in m² along the body axes, k_g the
    square root of its mean principal moment, and `down` (3,) the direction of gravity in the axes of the surface (None:
    opposite to the normal).  `tracked` is the pose of the tracked frame in the body, from its centre of mass (None: the
    camera reports the body), and `world` (4,) the rotation from the axes of the surface into those of the recording
    (None: they coincide).  `recorded` holds the frames of whole tosses.  With `walls` each state has the number of its
    wall (`bodies.walls`), and the height is 0.  If `has_angle` is false, neither angle nor spin is measured.
    `reference` is the origin from which effects count places, times and releases.
    """

    shape: Shape | Any
    k_g: float
    gravity: float
    height: float
    walls: tuple[Wall, ...] = ()
    has_angle: bool = True
    reference: Reference = ORIGIN
    tensor: np.ndarray | None = None
    down: np.ndarray | None = None
    tracked: Frame | None = None
    world: np.ndarray | None = None
    recorded: WholeTosses | None = None

    @property
    def space(self) -> Space:
        """Space in which the body moves: the plane or three dimensions."""
        return PLANE if self.tensor is None else SPACE

    @property
    def G(self) -> np.ndarray | float:
        """Inertia per mass in m²: k² in the plane, (3, 3, 1) in space."""
        return self.k_g * self.k_g if self.tensor is None else np.atleast_3d(self.tensor)

    @property
    def k_told(self) -> float:
        """Radius of gyration in m as the weight of errors in spin; 0 if the spin is not measured."""
        return self.k_g if self.has_angle else 0.0

    def lowest(self, state: State) -> np.ndarray:
        """Contact point (d, n) in m of the assumed shape, from the body origin."""
        return self.shape.lowest(state.attitude)

    def gap(self, state: State) -> np.ndarray:
        """Gap φ_n (n,) in m between the assumed shape and the assumed surface."""
        if self.tensor is None:
            return self.shape.gap(state.y, state.theta, self.height)
        return state.height + self.lowest(state)[-1] - self.height

    def lever(self, state: State) -> np.ndarray:
        """Vector (d, n) in m from the centre of mass to the tracked point, for the assumed body in `state`."""
        if self.tracked is None:
            return np.zeros((state.space.dimension, 1))
        return state.turned(self.tracked.origin[:, None])

    def turned(self, state: State, attitude: np.ndarray, spin: np.ndarray) -> State:
        """State with the given attitude and spin of the body and an unchanged motion of the tracked point."""
        moved = state.changed(attitude=attitude, spin=spin)
        if self.tracked is None:
            return moved
        here, there, velocity_at = self.lever(state), self.lever(moved), state.space.velocity_at
        velocity = velocity_at(velocity_at(state.velocity, state.spin, here), spin, -there)
        return moved.changed(position=state.position + here - there, velocity=velocity)

    def from_recording(self, u: np.ndarray) -> np.ndarray:
        """Vectors (3, n) in the axes of the surface, given in the axes of the recording."""
        return u if self.world is None else rotated(conjugate(self.world)[:, None], u)

    @property
    def pull(self) -> np.ndarray:
        """Acceleration of gravity (d, 1) in m/s², in space with one surface."""
        down = np.array([0.0, 0.0, -1.0]) if self.down is None else self.down
        return self.gravity * down[:, None]

    def fall(self, state: State) -> np.ndarray:
        """Acceleration (d + turns, n) in free flight in m/s² and rad/s², in the axes of the surface or wall of each."""
        a = np.zeros(state.motion.shape)
        a[state.space.dimension - 1] = -self.gravity
        if self.down is not None:
            a[: len(self.down)] = self.pull
        if self.tensor is not None:
            a[3:] = spin_rate(state.attitude, state.spin, self.tensor)
        if self.walls and self.gravity:
            # the last angle, 0, is for the plane as filmed
            surface = np.full(len(state), AS_FILMED) if state.surface is None else state.surface
            angle = np.array([*(wall.angle for wall in self.walls), 0.0])[surface]
            a[0], a[1] = -self.gravity * np.sin(angle), -self.gravity * np.cos(angle)
        return a


@dataclass(frozen=True)
class Impulse:
    """Impulse c in N s/kg, by component, and couple about the contact point in N m s/kg: (n,), in space (3, n)."""

    c: tuple[np.ndarray, ...] | np.ndarray
    couple: np.ndarray

    @classmethod
    def planar(cls, c_t: np.ndarray, c_n: np.ndarray, couple: np.ndarray) -> "Impulse":
        """Planar impulse with these components (n,); the couple is positive counter-clockwise."""
        return cls((c_t, c_n), couple)

    @property
    def c_t(self) -> np.ndarray:
        """Tangential impulse (n,), in the plane only."""
        return self.c[0]

    @property
    def c_n(self) -> np.ndarray:
        return self.c[-1]


class Effect:
    """Base class of all effects.  Override the class attributes and the hooks of the stages at which the effect acts.

    Hooks take arrays, components first, and the effect's own parameters `p`, and return new arrays.  A parameter is a
    number, or an array (n,) with one value for each body, because fits try several values at once.  Hooks are the
    identity at the null parameters and never change their arguments.

    Attributes:
        name: file name and key, a standard term.
        family: one of `FAMILIES`.
        title: name in figures and reports.
        equation: in plain text with the symbols of the glossary.
        equation_in_space: in space, if it differs: x and R are position and attitude, n is the normal.
        parameters: see `Parameter`.
        channels: quantities it changes: impact (velocity after impact), meet (pose after minus pose before), touch
            (gap at impact), flight (acceleration between impacts), slide (friction while the surface supports it).
        needs_contact_time: whether it concerns only the duration of contacts.
        needs_angle: whether only the angle or the spin reveals it, or an unknown spin before the impact mimics it.
        needs_history: whether it depends on the motion before a hit, so that whole tosses must be recorded.
        needs_one_surface: whether it is undefined between walls, because it concerns gravity or a place on one surface.
        includes: names of effects that are special cases of this one, so that it does not compete with them.
        breaks_mirror: whether it distinguishes left from right: the outcome of a mirrored drop is not mirrored.
        bends: whether the camera reports a parabola as another kind of curve: its map is not linear in the pose.
        turns: whether it changes the free rotation seen in space, because inertia or axes of the body differ.
        even: whether its part of the acceleration in flight depends on angle and spin only and changes no spin.
        along: which of x, t and trial, in space also y, it counts from `rig.reference`.
        rank: its position in the order in which effects act; see `in_order`.
        rank_in_space: that in space, if it differs.
        dimensions: 2 if it is defined in the plane, 3 if it is defined in space.
        vectors: names of vector parameters: “c” stands for c_x and c_y, in space also c_z.
        own_in_space: parameters in space, if they differ from those that follow from `vectors`.
        level: pairs of parameters in space that form a vector along the surface, with the multiple of a rotation angle
            about the normal by which the pair rotates: (first, second, 1); for an ellipse 2.
        embedded: those of `own_in_space` that a motion in the plane x, z shows: (in space, in the plane, factor).
        denies: property of the body whose assumed value this effect contradicts: "inertia", "size" or "centre of mass",
            with each parameter in the unit of `Body.known`; "" if it leaves the body unchanged.
        reference: source, with DOI if it has one.
    """

    name: str
    family: Family
    title: str
    equation: str
    parameters: tuple[Parameter, ...]
    channels: tuple[Channel, ...] = ("impact",)
    needs_contact_time: bool = False
    needs_angle: bool = False
    needs_history: bool = False
    needs_one_surface: bool = False
    includes: tuple[str, ...] = ()
    breaks_mirror: bool = False
    bends: bool = False
    turns: bool = False
    even: bool = False
    along: tuple[Coordinate, ...] = ()
    rank: int = 0
    rank_in_space: int | None = None
    dimensions: frozenset[int] = IN_PLANE
    vectors: tuple[str, ...] = ()
    own_in_space: tuple[Parameter, ...] = ()
    level: tuple[tuple[str, str, int], ...] = ()
    embedded: tuple[tuple[str, str, float], ...] = ()
    equation_in_space: str = ""
    denies: str = ""
    reference: str = ""

    @property
    def needs_trajectories(self) -> bool:
        """Whether impacts alone cannot test it."""
        return "impact" not in self.channels

    def applies_to(self, rig: Rig) -> bool:
        """Whether the effect is possible with this rig (a corner radius needs corners)."""
        return True

    def shapes(self, state: State, rig: Rig) -> list[dict[str, float]]:
        """Starting values of the parameters that locate the effect, from the measured states before impact.

        For effects that need a location (a patch): a fit starts from the best of them, with all other parameters
        fitted.  Empty for effects whose `Parameter.starts` suffice.
        """
        return []

    def unseen(self, rig: Rig) -> np.ndarray:
        """Directions (k, n) in the space of its n parameters that are unobservable on this rig; they are not fitted."""
        return np.zeros((0, len(parameters_in(self, rig.space))))

    # measurement ------------------------------------------------------------------------------------------------
    def to_true(self, state: State, p: Parameters, rig: Rig) -> State:
        """True state that corresponds to a measured one."""
        return state

    def to_measured(self, state: State, p: Parameters, rig: Rig) -> State:
        """Measured state that corresponds to a true one; the inverse of `to_true`."""
        return state

    def meet(self, jump: np.ndarray, before: State, after: State, p: Parameters) -> np.ndarray:
        """Measured pose after minus pose before the impact, (d + turns, n) in m, rad; zero for perfect measurements."""
        return jump

    # contact ----------------------------------------------------------------------------------------------------
    def to_contact(self, state: State, p: Parameters, rig: Rig) -> State:
        """State for the contact: velocity of the true centre of mass, relative to the surface."""
        return state

    def from_contact(self, state: State, p: Parameters, rig: Rig) -> State:
        """State of the body origin from the state for the contact; the inverse of `to_contact`."""
        return state

    def contact_point(self, r: np.ndarray, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Contact point r (d, n) in m from the true centre of mass."""
        return r

    def gap(self, gap: np.ndarray, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Gap φ_n (n,) in m between assumed shape, at its true pose `state`, and assumed surface at contact.

        Effects add their parts to `gap`.  Measurement effects add nothing, because the pose is the true one.
        """
        return gap

    def inertia(self, G: np.ndarray | float, p: Parameters) -> np.ndarray | float:
        """True inertia per mass in m²: k² in the plane; in space (3, 3, 1) or (3, 3, n), along the body axes."""
        return G

    def coefficients(
        self, mu: np.ndarray, epsilon: np.ndarray, contact: Contact, state: State, p: Parameters, rig: Rig
    ) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients μ and ε (n,) of each impact, given those of the law."""
        return mu, epsilon

    def contact_time(self, tau: np.ndarray, contact: Contact, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Time τ (n,) ≥ 0 in s of each impact, as if it were central; used only by models with a contact time."""
        return tau

    def impulse(self, impulse: Impulse, contact: Contact, state: State, p: Parameters, rig: Rig) -> Impulse:
        """Impulse and couple of each impact, given those of the law.

        `contact` has the contact point `r` (d, n) in m and the coefficients `mu` and `epsilon` (n,) of each impact.
        """
        return impulse

    def sliding(self, mu: np.ndarray, contact: Contact, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Coefficient of friction (n,) of bodies that slide on the surface, given the one for impacts at this place.

        In space it may be a symmetric matrix M (2, 2, n); an ellipse then limits friction (`anisotropic_friction`).
        """
        return mu

    # flight -----------------------------------------------------------------------------------------------------
    def acceleration(self, a: np.ndarray, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Acceleration (d + turns, n) of the body origin in flight, m/s², rad/s²; `state` is the true state."""
        return a

    def arc(self, tau: np.ndarray, state: State, p: Parameters, rig: Rig) -> np.ndarray | None:
        """Deviation of the true path from pose + velocity τ + acceleration τ²/2, at times τ (n, W) from `state`.

        (d + turns, n, W) in m, rad; None if the acceleration is practically constant over a tenth of a second.  The
        bending by a camera (`bends`) follows from its map and is not included.
        """
        return None


class CameraEffect(Effect):
    """Measurement effect whose inverse is the same map with the opposite sign."""

    family: Family = "measurement"

    def to_true(self, state: State, p: Parameters, rig: Rig) -> State:
        return self.seen(state, p, -1.0, rig)

    def to_measured(self, state: State, p: Parameters, rig: Rig) -> State:
        return self.seen(state, p, 1.0, rig)

    def seen(self, state: State, p: Parameters, way: float, rig: Rig) -> State:
        """Measured state of a true one if `way` is 1; true state of a measured one if `way` is −1."""
        raise NotImplementedError


def equation_in(effect: Effect, space: Space) -> str:
    """Equation of the effect in this space."""
    return effect.equation if space.is_plane else effect.equation_in_space or effect.equation


def parameters_in(effect: Effect, space: Space) -> tuple[Parameter, ...]:
    """Parameters of the effect in this space; a vector parameter has a component for each axis."""
    if space.is_plane or effect.own_in_space:
        return effect.parameters if space.is_plane else effect.own_in_space
    found = []
    for p in effect.parameters:
        found.append(p)
        if any(p.name == f"{vector}_y" for vector in effect.vectors):
            found.append(replace(p, name=f"{p.name[:-1]}z"))
    return tuple(found)


def values_in_space(effect: Effect, of_plane: Mapping[str, float]) -> dict[str, float]:
    """Parameters in space equivalent to those `of_plane`, for a motion in the plane x, z; y in the plane becomes z."""
    p = {q.name: q.null if effect.own_in_space else of_plane.get(q.name, 0.0) for q in parameters_in(effect, SPACE)}
    for vector in effect.vectors:
        p[f"{vector}_y"], p[f"{vector}_z"] = 0.0, of_plane[f"{vector}_y"]
    return p | {name: factor * of_plane[source] for name, source, factor in effect.embedded}


def components(p: Parameter, names: Iterable[str]) -> tuple[Parameter, ...]:
    """Copies of the parameter with these names, as the components of a vector."""
    return tuple(replace(p, name=name) for name in names)


def along_axes(p: Parameters, name: str, space: Space) -> np.ndarray:
    """Vector parameter `name`, (d, 1), or (d, n) if each body has its own."""
    return vector(p, (f"{name}_{axis}" for axis in "xyz"[: space.dimension]))


def vector(p: Parameters, names: Iterable[str]) -> np.ndarray:
    """Vector with these components, (k, 1), or (k, n) if each body has its own."""
    parts = [p[name] for name in names]
    if any(isinstance(part, np.ndarray) for part in parts):
        return np.array(np.broadcast_arrays(*parts))
    return np.array(parts)[:, None]


def in_order(effects: Iterable[Effect], space: Space = PLANE) -> list[Effect]:
    """Effects in the order in which they act in this space: by rank, then by family and name.

    Two effects that do not commute need different ranks.  From the impact to the recording:

    | rank | effect                      | reason                                                                  |
    |------|-----------------------------|-------------------------------------------------------------------------|
    | −1   | tangential_restitution      | it must find which contacts stick before other effects change impulses  |
    | 0    | all others                  | they commute, except for limits such as ε ≤ 1                           |
    | 1    | anisotropic_friction        | it sets the friction for each direction of slip                         |
    | 1    | inertia_axes                | it rotates moments that others change along the assumed axes            |
    | 2    | velocity_dependent_friction | it lets that friction depend on the speed of slip                       |
    | 3    | tangential_compliance       | that friction limits the force of its spring                            |
    | 4    | contact_torque, torsional_friction | rolling and spinning, with the spin that the above leave         |
    | 5    | adhesion                    | it takes energy from the rebound that the above leave                   |
    | 6    | com_offset                  | the origin circles with the angular acceleration due to all forces      |
    | 7    | curved_surface              | the axes of the surface, for the centre of mass                         |
    | 8    | moving_surface              | its velocity is along the surface, whose axes others may have turned    |
    | 10…  | measurement                 | from the tracked point, by camera and scale, to the recording's axes    |
    """

    def place(effect: Effect) -> tuple[int, int, str]:
        own = None if space.is_plane else effect.rank_in_space
        return effect.rank if own is None else own, FAMILIES.index(effect.family), effect.name

    return sorted(effects, key=place)
