"""Interface of a candidate physical effect: a name, an equation, parameters, and the stages at which it acts.

The prediction of an impact goes through these stages.  An effect overrides the hooks of those at which it acts, so that
any set of effects can be on at once; at its null parameters it changes nothing:

    measured state ── to_true ──► true state ── to_contact ──► state as the contact sees it
        contact_point, inertia                   where and on what the impulse acts
        contact_time                             τ, where contacts take time
        coefficients ──► law ──► impulse         μ, ε before the law; impulse and couple after it
    v_post as measured ◄── to_measured ── v_post ◄── from_contact ── v⁺ = v + M⁻¹ Jᵀ c

and between impacts `acceleration` gives the flight, `gap` the distance of body and surface at an impact, `sliding` the
friction of a body that the surface supports.
Up to `to_contact` a state is that of the body origin; `contact_point`, `contact_time`, `coefficients` and `impulse`
get the state as the contact sees it.
A measurement effect changes the prediction of what is measured, never the measurement itself.

Arrays hold components first: r (d, n), accelerations (d + turns, n), as in `thesis_lib/mechanics/space.py`.  An effect
that is written so lives in space, too, and says it with `dimensions = IN_SPACE`; a parameter that is a vector has a
component for each axis there (`vectors`).

Effects act one after the other in the order of `in_order`, whatever the order in which they were chosen.  Places, times
and numbers of releases have no origin of their own: an effect that depends on one counts it from `rig.reference`, so
that μ, ε and τ are those in the middle of the measured impacts.

| on paper        | in code            | unit               | shape         |                                         |
|-----------------|--------------------|--------------------|---------------|-----------------------------------------|
| q, v            | `State`            | m, rad; m/s, rad/s | (·, n)        | pose and motion                         |
| r               | `r`                | m                  | (d, n)        | contact point from the centre of mass   |
| G               | `G`                | m²                 | 1, (3, 3, ·)  | k²; in space inertia per mass, body axes |
| μ, ε            | `mu`, `epsilon`    | 1                  | (n,)          | coefficients of each impact             |
| τ               | `tau`              | s                  | (n,)          | from touch to centroid of the impulse   |
| c               | `c`                | N s/kg             | d of (n,)     | impulse on the body, per unit mass      |
|                 | `couple`           | N m s/kg           | (n,), (3, n)  | couple about the contact point          |

Masses are 1 throughout: impacts need the inertia per mass only.
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
        unit: SI.
        null: value at which the effect is absent.
        low, high: bounds, inclusive; beyond them the effect makes no physical sense.
        scale: a size that would matter, for steps and starting values.
        starts: further starting values, for effects whose misfit has more than one minimum.
        discrete: the other value, for effects that are on or off (a mirrored axis); else None.
        choices: further values of a discrete one, as of one axis among three.
        words: what its values but the null stand for, of one with choices.
        along: "x", "t" or "trial" of one that is itself a place, a time or a release, from `Rig.reference`; else "".
        of: the parameter of the law in whose place it acts: the effect is absent where both are equal, and `null` is a
            start; "" of one that is absent at its null.
        open_end: whether an end of its range is an answer: an edge beyond all impacts, or sharper than they show.
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
        """The value at which the effect is absent from a model with these values of the law."""
        return values.get(self.of, self.null)

    @property
    def options(self) -> tuple[float, ...]:
        """All values of a discrete parameter but its null."""
        return () if self.discrete is None else (self.discrete, *self.choices)

    def said(self, value: float) -> str:
        """Meaning of the value of a discrete parameter: one of its `words`, or "on"; of `choices` its number."""
        if self.words and value in self.options:
            return self.words[self.options.index(value)]
        return f"on ({value:g})" if value in self.choices else "on"


@dataclass(frozen=True)
class Reference:
    """Where effects count from: a place x (m), in space x and y along the surface, a time t (s) and a release.

    In the numbers of the dataset.
    """

    x: float = 0.0
    t: float = 0.0
    trial: float = 0.0
    y: float = 0.0

    def content(self, space: Space) -> dict[str, float]:
        """For a file: x, t and trial, in space y, too."""
        of_plane = {"x": self.x, "t": self.t, "trial": self.trial}
        return of_plane if space.is_plane else of_plane | {"y": self.y}


ORIGIN = Reference()


@dataclass(frozen=True)
class Rig:
    """Body and rig as believed: shape, radius of gyration k_g (m), gravity (m/s²), surface height (m).

    In space `tensor` (3, 3), or (3, 3, n) of n bodies, is the inertia per mass in m² along the axes of the body, k_g
    the root of its mean principal moment, and `down` (3,) the direction of gravity in the axes of the surface, None
    where it is against the normal.  `tracked` is the pose of the tracked frame in the body, from its centre of mass
    (None: the camera reports the body), and `world` (4,) the turn of the axes of the surface into those of the
    recording (None: they are the same).  `recorded` is what the frames of whole tosses say.  Between `walls` states
    have the number of theirs (`bodies.walls`), and the height is 0.  Without `has_angle` neither the angle nor the spin
    is measured.  `reference` is where the effects count places, times and releases from.
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
        """Where the body moves."""
        return PLANE if self.tensor is None else SPACE

    @property
    def G(self) -> np.ndarray | float:
        """Inertia per mass in m²: k² in the plane, (3, 3, 1) in space."""
        return self.k_g * self.k_g if self.tensor is None else np.atleast_3d(self.tensor)

    @property
    def k_told(self) -> float:
        """Radius of gyration in m as a weight of errors in spin; 0 where the spin is not measured."""
        return self.k_g if self.has_angle else 0.0

    def lowest(self, state: State) -> np.ndarray:
        """Contact point (d, n) in m of the believed shape, from the body origin."""
        return self.shape.lowest(state.attitude)

    def gap(self, state: State) -> np.ndarray:
        """Gap φ_n (n,) in m between the believed shape and the believed surface."""
        if self.tensor is None:
            return self.shape.gap(state.y, state.theta, self.height)
        return state.height + self.lowest(state)[-1] - self.height

    def lever(self, state: State) -> np.ndarray:
        """From the centre of mass to the tracked point (d, n) in m, as the body is believed to lie in `state`."""
        if self.tracked is None:
            return np.zeros((state.space.dimension, 1))
        return state.turned(self.tracked.origin[:, None])

    def turned(self, state: State, attitude: np.ndarray, spin: np.ndarray) -> State:
        """State with another attitude and spin of the body, from the same motion of the tracked point."""
        moved = state.changed(attitude=attitude, spin=spin)
        if self.tracked is None:
            return moved
        here, there, velocity_at = self.lever(state), self.lever(moved), state.space.velocity_at
        velocity = velocity_at(velocity_at(state.velocity, state.spin, here), spin, -there)
        return moved.changed(position=state.position + here - there, velocity=velocity)

    def from_recording(self, u: np.ndarray) -> np.ndarray:
        """Vectors (3, n) in axes of the recording, in those of the surface."""
        return u if self.world is None else rotated(conjugate(self.world)[:, None], u)

    @property
    def pull(self) -> np.ndarray:
        """Acceleration of gravity (d, 1) in m/s² beside one surface in space."""
        down = np.array([0.0, 0.0, -1.0]) if self.down is None else self.down
        return self.gravity * down[:, None]

    def fall(self, state: State) -> np.ndarray:
        """Acceleration of gravity (d + turns, n) in m/s² and rad/s², in the frames of the bodies."""
        a = np.zeros(state.motion.shape)
        a[state.space.dimension - 1] = -self.gravity
        if self.down is not None:
            a[: len(self.down)] = self.pull
        if self.tensor is not None:
            a[3:] = spin_rate(state.attitude, state.spin, self.tensor)
        if self.walls and self.gravity:
            # the last one is for the plane as it was filmed
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
        """Planar impulse with these components (n,); the couple turns counter-clockwise."""
        return cls((c_t, c_n), couple)

    @property
    def c_t(self) -> np.ndarray:
        """In the plane: the tangential impulse."""
        return self.c[0]

    @property
    def c_n(self) -> np.ndarray:
        return self.c[-1]


