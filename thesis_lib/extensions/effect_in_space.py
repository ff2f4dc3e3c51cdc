"""What an effect that says it lives in space must do there: the plane is a case, and no level direction is special.

Each check looks at the hooks of the effect for states of a box; effects of the plane are not asked.
"""

from collections.abc import Mapping

import numpy as np

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.bodies.solids import Box
from thesis_lib.effects.effect import Effect, Rig, parameters_in
from thesis_lib.extensions.contract import Check
from thesis_lib.mechanics.contact import contact
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import PLANE, SPACE, Space, of_rotation_vector
from thesis_lib.mechanics.state import State

N = 60
MU, EPSILON, TAU = 0.25, 0.55, 5e-4
ROUNDING = 1e-11  # of numbers of order 1 to 10 that a few turns have passed
HALF = (0.03, 0.02, 0.015)  # m
MOMENTS = np.diag([HALF[1] ** 2 + HALF[2] ** 2, HALF[0] ** 2 + HALF[2] ** 2, HALF[0] ** 2 + HALF[1] ** 2]) / 3.0
BOX = Rig(Box(half_extents=HALF), float(np.sqrt(np.trace(MOMENTS) / 3.0)), 9.81, 0.2, tensor=MOMENTS)
_SIDES = ((HALF[0], HALF[2]), (-HALF[0], HALF[2]), (-HALF[0], -HALF[2]), (HALF[0], -HALF[2]))
SECTION = Rig(Polygon(vertices=_SIDES), float(np.sqrt(MOMENTS[1, 1])), 9.81, 0.2)
ANGLE = 0.7  # rad, about the vertical
Made = dict[str, State | np.ndarray]


def absent_at_null(effect: Effect) -> str:
    """Every hook is the identity at the null parameters."""
    p = {q.name: q.null for q in parameters_in(effect, SPACE)}
    states = _tumbling()
    return _differs(_made(effect, p, BOX, states), _made(Effect(), {}, BOX, states), "in space, with all at null, {}")


def has_inverses(effect: Effect) -> str:
    """to_true undoes to_measured, and from_contact to_contact."""
    p, states = _sizes(effect, SPACE), _tumbling()
    for there, back in (("to_true", "to_measured"), ("to_contact", "from_contact")):
        returned = getattr(effect, back)(getattr(effect, there)(states, p, BOX), p, BOX)
        if why := _differs({back: returned}, {back: states}, f"in space {{}} must undo {there}, but it"):
            return why
    return ""


def has_the_plane_as_a_case(effect: Effect) -> str:
    """A motion in the plane x, z of space has the outcome that it has in the plane."""
    of_plane = _sizes(effect, PLANE)
    p = {name: of_plane.get(name, 0.0) for name in _sizes(effect, SPACE)}
    for vector in effect.vectors:  # up is y in the plane, z in space
        p[f"{vector}_y"], p[f"{vector}_z"] = 0.0, of_plane[f"{vector}_y"]
    flat = _sliding()
    expected = {hook: _embedded(hook, value) for hook, value in _made(effect, of_plane, SECTION, flat).items()}
    made = _made(effect, p, BOX, _embedded_state(flat))
    return _differs(made, expected, "for a motion in a plane of space {} differs from that in the plane: it")


def knows_no_horizontal_direction(effect: Effect) -> str:
    """Turned about the vertical, body and motion have the turned outcome."""
    if effect.along or (effect.breaks_mirror and effect.family == "surface"):
        return ""  # it counts places, or has a direction along the surface
    p, states = _sizes(effect, SPACE), _tumbling()
    made = {hook: _turned(hook, value) for hook, value in _made(effect, p, BOX, states).items()}
    return _differs(_made(effect, p, BOX, _turned_state(states)), made, "turned about the vertical, {}")


SPACE_EFFECT_CHECKS: tuple[Check[Effect], ...] = (
    Check("in space, changes nothing at its null", absent_at_null),
    Check("in space, undoes itself", has_inverses),
    Check("in space, has the plane as a case", has_the_plane_as_a_case),
    Check("in space, knows no horizontal direction", knows_no_horizontal_direction),
)


