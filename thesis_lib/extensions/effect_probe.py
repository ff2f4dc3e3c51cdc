"""Test bodies in contact, for the checks of effects: results of each hook, and predictions of the critique's model.

In the plane the bodies are a quadrilateral without symmetry and an ellipse, in space a box.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.bodies.solids import Box
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.contacts.model import Model
from thesis_lib.effects.effect import Effect, Impulse, Rig, parameters_in
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.mechanics.contact import contact
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import PLANE, SPACE, Space, cross, of_rotation_vector, rotation_matrix
from thesis_lib.mechanics.state import State

MU, EPSILON = 0.25, 0.55
TAU = 5e-4  # s, for a contact of one millisecond
# no symmetry: a mirrored or rotated body touches with another corner
QUADRILATERAL = Polygon(vertices=((0.035, 0.03), (-0.03, 0.028), (-0.036, -0.03), (0.025, -0.033)))
RIGS = {
    "quadrilateral": Rig(QUADRILATERAL, QUADRILATERAL.radius_of_gyration, 9.81, 0.2),
    "ellipse": Rig(Ellipse(semi_axes=(0.035, 0.025)), 0.0215, 9.81, 0.0),
}
HALF = (0.03, 0.02, 0.015)  # m
MOMENTS = np.diag([HALF[1] ** 2 + HALF[2] ** 2, HALF[0] ** 2 + HALF[2] ** 2, HALF[0] ** 2 + HALF[1] ** 2]) / 3.0
BOX = Rig(Box(half_extents=HALF), float(np.sqrt(np.trace(MOMENTS) / 3.0)), 9.81, 0.2, tensor=MOMENTS)
# as recorded: tracked frame at an arbitrary place on the body, axes of the recording rotated relative to the surface
_TURNS = of_rotation_vector(np.array([[0.4, -1.0], [-0.7, 0.5], [1.1, 0.3]]))
_FRAMES = WholeTosses(
    trial=np.repeat(np.arange(100), 2),
    t=np.tile([0.0, 1.0], 100),
    turn=np.outer([1.0, -2.0, 1.5], np.tile([0.0, 1.0], 100)),
    touched=np.full(100, 0.5),
)
RECORDED_BOX = replace(
    BOX, tracked=Frame(np.array([0.02, -0.01, 0.03]), _TURNS[:, 0]), world=_TURNS[:, 1], recorded=_FRAMES
)
Active = Sequence[tuple[Effect, Mapping[str, float]]]
Calls = dict[str, tuple[tuple[object, ...], object]]


def null(effect: Effect, space: Space = PLANE, mu: float = MU) -> dict[str, float]:
    """Parameters at which the effect is absent from a law with friction `mu`."""
    return {p.name: p.absent_at({"mu": mu}) for p in parameters_in(effect, space)}


def at_scale(effect: Effect, space: Space = PLANE) -> dict[str, float]:
    """Parameters one `scale` above their null, a relevant size."""
    return {p.name: p.null + p.scale for p in parameters_in(effect, space)}


def random_states(rig: Rig, n: int, rng: np.random.Generator) -> State:
    """States of bodies that touch the surface and approach it at 0.8 to 3.3 m/s, with slip in either direction."""
    theta, omega = rng.uniform(-np.pi, np.pi, n), rng.uniform(-15.0, 15.0, n)
    r = rig.shape.contact_point(theta)
    return State.planar(
        x=rng.uniform(-0.3, 0.3, n),
        y=rig.height - r[:, 1],
        theta=theta,
        vx=rng.uniform(-1.5, 1.5, n),
        vy=-rng.uniform(0.8, 3.3, n) - r[:, 0] * omega,
        omega=omega,
        trial=np.arange(n),
        t=rng.uniform(0.1, 1.0, n),
    )


def tumbling_boxes(n: int, rng: np.random.Generator) -> State:
    """States of the box in space: it touches the surface at all attitudes, spins, and approaches at 1 to 3 m/s."""
    attitude = of_rotation_vector(rng.standard_normal((3, n)))
    r = BOX.shape.lowest(attitude)
    place = np.concatenate([rng.uniform(-0.3, 0.3, (2, n)), BOX.height - r[2:]])
    fall = np.concatenate([rng.uniform(-1.0, 1.0, (2, n)), -rng.uniform(1.0, 3.0, (1, n)), rng.normal(0, 8.0, (3, n))])
    fall[2] -= cross(fall[3:], r)[2]
    return State(np.concatenate([place, attitude]), fall, np.arange(n), rng.uniform(0.1, 1.0, n), space=SPACE)


def hook_calls(effect: Effect, p: Mapping[str, Any], rig: Rig, states: State, given: float = 1.0) -> Calls:
    """Leading arguments and result of each hook of an effect, by the name of the hook.

    `given` is the size of the arguments that do not follow from the states: jump, gap, and acceleration beyond gravity.
    """
    n, space, r = len(states), states.space, rig.lowest(states)
    mu, epsilon, tau = np.full(n, MU), np.full(n, EPSILON), np.full(n, TAU)
    at = contact(states, r, mobility(space, rig.G, states.attitude)).with_coefficients(mu, epsilon)
    after = states.with_motion(-EPSILON * states.motion)
    sticks = Impulse(at.impulse_to(*np.zeros(space.dimension)), np.zeros(n if space.is_plane else (3, n)))
    shape, G = states.motion.shape, rig.G
    jump, gap = np.full(shape, 0.3 * given), np.full(n, 0.2 * given)
    a = rig.fall(states) + given * np.random.default_rng(3).standard_normal(shape)
    return {
        "to_true": ((states,), effect.to_true(states, p, rig)),
        "to_measured": ((states,), effect.to_measured(states, p, rig)),
        "meet": ((jump,), effect.meet(jump, states, after, p)),
        "to_contact": ((states,), effect.to_contact(states, p, rig)),
        "from_contact": ((states,), effect.from_contact(states, p, rig)),
        "contact_point": ((r,), effect.contact_point(r, states, p, rig)),
        "gap": ((gap,), effect.gap(gap, states, p, rig)),
        "inertia": ((G,), effect.inertia(G, p)),
        "contact_time": ((tau,), effect.contact_time(tau, at, states, p, rig)),
        "coefficients": ((mu, epsilon), effect.coefficients(mu, epsilon, at, states, p, rig)),
        "sliding": ((mu,), effect.sliding(mu, at, states, p, rig)),
        "impulse": ((sticks,), effect.impulse(sticks, at, states, p, rig)),
        "acceleration": ((a,), effect.acceleration(a, states, p, rig)),
    }


def flat(value: object) -> list[np.ndarray]:
    """List of all arrays in an argument or a result of a hook."""
    if isinstance(value, State):
        attitude = value.attitude if value.space.is_plane else rotation_matrix(value.attitude)
        return [value.position, attitude, value.motion, value.trial, value.t]
    if isinstance(value, Impulse):
        return [*value.c, value.couple]
    if isinstance(value, tuple):
        return [array for part in value for array in flat(part)]
    return [np.asarray(value)]


def differs(made: object, expected: object, rtol: float, atol: float = 0.0) -> str:
    """Description of how the result of a hook differs from the expected result; "" if it does not."""
    ours, theirs = flat(made), flat(expected)
    if len(ours) != len(theirs):
        return f"returns {len(ours)} array(s) instead of {len(theirs)}"
    for one, other in zip(ours, theirs):
        if one.dtype.kind not in "fiu":
            return f"returns {one.dtype} instead of numbers"
        if one.shape != other.shape:
            return f"returns an array of shape {one.shape} instead of {other.shape}"
        if not np.allclose(one, other, rtol=rtol, atol=atol):
            return f"is off by up to {np.nanmax(np.abs(one - other)):.3g}"
    return ""


def predict(active: Active, measured: State, rig: Rig, contact_time: float = 0.0) -> dict[str, np.ndarray]:
    """Prediction of the critique's model in each channel, from measured states before the impact.

    impact: velocity after it; meet: jump of the pose; flight: acceleration, (n, d + turns) each; touch: gap (n,) at it;
    slide: acceleration (n,), in space (n, 2), along the surface if the body were supported.
    Effects act in the order of `in_order`, whatever the order of `active`; `contact_time` is τ in s.
    """
    of_active = tuple(effect for effect, _ in active)
    model = Model(LAWS["anitescu_potra_newton"], of_active, contact_time > 0.0, space=measured.space)
    values = {"mu": MU, "epsilon": EPSILON, "tau": contact_time}
    values |= {f"{effect.name}.{name}": value for effect, p in active for name, value in p.items()}
    dynamics = Dynamics(model, values, rig)
    after, depth = dynamics.strike(measured)
    return {
        "impact": after.v,
        "meet": dynamics.jump(measured, after),
        "touch": dynamics.gap(dynamics.to_true(measured)) + depth,
        "flight": dynamics.acceleration(measured),
        "slide": dynamics.sliding(dynamics.to_true(measured)).T,
    }
