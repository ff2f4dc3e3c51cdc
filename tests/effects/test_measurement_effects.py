"""Effects of the camera: what it makes of a true drop, and that it changes nothing of it."""

import numpy as np
import pytest
from hand_cases import DISK, EXACT, RADIUS, at_rest, on
from stage_predictor import predict

from thesis_lib.contact import LAWS
from thesis_lib.contact.space import residual_couple
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.effects.effect import Reference, Rig

FLOWN = 2e-8  # m; the acceleration is a difference quotient, good to 1e-6 of ω² |d|


def test_mirrored_rotation_twice_is_identity(quadrilateral) -> None:
    rig, states = quadrilateral
    effect, p = on("mirrored_rotation", mirrored=1.0)[0]
    once = effect.to_true(states, p, rig)
    np.testing.assert_array_equal(once.omega, -states.omega)
    twice = effect.to_true(once, p, rig)
    for name in ("pose", "motion", "trial", "t"):
        np.testing.assert_array_equal(getattr(twice, name), getattr(states, name))


def test_mirrored_rotation_looks_like_a_huge_couple() -> None:
    # a disk: Δω has the wrong sign, so τ = −2 k² Δω_true = 2 r_y c_t with c = Δv
    state = at_rest(vx=1.0, vy=-2.0, omega=4.0)
    made = predict(on("mirrored_rotation", mirrored=1.0), state, DISK)
    dv = made.impact - [[1.0, -2.0, 4.0]]
    couple = residual_couple(dv, np.array([[0.0, -RADIUS]]), mass=1.0, k_g=DISK.k_g)
    np.testing.assert_allclose(couple, 2 * -RADIUS * made.impulse.c_t, rtol=1e-9)
    assert abs(couple[0]) > 1e-3


@pytest.mark.parametrize(
    "name, p",
    [
        ("length_scale", {"s_L": 0.03}),
        ("angle_offset", {"d_theta": 0.05}),
        ("time_lag", {"lag": 3e-3}),
        ("mirrored_rotation", {"mirrored": 1.0}),
        ("sensor_drift", {"d_x": 0.2}),
        ("marker_offset", {"d_x": 4e-3, "d_y": -3e-3}),
    ],
)
def test_a_fault_of_the_camera_does_not_change_the_drop(name: str, p: dict, quadrilateral) -> None:
    # a true drop seen through a faulty camera is predicted exactly by the model that knows the fault
    rig, states = quadrilateral
    effect, p = on(name, **p)[0]
    after = states.with_motion(predict([], states, rig).impact.T)
    seen_before, seen_after = (effect.to_measured(state, p, rig) for state in (states, after))
    made = predict([(effect, p)], seen_before, rig)
    np.testing.assert_allclose(made.impact, seen_after.v, atol=1e-10)
    np.testing.assert_allclose(made.touch, 0.0, atol=EXACT)  # `states` touch
    np.testing.assert_allclose(made.meet, seen_after.q - seen_before.q, atol=EXACT)
    assert np.abs(predict([], seen_before, rig).impact - seen_after.v).max() > 1e-2


def test_time_lag_is_the_angle_of_an_earlier_instant() -> None:
    effect, p = on("time_lag", lag=2e-3)[0]
    seen = effect.to_measured(at_rest(theta=0.5, omega=10.0), p, DISK)
    np.testing.assert_allclose(seen.theta, 0.5 - 10.0 * 2e-3)


def test_drift_is_the_integral_of_its_velocity() -> None:
    effect, p = on("sensor_drift", d_x=0.1)[0]
    seen = effect.to_measured(at_rest(x=1.0, vx=2.0, t=0.5), p, DISK)
    np.testing.assert_allclose([seen.x[0], seen.vx[0]], [1.05, 2.1])
    unknown = effect.to_measured(at_rest(x=1.0, vx=2.0, t=np.nan), p, DISK)
    np.testing.assert_allclose([unknown.x[0], unknown.vx[0]], [1.0, 2.1])


def test_length_scale_is_about_the_surface() -> None:
    rig = Rig(DISK.shape, DISK.k_g, 9.81, 0.5)
    effect, p = on("length_scale", s_L=0.1)[0]
    seen = effect.to_measured(at_rest(x=1.0, y=0.7, vx=2.0, vy=-3.0, omega=5.0), p, rig)
    values = [seen.x[0], seen.y[0], seen.vx[0], seen.vy[0], seen.omega[0]]
    np.testing.assert_allclose(values, [1.1, 0.72, 2.2, -3.3, 5.0])


