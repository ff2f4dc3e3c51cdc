"""Contact times and patches: what an integrated spring does, shapes in their limits, places on surface and body."""

import numpy as np
import pytest
from hand_cases import EXACT, HALF, SQUARE, at_rest, on

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.effects.contact_place import along_surface, around_body
from thesis_lib.effects.effect import Effect, Rig
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.state import State

INTEGRATED = 2e-3  # relative, of 4,000 steps
CORNERS = np.pi / 4.0 * np.array([1.0, 3.0, 5.0, 7.0])


def space(v_n: float, K_nn: float) -> Contact:
    return Contact.planar(*(np.array([a]) for a in (0.0, v_n, 1.0, K_nn, 0.0)))


def centroid(mass: float, speed: float, exponent: float) -> float:
    """Time from touch to the centroid of the impulse of a mass that hits the spring k δⁿ, k = 1, in s."""
    depth, rate, t, impulse, moment = 0.0, speed, 0.0, 0.0, 0.0
    dt = (mass * speed ** (1.0 - exponent)) ** (1.0 / (exponent + 1.0)) / 1000.0
    while depth >= 0.0:
        depth += 0.5 * dt * rate
        force = max(depth, 0.0) ** exponent
        t, rate = t + dt, rate - dt * force / mass
        impulse, moment = impulse + force, moment + force * (t - 0.5 * dt)
        depth += 0.5 * dt * rate
    return moment / impulse


@pytest.mark.parametrize("exponent", [0.8, 1.5, 2.0])
def test_a_spring_that_stiffens_is_faster_in_faster_impacts(exponent: float) -> None:
    effect, p = on("velocity_dependent_contact_time", p=(exponent - 1.0) / (exponent + 1.0))[0]
    reference = centroid(1.0, 1.0, exponent)
    for K_nn, speed in ((1.0, 0.3), (1.0, 3.0), (2.5, 1.0), (4.0, 2.0)):
        tau = effect.contact_time(np.full(1, reference), space(-speed, K_nn), at_rest(), p, SQUARE)
        # the model divides by the root of K_nn, as for a linear spring
        assert tau[0] / np.sqrt(K_nn) == pytest.approx(centroid(1.0 / K_nn, speed, exponent), rel=INTEGRATED)


def time(name: str, state: State, **p: float) -> float:
    effect, values = on(name, **p)[0]
    return float(effect.contact_time(np.full(1, 2.0), space(-1.0, 1.0), state, values, SQUARE)[0])


def test_contact_time_follows_the_place_of_the_contact_point() -> None:
    # a square on its corner: the contact point is below the origin; tipped by a bit, half a diagonal turns beside it
    tipped = at_rest(x=0.2, theta=np.pi / 4.0 - 0.1)
    aside = 0.2 - HALF * np.sqrt(2.0) * np.sin(0.1)
    assert along_surface(tipped, SQUARE)[0] == pytest.approx(aside)
    assert time("position_dependent_contact_time", tipped, g_tau=0.5) == pytest.approx(2.0 / np.sqrt(1.0 - aside))
    # a stiffness that is linear in place: four times that of the reference there, and never below a tenth of it
    assert time("position_dependent_contact_time", at_rest(x=-3.0), g_tau=0.5) == pytest.approx(1.0, rel=0.01)
    assert time("position_dependent_contact_time", at_rest(x=3.0), g_tau=0.5) == pytest.approx(2.0 / np.sqrt(0.1))


def test_two_harmonics_give_each_corner_of_a_square_its_own_time() -> None:
    wanted = np.array([1.0, 0.4, 1.3, 0.9])
    columns = [np.ones(4), np.cos(CORNERS), np.sin(CORNERS), np.sin(2.0 * CORNERS)]
    tau, a_c, a_s, b_s = np.linalg.solve(np.stack(columns, axis=1), np.log(wanted))
    for corner, time_there in zip(CORNERS, wanted):
        state = at_rest(theta=-np.pi / 2.0 - corner + 0.05)  # this corner is the lowest
        assert np.cos(around_body(state, SQUARE)[0] - corner) == pytest.approx(1.0)
        factor = time("orientation_dependent_contact_time", state, a_c=a_c, a_s=a_s, b_s=b_s) / 2.0
        assert np.exp(tau) * factor == pytest.approx(time_there)


