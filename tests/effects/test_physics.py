"""Each effect does what its equation says: cases worked out by hand.

Paths of the impulse, geometry and measurement have files of their own.
"""

import numpy as np
import pytest
from hand_cases import DISK, EXACT, RADIUS, N, at_rest, coefficients, on
from stage_predictor import predict

from thesis_lib.contact.space import contact_space
from thesis_lib.effects import EFFECTS
from thesis_lib.extensions.effect_probe import EPSILON, MU, at_scale
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.state import State


@pytest.mark.parametrize("law", ["anitescu_potra_newton", "anitescu_potra_poisson", "mirtich", "drumwright_shell"])
def test_tangential_restitution_turns_the_slip(law: str) -> None:
    state = at_rest(vx=0.2, vy=-2.0, omega=3.0)
    v_t = 0.2 + RADIUS * 3.0
    made = predict(on("tangential_restitution", e_t=0.4), state, DISK, law, mu=1.0)
    after = made.impact[0]
    np.testing.assert_allclose(after[0] + RADIUS * after[2], -0.4 * v_t, rtol=1e-9)
    np.testing.assert_allclose(after[1], 2.0 * EPSILON, rtol=1e-9)


def test_tangential_restitution_keeps_to_the_cone_and_leaves_slip(quadrilateral) -> None:
    rig, states = quadrilateral
    base, made = predict([], states, rig), predict(on("tangential_restitution", e_t=0.8), states, rig)
    slides = np.abs(base.impulse.c_t) >= MU * base.impulse.c_n * (1 - 1e-9)
    assert 0.2 < slides.mean() < 0.95
    np.testing.assert_array_equal(made.impulse.c_t[slides], base.impulse.c_t[slides])
    assert (np.abs(made.impulse.c_t) <= MU * made.impulse.c_n * (1 + EXACT)).all()
    assert (np.abs(made.impulse.c_t[~slides]) > np.abs(base.impulse.c_t[~slides])).all()


def test_tangential_restitution_leaves_slip_that_turned_inside_the_cone(quadrilateral) -> None:
    rig, states = quadrilateral
    given = {"law": "wang_mason", "mu": 0.1}
    base = predict([], states, rig, **given)
    made = predict(on("tangential_restitution", e_t=0.8), states, rig, **given)
    v_t = base.contact.velocity_after(base.impulse.c_t, base.impulse.c_n)[0]
    turned = (np.abs(base.impulse.c_t) < 0.09 * base.impulse.c_n) & (np.abs(v_t) > 1e-3)
    assert turned.sum() > 5
    np.testing.assert_array_equal(made.impulse.c_t[turned], base.impulse.c_t[turned])
    assert (made.impulse.c_t != base.impulse.c_t).any()


def test_restitution_falls_with_speed() -> None:
    assert coefficients("velocity_dependent_restitution", v_n=-2.0, p=0.25) == (0.2, 0.5 * 2**-0.25)
    assert coefficients("velocity_dependent_restitution", v_n=-1.0, p=0.25) == (0.2, 0.5)
    assert coefficients("velocity_dependent_restitution", v_n=-1e-9, p=0.9)[1] == 1.0
    assert coefficients("velocity_dependent_restitution", v_n=-2.0, c=0.1)[1] == pytest.approx(0.5 * np.exp(-0.2))


def test_exponential_restitution_follows_a_viscous_spring() -> None:
    # a spring with the factor 1 + d δ̇ (Hunt and Crossley), small dissipation: ε = 1 − 2 d v / 3, c = (1 + ε) d / 3
    d, dt = 0.02, 1e-3
    for speed in (0.5, 1.5, 3.0):
        depth, rate = 0.0, speed
        while depth >= 0.0:
            depth += 0.5 * dt * rate
            rate -= dt * depth * (1.0 + d * rate)
            depth += 0.5 * dt * rate
        effect, p = on("velocity_dependent_restitution", c=2.0 * d / 3.0)[0]
        space = Contact.planar(*(np.array([a]) for a in (0.0, -speed, 3.0, 1.0, 0.0)))
        found = effect.coefficients(np.zeros(1), np.ones(1), space, None, p, DISK)[1][0]
        assert -rate / speed == pytest.approx(found, abs=1e-3) and found < 0.995


def test_friction_depends_on_direction() -> None:
    assert coefficients("anisotropic_friction", v_t=0.1, a_t=0.1)[0] == pytest.approx(0.22)
    assert coefficients("anisotropic_friction", v_t=-0.1, a_t=0.1)[0] == pytest.approx(0.18)


def test_adhesion_takes_energy() -> None:
    assert coefficients("adhesion", v_n=-1.0, v_s=0.3)[1] == pytest.approx(0.4)
    assert coefficients("adhesion", v_n=-0.5, v_s=0.3)[1] == 0.0
    state = at_rest(vy=-1.5)
    rebound = [predict(on("adhesion", v_s=v_s), state, DISK).impact[0, 1] for v_s in (0.0, 0.4)]
    np.testing.assert_allclose(rebound[0] ** 2 - rebound[1] ** 2, 0.4**2)