def _made(effect: Effect, p: Mapping[str, float], rig: Rig, states: State) -> Made:
    """What the hooks make of states; those that return two arrays, or none, as one array."""
    n, r = len(states), rig.lowest(states)
    mu, epsilon, tau = np.full(n, MU), np.full(n, EPSILON), np.full(n, TAU)
    at = contact(states, r, mobility(states.space, rig.G, states.attitude)).with_coefficients(mu, epsilon)
    a, after = rig.fall(states), states.with_motion(-0.5 * states.motion)
    arc = effect.arc(np.full((n, 1), 0.02), states, p, rig)
    return {
        "to_true": effect.to_true(states, p, rig),
        "to_measured": effect.to_measured(states, p, rig),
        "to_contact": effect.to_contact(states, p, rig),
        "from_contact": effect.from_contact(states, p, rig),
        "meet": effect.meet(np.zeros(a.shape), states, after, p),
        "contact_point": effect.contact_point(r, states, p, rig),
        "gap": effect.gap(np.zeros(n), states, p, rig),
        "coefficients": np.array(effect.coefficients(mu, epsilon, at, states, p, rig)),
        "contact_time": effect.contact_time(tau, at, states, p, rig),
        "acceleration": effect.acceleration(a, states, p, rig),
        "arc": np.zeros(a.shape) if arc is None else arc[:, :, 0],
    }


def _differs(made: Made, expected: Made, text: str) -> str:
    """How hooks differ from what they should give; `text` says of which, with {} for the hook."""
    for hook, value in made.items():
        other = expected[hook]
        if isinstance(value, State) and isinstance(other, State):
            apart = np.concatenate([value.space.difference(value.pose, other.pose), value.motion - other.motion])
        else:
            apart = np.asarray(value) - np.asarray(other)
        if not np.abs(apart).max(initial=0.0) < ROUNDING:
            return f"{text.format(hook)} is off by up to {np.nanmax(np.abs(apart)):.3g}"
    return ""


def _sizes(effect: Effect, space: Space) -> dict[str, float]:
    """Parameters at a size that matters, each another share of it."""
    return {p.name: p.null + (1.0 - 0.2 * i) * p.scale for i, p in enumerate(parameters_in(effect, space))}


def _tumbling() -> State:
    rng = np.random.default_rng(8)
    attitude = of_rotation_vector(rng.standard_normal((3, N)))
    place = np.concatenate([rng.uniform(-0.3, 0.3, (2, N)), BOX.height - BOX.shape.lowest(attitude)[2:]])
    motion = np.concatenate(
        [rng.uniform(-1.0, 1.0, (2, N)), -rng.uniform(1.0, 3.0, (1, N)), rng.normal(0, 8.0, (3, N))]
    )
    return State(np.concatenate([place, attitude]), motion, np.arange(N), rng.uniform(0.1, 1.0, N), space=SPACE)


def _sliding() -> State:
    """States in the plane, of the box's section across y."""
    rng = np.random.default_rng(9)
    theta = rng.uniform(-np.pi, np.pi, N)
    y = SECTION.height - SECTION.shape.contact_point(theta)[:, 1]
    v = rng.uniform(-1.0, 1.0, N), -rng.uniform(1.0, 3.0, N), rng.normal(0.0, 8.0, N)
    return State.planar(rng.uniform(-0.3, 0.3, N), y, theta, *v, np.arange(N), rng.uniform(0.1, 1.0, N))


def _embedded(hook: str, value: State | np.ndarray) -> State | np.ndarray:
    """What a hook makes in the plane, in the plane x, z of space: counter-clockwise is about −y there."""
    if isinstance(value, State):
        return _embedded_state(value)
    none = np.zeros(value.shape[-1])
    if hook == "contact_point":
        return np.stack([value[0], none, value[1]])
    if hook in ("meet", "acceleration", "arc"):
        return np.stack([value[0], none, value[1], none, -value[2], none])
    return value


def _embedded_state(state: State) -> State:
    none = np.zeros(len(state))
    attitude = of_rotation_vector(np.stack([none, -state.theta, none]))
    motion = np.stack([state.vx, none, state.vy, none, -state.omega, none])
    pose = np.concatenate([np.stack([state.x, none, state.y]), attitude])
    return State(pose, motion, state.trial, state.t, space=SPACE)


_ABOUT = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0.0], [np.sin(ANGLE), np.cos(ANGLE), 0.0], [0.0, 0.0, 1.0]])


def _turned(hook: str, value: State | np.ndarray) -> State | np.ndarray:
    if isinstance(value, State):
        return _turned_state(value)
    if hook == "contact_point":
        return _ABOUT @ value
    if hook in ("meet", "acceleration", "arc"):
        return np.concatenate([_ABOUT @ value[:3], _ABOUT @ value[3:]])
    return value


def _turned_state(state: State) -> State:
    turn = np.zeros((3, len(state)))
    turn[2] = ANGLE
    return state.changed(
        position=_ABOUT @ state.position,
        attitude=SPACE.attitude_after(state.attitude, turn),
        velocity=_ABOUT @ state.velocity,
        spin=_ABOUT @ state.spin,
    )