def test_a_marker_off_the_centre_flies_as_the_rigid_body_turns(quadrilateral) -> None:
    # the centre flies a parabola and the body turns evenly: the path of the marker, sampled, against the effect
    rig, states = quadrilateral
    effect, p = on("marker_offset", d_x=4e-3, d_y=-3e-3)[0]
    model, values = Model(LAWS["mirtich"], (effect,)), {f"marker_offset.{name}": value for name, value in p.items()}
    seen = effect.to_measured(states, p, rig)
    fall = np.tile([0.0, -rig.gravity, 0.0], (len(states.x), 1))
    tau = np.linspace(-0.05, 0.05, 9)
    path = bind(model, values, rig).path(np.tile(tau, (len(states.x), 1)), seen)
    for k, h in enumerate(tau):
        true = effect.to_measured(states.flown(fall, h), p, rig).q
        np.testing.assert_allclose(path[:, k], true, atol=FLOWN)


def test_marker_and_centre_of_mass_have_the_same_flight_and_other_impacts(quadrilateral) -> None:
    rig, states = quadrilateral
    marker, mass = (on("marker_offset", d_x=3e-3, d_y=-2e-3), on("com_offset", c_x=-3e-3, c_y=2e-3))
    one, other = (predict(active, states, rig) for active in (marker, mass))
    np.testing.assert_allclose(one.flight, other.flight, atol=1e-2)  # central differences over 1 ms
    assert np.abs(one.impact - other.impact).max() > 0.1 and np.abs(one.touch - other.touch).max() > 1e-3


def test_a_camera_rolled_over_a_level_surface_shows_gravity_oblique_and_one_before_a_slope_upright(
    quadrilateral,
) -> None:
    rig, states = quadrilateral
    shown = {}
    for roll, slope in ((0.1, 0.0), (0.0, 0.1), (-0.1, 0.1)):
        effect, p = on("camera_pose", roll=roll, slope=slope, h=0.0)[0]
        model, values = Model(LAWS["mirtich"], (effect,)), {f"camera_pose.{name}": value for name, value in p.items()}
        shown[roll, slope] = bind(model, values, rig).acceleration(states)[0] / rig.gravity
    np.testing.assert_allclose(shown[0.1, 0.0][:2], [np.sin(0.1), -np.cos(0.1)], rtol=1e-9)
    np.testing.assert_allclose(shown[0.0, 0.1][:2], [0.0, -1.0], atol=1e-9)
    # the axes of the picture are those of the surface: what surface_tilt says of its negative angle
    tilted = predict(on("surface_tilt", phi=-0.1), states, rig).flight[0] / rig.gravity
    np.testing.assert_allclose(shown[-0.1, 0.1], tilted, atol=1e-9)


def test_a_level_line_of_the_surface_rises_in_the_picture_by_roll_and_slope() -> None:
    rig = Rig(DISK.shape, DISK.k_g, 9.81, 0.5, reference=Reference(x=2.0))
    effect, p = on("camera_pose", roll=0.02, slope=0.03, h=1e-3)[0]
    left, right = (effect.to_measured(at_rest(x=x, y=0.5), p, rig) for x in (2.0, 3.0))
    np.testing.assert_allclose([left.x[0], left.y[0], left.theta[0]], [2.0, 0.501, 0.05], rtol=1e-12)
    np.testing.assert_allclose((right.y - left.y) / (right.x - left.x), np.tan(0.05), rtol=1e-12)


def test_a_lens_enlarges_by_the_square_of_the_distance_and_turns_no_square() -> None:
    rig = Rig(DISK.shape, DISK.k_g, 9.81, 0.1, reference=Reference(x=1.0))
    effect, p = on("lens", k_1=0.16, c_x=0.2, c_y=0.4)[0]  # the centre is at (1.2, 0.5)
    seen = effect.to_measured(at_rest(x=1.2, y=0.25, vx=1.0, vy=1.0, omega=3.0), p, rig)
    np.testing.assert_allclose([seen.x[0], seen.y[0]], [1.2, 0.5 - 0.25 * 1.01], rtol=1e-12)
    # across the radius by k r², along it three times as much, and no turn
    np.testing.assert_allclose([seen.vx[0], seen.vy[0], seen.omega[0]], [1.01, 1.03, 3.0], rtol=1e-12)


def test_what_a_barrel_lens_folds_stays_in_order() -> None:
    rig = Rig(DISK.shape, DISK.k_g, 9.81, 0.0)
    effect, p = on("lens", k_1=-1.0, c_x=0.0, c_y=0.0)[0]
    true = at_rest(x=np.linspace(0.0, 3.0, 50))
    seen = effect.to_measured(true, p, rig).x
    assert (np.diff(seen) > 0.0).all()
    np.testing.assert_allclose(effect.to_true(true.moved(x=seen), p, rig).x, true.x, atol=1e-6)