def test_restitution_depends_on_the_place_on_the_body() -> None:
    name = "orientation_dependent_restitution"
    # an ellipse at θ = 0 stands on the end of its minor axis, β = −π/2
    assert coefficients(name, theta=0.0, a_c=0.1)[1] == pytest.approx(0.45)
    assert coefficients(name, theta=np.pi / 2, a_c=0.1)[1] == pytest.approx(0.55)
    up, down = (coefficients(name, theta=theta, a_s=0.2)[1] for theta in (np.pi / 4, -np.pi / 4))
    assert up > 0.5 > down and up - 0.5 == pytest.approx(0.5 - down)


def test_wear_counts_trials() -> None:
    assert coefficients("wear", trial=100.0, w=-1e-3)[1] == pytest.approx(0.45)
    assert coefficients("wear", trial=0.0, w=-1e-3)[1] == 0.5


def flight(name: str, state: State, **p: float) -> np.ndarray:
    effect, p = on(name, **p)[0]
    return effect.acceleration(np.array([[0.0], [-9.81], [0.0]]), state, p, DISK)[:, 0]


def test_surface_tilt_turns_gravity() -> None:
    for phi in (-0.3, 0.01, 0.2):
        expected = [9.81 * np.sin(phi), -9.81 * np.cos(phi), 0.0]
        np.testing.assert_allclose(flight("surface_tilt", at_rest(), phi=phi), expected, rtol=0, atol=4e-15)


def test_surface_height_is_the_gap(quadrilateral) -> None:
    rig, states = quadrilateral
    raised = states.moved(y=states.y + 2e-3)
    np.testing.assert_allclose(predict(on("surface_height", h=2e-3), raised, rig).touch, 0.0, atol=EXACT)


def test_moving_surface_carries_what_sticks(quadrilateral) -> None:
    rig, states = quadrilateral
    made = predict(on("moving_surface", V=0.5), states, rig, mu=50.0)
    r_y = rig.shape.contact_point(states.theta)[:, 1]
    np.testing.assert_allclose(made.impact[:, 0] - r_y * made.impact[:, 2], 0.5, atol=1e-10)


def test_drifting_camera_looks_like_a_moving_surface(quadrilateral) -> None:
    rig, states = quadrilateral
    drift = predict(on("sensor_drift", d_x=0.3), states, rig)
    np.testing.assert_allclose(drift.impact, predict(on("moving_surface", V=0.3), states, rig).impact, atol=1e-12)


def test_coefficients_depend_on_place() -> None:
    assert coefficients("position_dependent_friction", x=0.2, g_mu=0.5)[0] == pytest.approx(0.22)
    assert coefficients("position_dependent_friction", x=-3.0, g_mu=0.5)[0] == 0.0
    assert coefficients("position_dependent_restitution", x=-0.2, g_eps=0.5)[1] == pytest.approx(0.45)
    assert coefficients("position_dependent_restitution", x=3.0, g_eps=0.5)[1] == 1.0


def test_flight_by_hand() -> None:
    state = at_rest(vx=3.0, vy=-4.0, omega=10.0)
    np.testing.assert_allclose(flight("linear_drag", state, c_v=0.1, c_w=0.2), [-0.3, -9.41, -2.0])
    np.testing.assert_allclose(flight("quadratic_drag", state, c_q=0.1), [-1.5, -7.81, 0.0])
    np.testing.assert_allclose(flight("magnus", state, k_m=0.01), [0.4, -9.51, 0.0])
    np.testing.assert_allclose(flight("wrong_gravity", state, dg=0.1), [0.0, -9.91, 0.0])


@pytest.mark.parametrize("name", ["linear_drag", "quadratic_drag", "magnus"])
def test_power_in_flight(name: str, quadrilateral) -> None:
    rig, states = quadrilateral
    extra = EFFECTS[name].acceleration(np.zeros((3, N)), states, at_scale(EFFECTS[name]), rig).T
    power = extra[:, 0] * states.vx + extra[:, 1] * states.vy + rig.k_g**2 * extra[:, 2] * states.omega
    if name == "magnus":
        np.testing.assert_allclose(power, 0.0, atol=EXACT)
    else:
        assert (power < 0.0).all()


def test_contact_space_of_the_predictor_is_the_library_one() -> None:
    # guards the tests above: masses are 1 and lengths are metres on both sides
    state = at_rest(vx=1.0, vy=-2.0, omega=4.0)
    space = contact_space(np.array([[1.0, -2.0, 4.0]]), np.array([[0.0, -RADIUS]]), mass=1.0, k_g=DISK.k_g)
    assert predict([], state, DISK).contact.v_t == space.v_t == 1.0 + RADIUS * 4.0
