"""Contract of an effect in space: the plane is a special case, and no horizontal direction is special.

Each check calls the hooks of the effect for states of a box; effects of the plane alone are not checked.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.effects.effect import Effect, Impulse, Rig, parameters_in, values_in_space
from thesis_lib.extensions.contract import Check
from thesis_lib.extensions.effect_probe import BOX, HALF, MOMENTS, RECORDED_BOX, differs, hook_calls, tumbling_boxes
from thesis_lib.mechanics.space import PLANE, SPACE, Space, multiplied, of_rotation_vector
from thesis_lib.mechanics.state import State

N = 60
ROUNDING = 1e-11  # of numbers of order 1 to 10 that a few turns have passed
_SIDES = ((HALF[0], HALF[2]), (-HALF[0], HALF[2]), (-HALF[0], -HALF[2]), (HALF[0], -HALF[2]))
SECTION = Rig(Polygon(vertices=_SIDES), float(np.sqrt(MOMENTS[1, 1])), 9.81, 0.2)
ANGLE = 0.7  # rad, about the vertical
_ABOUT = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0.0], [np.sin(ANGLE), np.cos(ANGLE), 0.0], [0.0, 0.0, 1.0]])
Made = dict[str, object]
# map of motions, a matrix (6, d + turns), and function for the attitude (4, n) of the mapped states
Move = tuple[np.ndarray, Callable[[State], np.ndarray]]
# from the plane into the plane x, z of space: counter-clockwise rotation is about −y there
EMBEDDED: Move = (
    np.array([[1, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, -1], [0, 0, 0]], float),
    lambda state: of_rotation_vector(np.outer([0.0, -1.0, 0.0], state.theta)),
)
ABOUT_VERTICAL: Move = (
    np.kron(np.eye(2), _ABOUT),
    lambda state: SPACE.attitude_after(state.attitude, np.outer([0.0, 0.0, ANGLE], np.ones(len(state)))),
)


def has_the_plane_as_a_case(effect: Effect) -> str:
    """Check that a motion in the plane x, z of space has the same outcome as in the plane."""
    if PLANE.dimension not in effect.dimensions:
        return ""
    of_plane = _sizes(effect, PLANE)
    if effect.own_in_space:
        seen = {source for _, source, _ in effect.embedded}
        of_plane = {q.name: of_plane[q.name] if q.name in seen else q.null for q in effect.parameters}
    p = values_in_space(effect, of_plane)
    flat = _sliding()
    expected = _carried(_made(effect, of_plane, SECTION, flat), EMBEDDED)
    made = _made(effect, p, BOX, _of_state(flat, EMBEDDED))
    return _differs(made, expected, "for a motion in a plane of space, {} differs from its value in the plane: it")


def knows_no_horizontal_direction(effect: Effect) -> str:
    """Check that a rotation about the vertical of body, motion, axes of the recording and all directions along the
    surface rotates the outcome."""
    if effect.breaks_mirror and effect.family == "surface" and not effect.level:
        return ""  # its direction along the surface is not a vector
    p, states = _sizes(effect, SPACE), tumbling_boxes(N, np.random.default_rng(8))
    back = of_rotation_vector(np.array([0.0, 0.0, -ANGLE]))
    recorded = RECORDED_BOX.recorded
    assert recorded is not None
    recorded = replace(recorded, turn=_ABOUT @ recorded.turn)
    p_there = dict(p)
    for one, other, times in effect.level:
        sin, cos = np.sin(times * ANGLE), np.cos(times * ANGLE)
        p_there[one], p_there[other] = cos * p[one] - sin * p[other], sin * p[one] + cos * p[other]
    there = replace(RECORDED_BOX, world=multiplied(np.asarray(RECORDED_BOX.world), back), recorded=recorded)
    turned = _made(effect, p_there, there, _of_state(states, ABOUT_VERTICAL))
    expected = _carried(_made(effect, p, RECORDED_BOX, states), ABOUT_VERTICAL)
    return _differs(turned, expected, "rotated about the vertical, {}")


SPACE_EFFECT_CHECKS: tuple[Check[Effect], ...] = (
    Check("in space, has the plane as a special case", has_the_plane_as_a_case),
    Check("in space, prefers no horizontal direction", knows_no_horizontal_direction),
)


def _made(effect: Effect, p: Mapping[str, float], rig: Rig, states: State) -> Made:
    """Results of the hooks for states, except `inertia`, of which a body in the plane has only one component."""
    calls = hook_calls(effect, p, rig, states, given=0.0)
    arc = effect.arc(np.full((len(states), 1), 0.02), states, p, rig)
    made: Made = {hook: value for hook, (_, value) in calls.items() if hook != "inertia"}
    return made | {"arc": 0.0 * states.motion if arc is None else arc[:, :, 0]}


def _differs(made: Made, expected: Made, text: str) -> str:
    """Description of the first hook with an unexpected result; `text` introduces it, with {} for the hook."""
    found = ((hook, differs(value, expected[hook], 0.0, ROUNDING)) for hook, value in made.items())
    return next((f"{text.format(hook)} {why}" for hook, why in found if why), "")


def _sizes(effect: Effect, space: Space) -> dict[str, float]:
    """Parameters at a relevant size, each with a different fraction of its scale."""
    return {p.name: p.null + (1.0 - 0.2 * i) * p.scale for i, p in enumerate(parameters_in(effect, space))}


def _sliding() -> State:
    """States in the plane, for the section of the box across y."""
    rng = np.random.default_rng(9)
    theta = rng.uniform(-np.pi, np.pi, N)
    r_x, r_y = SECTION.shape.contact_point(theta).T
    y, omega = SECTION.height - r_y, rng.normal(0.0, 8.0, N)
    v = rng.uniform(-1.0, 1.0, N), -rng.uniform(1.0, 3.0, N) - r_x * omega, omega
    return State.planar(rng.uniform(-0.3, 0.3, N), y, theta, *v, np.arange(N), rng.uniform(0.1, 1.0, N))


def _of_state(state: State, move: Move) -> State:
    twist, attitude = move
    pose = np.concatenate([twist[:3, : len(state.position)] @ state.position, attitude(state)])
    return State(pose, twist @ state.motion, state.trial, state.t, space=SPACE)


def _carried(made: Made, move: Move) -> Made:
    """Results of the hooks, mapped by `move`."""
    found, (twist, _) = dict(made), move
    for hook, value in made.items():
        if isinstance(value, State):
            found[hook] = _of_state(value, move)
        elif isinstance(value, Impulse):
            both = twist @ np.concatenate([np.array(value.c), np.atleast_2d(value.couple)])
            found[hook] = Impulse(both[:3], both[3:])
        elif hook == "contact_point":
            r = np.asarray(value)
            found[hook] = twist[:3, : len(r)] @ r
        elif hook in ("meet", "acceleration", "arc"):
            found[hook] = twist @ np.asarray(value)
        elif hook == "sliding" and np.asarray(value).ndim == 3:  # the matrix of an ellipse
            found[hook] = np.einsum("ij,jkn,lk->iln", twist[:2, :2], np.asarray(value), twist[:2, :2])
    return found