class Effect:
    """Base of all effects.  Override the class attributes, and the hooks of the stages at which the effect acts.

    Hooks take arrays, components first, and the effect's own parameters `p`, and return new arrays.  A parameter is a
    number, or an array (n,) with one for each body: fits try several at once.  Hooks are the identity at the null
    parameters, and never change their arguments.

    Attributes:
        name: file name and key, a standard term.
        family: one of `FAMILIES`.
        title: in figures and reports.
        equation: in plain text with the symbols of the glossary.
        parameters: see `Parameter`.
        channels: what it changes: impact (velocity after impact), meet (pose before against pose after), touch
            (gap at impact), flight (acceleration between impacts), slide (friction while the surface supports it).
        needs_trajectories: whether impacts alone cannot test it.
        needs_contact_time: whether it is about nothing but the time that contacts take.
        needs_angle: whether only the angle or the spin shows it, or an unknown spin before the impact mimics it.
        needs_history: whether it depends on what was before a hit, so that whole tosses must be recorded.
        needs_one_surface: whether it has no meaning between walls, as it is about gravity or a place along one surface.
        includes: names of other effects that it is at some of its parameters: it does not compete with them.
        breaks_mirror: whether it tells left from right, so that a mirrored drop has not the mirrored outcome.
        bends: whether the camera reports a parabola as another kind of curve: its map is not linear in the pose.
        turns: whether in space a body is seen to turn freely in another way, as its inertia or its axes are others.
        even: whether what it adds to the acceleration in flight depends on angle and spin alone, and changes no spin.
        along: which of x, t and trial, in space also y, it counts from `rig.reference`.
        rank: its place among the effects that act together; see `in_order`.
        dimensions: 2 where it lives in the plane, 3 where it lives in space.
        vectors: names of parameters that are vectors: “c” stands for c_x and c_y, in space also c_z.
        own_in_space: the parameters in space, of an effect that has others there than `vectors` make.
        level: pairs of parameters in space that are a vector along the surface, and how many times its turn about the
            normal turns them: (first, second, 1), of an ellipse 2.
        embedded: of those the ones that a motion in the plane x, z of space shows: (of space, of the plane, factor).
        denies: the property of the body that it says is not as believed: "inertia", "size" or "centre of mass", each
            parameter in the unit of `Body.known`; "" if it leaves the body as it is.
        reference: source, with DOI where there is one.
    """

    name: str
    family: Family
    title: str
    equation: str
    parameters: tuple[Parameter, ...]
    channels: tuple[Channel, ...] = ("impact",)
    needs_trajectories: bool = False
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
    dimensions: frozenset[int] = IN_PLANE
    vectors: tuple[str, ...] = ()
    own_in_space: tuple[Parameter, ...] = ()
    level: tuple[tuple[str, str, int], ...] = ()
    embedded: tuple[tuple[str, str, float], ...] = ()
    denies: str = ""
    reference: str = ""

    def applies_to(self, rig: Rig) -> bool:
        """Whether the effect can exist on this rig (a corner radius needs corners)."""
        return True

    def shapes(self, state: State, rig: Rig) -> list[dict[str, float]]:
        """Starting values of the parameters that say where the effect is, from the measured states before impact.

        For effects that are nowhere without them (a patch); fits take the best of them, with all others fitted.  Empty
        for effects whose `Parameter.starts` suffice.
        """
        return []

    def unseen(self, rig: Rig) -> np.ndarray:
        """Directions (k, n) in the space of its n parameters that nothing on this rig can show; they are not fitted."""
        return np.zeros((0, len(parameters_in(self, rig.space))))

    # measurement ------------------------------------------------------------------------------------------------
    def to_true(self, state: State, p: Parameters, rig: Rig) -> State:
        """True state behind a measured one."""
        return state

    def to_measured(self, state: State, p: Parameters, rig: Rig) -> State:
        """Measured state of a true one; the inverse of `to_true`."""
        return state

    def meet(self, jump: np.ndarray, before: State, after: State, p: Parameters) -> np.ndarray:
        """Measured pose after minus before at the impact, (d + turns, n) in m, rad; zero without a fault."""
        return jump

    # contact ----------------------------------------------------------------------------------------------------
    def to_contact(self, state: State, p: Parameters, rig: Rig) -> State:
        """State as the contact sees it: velocity of the true centre of mass, relative to the surface."""
        return state

    def from_contact(self, state: State, p: Parameters, rig: Rig) -> State:
        """The inverse of `to_contact`."""
        return state

    def contact_point(self, r: np.ndarray, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Contact point r (d, n) in m, from the true centre of mass."""
        return r

    def gap(self, gap: np.ndarray, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Gap φ_n (n,) in m between believed shape, at its true pose `state`, and believed surface at contact.

        Effects add their parts to `gap`.  Effects of the measurement have none, because the pose is the true one.
        """
        return gap

    def inertia(self, G: np.ndarray | float, p: Parameters) -> np.ndarray | float:
        """True inertia per mass in m²: k² in the plane; in space (3, 3, 1) or (3, 3, n), along axes of the body."""
        return G

    def coefficients(
        self, mu: np.ndarray, epsilon: np.ndarray, contact: Contact, state: State, p: Parameters, rig: Rig
    ) -> tuple[np.ndarray, np.ndarray]:
        """μ and ε (n,) of each impact, given those of the law."""
        return mu, epsilon

    def contact_time(self, tau: np.ndarray, contact: Contact, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """τ (n,) in s of each impact, as in a central one; not negative.  Only models that take time ask for it."""
        return tau

    def impulse(self, impulse: Impulse, contact: Contact, state: State, p: Parameters, rig: Rig) -> Impulse:
        """Impulse and couple of each impact, given those of the law.

        `contact` has the contact point `r` (d, n) in m and the coefficients `mu` and `epsilon` (n,) of each impact.
        """
        return impulse

    def sliding(self, mu: np.ndarray, contact: Contact, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Coefficient of friction (n,) of bodies that slide on the surface, given that of impacts at this place.

        In space also a symmetric matrix M (2, 2, n): friction is then limited by an ellipse (`anisotropic_friction`).
        """
        return mu

    # flight -----------------------------------------------------------------------------------------------------
    def acceleration(self, a: np.ndarray, state: State, p: Parameters, rig: Rig) -> np.ndarray:
        """Acceleration (d + turns, n) of the body origin in flight, m/s², rad/s²; `state` is the true one."""
        return a

    def arc(self, tau: np.ndarray, state: State, p: Parameters, rig: Rig) -> np.ndarray | None:
        """Deviation of the true path from pose + velocity τ + acceleration τ²/2, at times τ (n, W) from `state`.

        (d + turns, n, W) in m, rad; None if the acceleration is practically constant over a tenth of a second.  What
        the camera bends (`bends`) follows from its map.
        """
        return None


class CameraEffect(Effect):
    """A fault of the measurement that is undone by the same map with the other sign."""

    family: Family = "measurement"

    def to_true(self, state: State, p: Parameters, rig: Rig) -> State:
        return self.seen(state, p, -1.0, rig)

    def to_measured(self, state: State, p: Parameters, rig: Rig) -> State:
        return self.seen(state, p, 1.0, rig)

    def seen(self, state: State, p: Parameters, way: float, rig: Rig) -> State:
        """Measured state of a true one where `way` is 1, true state behind a measured one where it is −1."""
        raise NotImplementedError


def parameters_in(effect: Effect, space: Space) -> tuple[Parameter, ...]:
    """The parameters of the effect, those that are vectors with a component for each axis of the space."""
    if space.is_plane or effect.own_in_space:
        return effect.parameters if space.is_plane else effect.own_in_space
    found = []
    for p in effect.parameters:
        found.append(p)
        if any(p.name == f"{vector}_y" for vector in effect.vectors):
            found.append(replace(p, name=f"{p.name[:-1]}z"))
    return tuple(found)


def values_in_space(effect: Effect, of_plane: Mapping[str, float]) -> dict[str, float]:
    """The effect's parameters in space for those `of_plane`, of a motion in the plane x, z; up is y in the plane."""
    p = {q.name: q.null if effect.own_in_space else of_plane.get(q.name, 0.0) for q in parameters_in(effect, SPACE)}
    for vector in effect.vectors:
        p[f"{vector}_y"], p[f"{vector}_z"] = 0.0, of_plane[f"{vector}_y"]
    return p | {name: factor * of_plane[source] for name, source, factor in effect.embedded}


def components(p: Parameter, names: Iterable[str]) -> tuple[Parameter, ...]:
    """The parameter once for each of these names, as the components of a vector."""
    return tuple(replace(p, name=name) for name in names)


def along_axes(p: Parameters, name: str, space: Space) -> np.ndarray:
    """The vector parameter `name`, (d, 1), or (d, n) if there is one for each body."""
    return vector(p, (f"{name}_{axis}" for axis in "xyz"[: space.dimension]))


def vector(p: Parameters, names: Iterable[str]) -> np.ndarray:
    """The vector with these components, (k, 1), or (k, n) if there is one for each body."""
    parts = [p[name] for name in names]
    if any(isinstance(part, np.ndarray) for part in parts):
        return np.array(np.broadcast_arrays(*parts))
    return np.array(parts)[:, None]


def in_order(effects: Iterable[Effect]) -> list[Effect]:
    """Effects in the order in which they act: by rank, then by family and name.

    A rank is needed where two effects do not commute.  From an impact to the record:

    | rank | effect                      | why there                                                               |
    |------|-----------------------------|-------------------------------------------------------------------------|
    | −1   | tangential_restitution      | it asks which impulses of the law stick, before others change them      |
    | 0    | all others                  | they commute, but for limits such as ε ≤ 1                              |
    | 1    | anisotropic_friction        | friction of either direction of the slip,                               |
    | 1    | inertia_axes                | it turns the moments that others change along the believed axes         |
    | 2    | velocity_dependent_friction | which then depends on its speed                                         |
    | 3    | tangential_compliance       | the spring that this friction holds                                     |
    | 4    | contact_torque, torsional_friction | rolling and spinning, with what these leave of the spin          |
    | 5    | adhesion                    | it takes its energy from the rebound that all else leaves               |
    | 6    | com_offset                  | the origin circles with the angular acceleration of all forces          |
    | 7    | curved_surface              | the axes of the surface, for the centre of mass                         |
    | 8    | moving_surface              | its velocity is along the surface, whose axes others may have turned    |
    | 10…  | measurement                 | from the tracked point over camera and scale to the axes of the record  |
    """
    return sorted(effects, key=lambda effect: (effect.rank, FAMILIES.index(effect.family), effect.name))
