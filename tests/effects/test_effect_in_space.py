"""Effects that live in space pass the checks there, and these find what is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.bodies.solids import Ellipsoid, Sphere
from thesis_lib.contact import LAWS
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Impulse, Rig
from thesis_lib.effects.length_scale import LengthScale
from thesis_lib.effects.linear_drag import LinearDrag
from thesis_lib.effects.marker_offset import MarkerOffset
from thesis_lib.extensions.contract import outcomes
from thesis_lib.extensions.effect_contract import EFFECT_CHECKS, checks_of
from thesis_lib.extensions.effect_in_space import EMBEDDED, SPACE_EFFECT_CHECKS, _of_state
from thesis_lib.extensions.effect_probe import BOX, MOMENTS, TAU, predict, random_states, tumbling_boxes
from thesis_lib.mechanics.contact import contact
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State

ELLIPSE = Rig(Ellipse(semi_axes=(0.035, 0.025)), 0.0215, 9.81, 0.2)
ELLIPSOID = replace(
    ELLIPSE, shape=Ellipsoid(semi_axes=(0.035, 0.03, 0.025)), tensor=np.diag(np.square([0.018, 0.0215, 0.024]))
)


class AlongX(LinearDrag):
    def acceleration(self, a, state, p, rig):
        slowed = a.copy()
        slowed[0] -= p["c_v"] * state.velocity[0]
        return slowed


class OneWay(MarkerOffset):
    def to_measured(self, state, p, rig):
        return state


class AlwaysThere(LinearDrag):
    def acceleration(self, a, state, p, rig):
        return a + (0.0 if state.space.is_plane else 0.01)


class OtherInSpace(LengthScale):
    def to_true(self, state, p, rig):
        made = super().to_true(state, p, rig)
        return made if state.space.is_plane else super().to_true(made, p, rig)

    def to_measured(self, state, p, rig):
        made = super().to_measured(state, p, rig)
        return made if state.space.is_plane else super().to_measured(made, p, rig)


@pytest.mark.parametrize(
    "wrong, check",
    [(AlongX(), "horizontal"), (OneWay(), "undoes"), (AlwaysThere(), "null"), (OtherInSpace(), "plane as a special")],
)
def test_a_mistake_in_space_is_found(wrong, check) -> None:
    failed = [outcome.check for outcome in outcomes(checks_of(wrong), wrong) if outcome.verdict == "FAIL"]
    assert any(check in name for name in failed)


@pytest.mark.parametrize(
    "name, of_plane, in_space, near",
    [
        ("lens", {"k_1": 0.3, "c_x": 0.1, "c_y": 0.2}, {"k_1": 0.3, "c_u": 0.1, "c_v": 0.2}, 1e-9),
        ("camera_skew", {"s": 0.05}, {"s_x": 0.05, "s_y": 0.0}, 1e-9),
        # the plane goes one round to the axes at the contact point: κ² apart
        ("curved_surface", {"kappa": 0.01, "x_0": 0.2}, {"kappa": 0.01, "x_0": 0.2, "y_0": 0.0}, 1.8e-4),
    ],
)
def test_a_motion_in_a_plane_of_space_is_predicted_as_in_the_plane(name, of_plane, in_space, near) -> None:
    effect, states = EFFECTS[name], random_states(ELLIPSE, 60, np.random.default_rng(4))
    # the camera sees the plane
    level = replace(ELLIPSOID, world=of_rotation_vector(np.array([-0.5 * np.pi, 0.0, 0.0])))
    flat = predict([(effect, of_plane)], states, ELLIPSE, TAU)
    deep = predict([(effect, in_space)], _of_state(states, EMBEDDED), level, TAU)
    without = predict([], states, ELLIPSE, TAU)
    for channel in effect.channels:
        expected = flat[channel] if channel == "touch" else (EMBEDDED[0] @ flat[channel].T).T
        # a bent flight is a difference quotient
        np.testing.assert_allclose(deep[channel], expected, atol=max(near, 1e-5) if channel == "flight" else near)
        assert np.abs(flat[channel] - without[channel]).max() > 5.0 * near


def test_a_box_hits_the_side_of_a_bowl_as_it_hits_a_ramp() -> None:
    effect, p = EFFECTS["curved_surface"], {"kappa": 0.2, "x_0": 0.1, "y_0": -0.2}
    states = tumbling_boxes(30, np.random.default_rng(3))
    seen = effect.to_contact(states, p, BOX)
    first, then = (Rotation.from_quat(state.attitude.T, scalar_first=True) for state in (states, seen))
    ramp = first * then.inv()
    place = (states.position + ramp.apply(BOX.lowest(seen).T).T)[:2].T - [0.1, -0.2]
    normal = np.stack([*(-0.2 * place.T), np.ones(30)])
    np.testing.assert_allclose(ramp.apply([0.0, 0.0, 1.0]).T, normal / np.linalg.norm(normal, axis=0), atol=1e-9)
    on_ramp, made = predict([], seen, BOX)["impact"], predict([(effect, p)], states, BOX)["impact"]
    np.testing.assert_allclose(made[:, :3], ramp.apply(on_ramp[:, :3]), atol=1e-9)
    np.testing.assert_allclose(made[:, 3:], ramp.apply(on_ramp[:, 3:]), atol=1e-7)
    assert np.abs(made - predict([], states, BOX)["impact"]).max() > 0.05


def test_a_ball_that_touches_a_bowl_has_no_gap_to_it() -> None:
    effect, radius, R, place = EFFECTS["curved_surface"], 0.03, 10.0, np.array([[0.3, -0.2], [0.1, 0.25]])
    rig = Rig(Sphere(radius=radius), 0.019, 9.81, 0.0, tensor=0.4 * radius**2 * np.eye(3))
    height = R - np.sqrt((R - radius) ** 2 - (place**2).sum(axis=0))
    pose = np.concatenate([place, height[None], [[1.0, 1.0]], np.zeros((3, 2))])
    state = State(pose, np.zeros((6, 2)), np.zeros(2), np.zeros(2), None, SPACE)
    taken = effect.gap(np.zeros(2), state, {"kappa": 1.0 / R, "x_0": 0.0, "y_0": 0.0}, rig)
    np.testing.assert_allclose(taken, rig.gap(state), rtol=0.01)
    # if it is level far away, it is a slope and not another height
    seen = state.changed(position=np.array([[0.0, 0.1], [0.0, 0.0], [radius, radius]]))
    apart = effect.gap(np.zeros(2), seen, {"kappa": 2e-3, "x_0": 1.6, "y_0": -1.0}, rig)
    np.testing.assert_allclose(apart, [0.0, -2e-3 * 1.6 * 0.1], atol=2e-5)


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_friction_in_an_ellipse_turns_the_slip_by_the_squares_of_its_axes(angle: float) -> None:
    # no coupling: dv = −K_tt M² v / |M v| dp, so that ln v_1 and ln v_2 along the axes of M fall as μ_1² to μ_2²
    a, mu, v = 0.2, 0.1, np.array([[2.0, 1.0, 2.0], [0.0, 1.5, 0.5]])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    state = State(np.eye(7, 3), np.concatenate([turn @ v, -np.ones((1, 3)), np.zeros((3, 3))]), v[0], v[0], None, SPACE)
    state = state.changed(attitude=np.eye(4)[:, :1].repeat(3, axis=1))
    r, mobility = np.array([[0.0], [0.0], [-0.03]]).repeat(3, axis=1), np.eye(3)[:, :, None].repeat(3, axis=2) / 0.02**2
    at = contact(state, r, mobility).with_coefficients(np.full(3, mu), np.full(3, 0.5))
    plain = Impulse(LAWS["anitescu_potra_newton"].impulse(at, at.mu, at.epsilon), np.zeros((3, 3)))
    p = {"a_c": a * np.cos(2.0 * angle), "a_s": a * np.sin(2.0 * angle)}
    made = EFFECTS["anisotropic_friction"].impulse(plain, at, state, p, BOX)
    after = turn.T @ at.velocity_after(*made.c)[:2]
    c = turn.T @ np.array(made.c)[:2]
    assert c[:, 0] == pytest.approx([-mu * (1.0 + a) * 1.5, 0.0], abs=1e-9)
    fallen = np.log(after[:, 1:] / v[:, 1:])
    np.testing.assert_allclose(fallen[0] / fallen[1], (1.2 / 0.8) ** 2, rtol=0.03)
    # of all impulses in the ellipse the first slip gets the one that takes most energy
    np.testing.assert_array_less((c * v).sum(axis=0), mu * -1.5 * np.hypot(1.2 * v[0], 0.8 * v[1]) * 0.98)


def test_turned_axes_of_inertia_are_those_of_a_turned_body() -> None:
    effect = EFFECTS["inertia_axes"]
    made = effect.inertia(BOX.G, {"b_x": 0.0, "b_y": 0.0, "b_z": 0.3})[:, :, 0]
    Q = Rotation.from_rotvec([0.0, 0.0, 0.3]).as_matrix()
    np.testing.assert_allclose(made, Q @ MOMENTS @ Q.T, atol=1e-15)
    assert len(effect.unseen(BOX)) == 0
    rod = replace(BOX, tensor=np.diag([1e-4, 3e-4, 3e-4]))
    np.testing.assert_allclose(np.abs(effect.unseen(rod)), [[1.0, 0.0, 0.0]], atol=1e-12)
    assert effect.applies_to(rod) and not effect.applies_to(replace(BOX, tensor=1e-4 * np.eye(3)))


def test_the_softer_face_has_the_longer_contact() -> None:
    effect, p = EFFECTS["orientation_dependent_contact_time"], {"a_x": 0.0, "a_y": 0.0, "a_z": 0.5}
    faces = of_rotation_vector(np.array([[0.0, np.pi, 0.5 * np.pi], [0.0] * 3, [0.0] * 3]))
    state = State(np.concatenate([np.zeros((3, 3)), faces]), np.zeros((6, 3)), np.zeros(3), np.zeros(3), None, SPACE)
    tau = effect.contact_time(np.ones(3), contact(state, BOX.lowest(state), np.eye(3)[:, :, None]), state, p, BOX)
    np.testing.assert_allclose(tau, np.exp([-0.5, 0.5, 0.0]), rtol=1e-12)


def test_stronger_gravity_keeps_its_direction_on_a_slope() -> None:
    rig, state = replace(BOX, down=np.array([0.28, 0.0, -0.96])), tumbling_boxes(5, np.random.default_rng(6))
    fall = rig.fall(state)
    made = EFFECTS["wrong_gravity"].acceleration(fall, state, {"dg": 0.5}, rig)
    np.testing.assert_allclose(made[:3], (1.0 + 0.5 / rig.gravity) * fall[:3], rtol=1e-12)
    np.testing.assert_array_equal(made[3:], fall[3:])


def test_effects_of_the_plane_are_not_asked_and_those_of_space_are() -> None:
    assert checks_of(EFFECTS["surface_patch"]) == EFFECT_CHECKS
    in_space = [effect for effect in EFFECTS.values() if 3 in effect.dimensions]
    assert all(checks_of(effect)[-len(SPACE_EFFECT_CHECKS) :] == SPACE_EFFECT_CHECKS for effect in in_space)