def patch(x: np.ndarray, **p: float) -> np.ndarray:
    """P at the places x (n,), from what it makes of ε."""
    states = at_rest(x=x - along_surface(at_rest(), SQUARE))
    effect, values = on("surface_patch", h_eps=1.0, **p)[0]
    return effect.coefficients(np.full_like(x, 0.2), np.full_like(x, 0.3), None, states, values, SQUARE)[1] / 0.3 - 1.0


def test_limits_of_a_patch() -> None:
    x = np.linspace(-0.5, 0.7, 241)
    flat = patch(x, x_1=0.1, x_2=0.3, w=2e-3)
    np.testing.assert_allclose(flat[np.abs(x - 0.2) < 0.09], 1.0, atol=1e-4)
    np.testing.assert_allclose(flat[np.abs(x - 0.2) > 0.11], 0.0, atol=1e-4)
    np.testing.assert_allclose(patch(np.array([0.1, 0.3]), x_1=0.1, x_2=0.3, w=2e-3), 0.5, atol=EXACT)
    # an edge beyond all places leaves a step, edges on top of each other a bump
    step = patch(x, x_1=0.1, x_2=9.0, w=0.05)
    np.testing.assert_allclose(step, 0.5 * (1.0 + np.tanh((x - 0.1) / 0.05)), atol=EXACT)
    np.testing.assert_allclose(patch(x, x_1=0.1, x_2=0.1, w=0.05), np.cosh((x - 0.1) / 0.05) ** -2, atol=EXACT)
    np.testing.assert_array_equal(patch(x, x_1=0.3, x_2=-0.1, w=0.05), patch(x, x_1=-0.1, x_2=0.3, w=0.05))


def test_a_patch_changes_all_three_and_keeps_them_physical() -> None:
    effect, p = on("surface_patch", h_eps=2.0, h_mu=-1.0, h_tau=0.5, x_1=-1.0, x_2=1.0)[0]
    state, there = at_rest(), space(-1.0, 1.0)
    mu, epsilon = effect.coefficients(np.full(1, 0.2), np.full(1, 0.5), there, state, p, SQUARE)
    assert mu[0] == pytest.approx(0.0, abs=EXACT) and epsilon[0] == 1.0
    assert effect.contact_time(np.full(1, 2.0), there, state, p, SQUARE)[0] == pytest.approx(3.0)


def test_starts_of_a_patch_are_where_the_body_has_hit() -> None:
    x = np.random.default_rng(4).uniform(3.0, 3.4, 60)
    found = on("surface_patch")[0][0].shapes(at_rest(x=x), SQUARE)
    assert all(shape["x_1"] < shape["x_2"] and shape["w"] > 0.0 for shape in found)
    inside = [((x > shape["x_1"]) & (x < shape["x_2"])).mean() for shape in found]
    assert min(inside) > 0.05 and max(inside) < 0.8
    assert not Effect.shapes(on("wear")[0][0], at_rest(), SQUARE)


@pytest.mark.parametrize("kind", ["ellipse", "square"])
def test_a_soft_body_is_pressed_in_the_middle_of_its_chord(kind) -> None:
    theta, omega, lam = 0.6, 30.0, 5e-4
    shape = Ellipse(semi_axes=(0.035, 0.025)) if kind == "ellipse" else SQUARE.shape
    rig = Rig(shape, 0.02, 9.81, 0.0)
    effect, p = on("soft_body", lam=lam)[0]
    state = at_rest(theta=theta, vy=-2.0, omega=omega)
    lowest = rig.shape.contact_point(state.theta)
    speed = 2.0 - lowest[0, 0] * omega  # of the contact point: the spin has its share
    r_x, r_y = effect.contact_point(lowest.T, state, p, rig)
    assert r_y[0] == pytest.approx(lowest[0, 1] + lam * speed)
    # the ends of the chord: points of the outline at that height
    outline = shape.outline(400_001)
    x, y = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]]) @ outline.T
    at = np.flatnonzero(np.diff(y > r_y[0]))
    ends = x[at] + (r_y[0] - y[at]) / (y[at + 1] - y[at]) * (x[at + 1] - x[at])
    assert len(ends) == 2 and r_x[0] == pytest.approx(ends.mean(), abs=1e-6)
    # a body that leaves is not pressed
    up = at_rest(theta=theta, vy=-2.0, omega=omega + 2.0 * speed / lowest[0, 0])
    assert np.array_equal(effect.contact_point(lowest.T, up, p, rig), lowest.T)
