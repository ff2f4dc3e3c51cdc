"""Effects of geometry and inertia, against outlines and mass matrices found in another way."""

import numpy as np
import pytest
from hand_cases import DISK, EXACT, HALF, RADIUS, SQUARE, N, at_rest, on
from stage_predictor import predict

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.bodies.solids import Box, Ellipsoid, Sphere
from thesis_lib.contact import LAWS
from thesis_lib.contact.space import residual_couple
from thesis_lib.effects.effect import Rig
from thesis_lib.effects.soft_body import lean_in_space
from thesis_lib.extensions.effect_probe import EPSILON, MU, RIGS
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.space import SPACE, of_rotation_vector


def contact_point(name: str, rig: Rig, theta: np.ndarray, **p: float) -> np.ndarray:
    effect, p = on(name, **p)[0]
    return effect.contact_point(rig.shape.contact_point(theta).T, at_rest(theta=theta), p, rig).T


def test_rounded_corner_by_hand() -> None:
    rho = 5e-3
    r = contact_point("rounded_corners", SQUARE, np.array([np.pi / 4, 0.2]), rho=rho)
    np.testing.assert_allclose(r[0], [0.0, -(np.sqrt(2) * HALF - rho * (np.sqrt(2) - 1))], atol=EXACT)
    # at 0.2 rad the corner (−a, −a) is lowest; its arc has the centre (−a + ρ, −a + ρ)
    centre = HALF - rho
    sin, cos = np.sin(0.2), np.cos(0.2)
    np.testing.assert_allclose(r[1], [centre * (sin - cos), -centre * (sin + cos) - rho], atol=EXACT)


def test_square_rounded_as_far_as_it_goes_is_a_disk() -> None:
    theta = np.linspace(-3.0, 3.0, 50)
    r = contact_point("rounded_corners", SQUARE, theta, rho=0.05)
    np.testing.assert_allclose(r, np.tile([0.0, -HALF], (50, 1)), atol=EXACT)


def test_rounded_quadrilateral_against_its_outline() -> None:
    # outline: points of the shrunk polygon, found as the set at distance ≥ ρ from all sides, grown by ρ
    rig, rho = RIGS["quadrilateral"], 4e-3
    v = np.array(rig.shape.vertices)
    along = np.roll(v, -1, axis=0) - v
    normal = np.stack([along[:, 1], -along[:, 0]], axis=-1) / np.linalg.norm(along, axis=1)[:, None]
    reach = np.sum(normal * v, axis=1) - rho
    inner = np.array([np.linalg.solve(normal[[i - 1, i]], reach[[i - 1, i]]) for i in range(4)])
    angle = np.linspace(0, 2 * np.pi, 20001)
    outline = (inner[:, None] + rho * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).reshape(-1, 2)
    theta = np.random.default_rng(1).uniform(-np.pi, np.pi, 40)
    expected = []
    for one in theta:
        turned = outline @ np.array([[np.cos(one), np.sin(one)], [-np.sin(one), np.cos(one)]])
        expected.append(turned[np.argmin(turned[:, 1])])
    found = contact_point("rounded_corners", rig, theta, rho=rho)
    np.testing.assert_allclose(found, expected, atol=rho * angle[1])
    # order of the corners and points inside the hull do not matter
    for vertices in (rig.shape.vertices[::-1], (*rig.shape.vertices, (0.0, 0.001))):
        other = Rig(Polygon(vertices=vertices), rig.k_g, 9.81, 0.0)
        np.testing.assert_allclose(contact_point("rounded_corners", other, theta, rho=rho), found, atol=EXACT)


@pytest.mark.parametrize("name, p", [("rounded_corners", {"rho": 4e-3}), ("wrong_size", {"s": -0.05})])
def test_gap_closes_with_the_true_shape(name: str, p: dict, quadrilateral) -> None:
    # put the true body on the surface: the gap of the believed one is the gap that the effect predicts
    rig, states = quadrilateral
    r = contact_point(name, rig, states.theta, **p)
    touching = states.moved(y=rig.height - r[:, 1])
    np.testing.assert_allclose(predict(on(name, **p), touching, rig).touch, 0.0, atol=EXACT)
    assert np.abs(predict([], touching, rig).touch).max() > 1e-3


def test_contact_point_offset_is_a_lever(quadrilateral) -> None:
    rig, states = quadrilateral
    made = predict(on("contact_point_offset", d_r=1e-3), states, rig)
    believed = rig.shape.contact_point(states.theta)
    couple = residual_couple(made.impact - states.v, believed, mass=1.0, k_g=rig.k_g)
    np.testing.assert_allclose(couple, 1e-3 * made.impulse.c_n, atol=EXACT)


def mass_matrix(c: np.ndarray, k_g: float) -> np.ndarray:
    """Inertia (n, 3, 3) of a unit mass for the velocity of the origin, the centre of mass being at c (n, 2)."""
    M = np.zeros((len(c), 3, 3))
    M[:, 0, 0] = M[:, 1, 1] = 1.0
    M[:, 0, 2] = M[:, 2, 0] = -c[:, 1]
    M[:, 1, 2] = M[:, 2, 1] = c[:, 0]
    M[:, 2, 2] = k_g**2 + np.sum(c * c, axis=1)
    return M


def turned(theta: np.ndarray, c: tuple[float, float]) -> np.ndarray:
    """c in the axes of the surface, (n, 2)."""
    rotated = (c[0] + 1j * c[1]) * np.exp(1j * theta)
    return np.stack([rotated.real, rotated.imag], axis=-1)


def test_com_offset_against_the_mass_matrix_of_the_origin(quadrilateral) -> None:
    rig, states = quadrilateral
    c = turned(states.theta, (3e-3, -2e-3))
    r = rig.shape.contact_point(states.theta)
    inverse = np.linalg.inv(mass_matrix(c, rig.k_g))
    J = np.zeros((N, 2, 3))  # rows t, n
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    J[:, 0, 2], J[:, 1, 2] = -r[:, 1], r[:, 0]
    K = J @ inverse @ np.swapaxes(J, 1, 2)
    v_c = np.einsum("nij,nj->ni", J, states.v)
    space = Contact.planar(v_c[:, 0], v_c[:, 1], K[:, 0, 0], K[:, 1, 1], K[:, 0, 1])
    impulse = np.stack(LAWS["anitescu_potra_newton"].impulse(space, np.full(N, MU), np.full(N, EPSILON)), axis=-1)
    expected = states.v + np.einsum("nij,nkj,nk->ni", inverse, J, impulse)
    made = predict(on("com_offset", c_x=3e-3, c_y=-2e-3), states, rig)
    np.testing.assert_allclose(made.impact, expected, rtol=EXACT, atol=EXACT)
    assert np.abs(made.impact - predict([], states, rig).impact).max() > 0.1


def test_com_offset_in_flight_against_lagrange(quadrilateral) -> None:
    # M a = generalised gravity + ω² c, with a spin that something else damps (α given)
    rig, states = quadrilateral
    c = turned(states.theta, (3e-3, -2e-3))
    gravity = np.stack([np.zeros(N), np.full(N, -rig.gravity), -rig.gravity * c[:, 0]], axis=-1)
    circling = np.zeros((N, 3))
    circling[:, :2] = states.omega[:, None] ** 2 * c
    M = mass_matrix(c, rig.k_g)
    expected = np.linalg.solve(M, (gravity + circling)[..., None])[..., 0]
    effect, p = on("com_offset", c_x=3e-3, c_y=-2e-3)[0]
    falling = np.tile([[0.0], [-rig.gravity], [0.0]], N)
    np.testing.assert_allclose(effect.acceleration(falling, states, p, rig).T, expected, atol=1e-10)
    # α = 2 rad/s²: the first two rows of M a = F hold, with the force through the centre of mass
    a = effect.acceleration(falling + [[0.0], [0.0], [2.0]], states, p, rig).T
    force = np.einsum("nij,nj->ni", M, a)[:, :2] - circling[:, :2]
    np.testing.assert_allclose(force, gravity[:, :2], atol=1e-10)


def test_wrong_size_and_inertia_equal_the_true_rig(quadrilateral) -> None:
    rig, states = quadrilateral
    larger = Polygon(vertices=tuple((1.05 * x, 1.05 * y) for x, y in rig.shape.vertices))
    true = predict([], states, Rig(larger, rig.k_g, rig.gravity, rig.height))
    made = predict(on("wrong_size", s=0.05), states, rig)
    np.testing.assert_allclose(made.impact, true.impact, atol=1e-11)
    np.testing.assert_allclose(made.touch, true.touch, atol=EXACT)
    true = predict([], states, Rig(rig.shape, rig.k_g * np.sqrt(1.2), rig.gravity, rig.height))
    np.testing.assert_allclose(predict(on("wrong_inertia", d_I=0.2), states, rig).impact, true.impact, atol=1e-11)


def test_a_curved_surface_is_level_at_its_middle_and_a_ramp_beside_it() -> None:
    # at the place that is touched the surface is a ramp: the drop in its axes, turned back
    rig, kappa, x = Rig(DISK.shape, DISK.k_g, 9.81, 0.0), 0.1, 0.4
    psi, state = kappa * x, at_rest(x=x, vx=0.7, vy=-2.0, omega=4.0)
    R = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])
    along = R.T @ [0.7, -2.0]
    ramp = predict([], at_rest(vx=along[0], vy=along[1], omega=4.0), rig).impact[0]
    made = predict(on("curved_surface", kappa=kappa, x_0=0.0), state, rig).impact[0]
    np.testing.assert_allclose(made[:2], R @ ramp[:2], atol=EXACT)
    flat = predict([], state, rig).impact[0]
    assert np.abs(made - flat).max() > 0.05
    middle = predict(on("curved_surface", kappa=kappa, x_0=x), state, rig).impact[0]
    np.testing.assert_allclose(middle, flat, atol=EXACT)


def test_a_hollow_that_is_level_far_away_is_a_slope_and_not_another_height() -> None:
    # at the place where the drops fall, the surface has the assumed height
    rig, state = Rig(DISK.shape, DISK.k_g, 9.81, 0.0), at_rest(x=0.0, y=RADIUS)
    (effect, p) = on("curved_surface", kappa=2e-3, x_0=1.6)[0]
    assert effect.gap(np.zeros(1), state, p, rig)[0] == pytest.approx(0.0, abs=1e-6)
    aside = effect.gap(np.zeros(1), at_rest(x=0.1, y=RADIUS), p, rig)[0]
    assert aside == pytest.approx(-2e-3 * 1.6 * 0.1, rel=0.05)


def test_a_disk_that_touches_a_hollow_has_no_gap_to_it() -> None:
    rig, R = Rig(DISK.shape, DISK.k_g, 9.81, 0.0), 10.0
    effect, p = on("curved_surface", kappa=1.0 / R, x_0=0.0)[0]
    for x in (-0.3, 0.1, 0.2):
        # in a circle of radius R the centre of the disk is on one of R − radius about the same point
        y = R - np.sqrt((R - RADIUS) ** 2 - x**2)
        state = at_rest(x=x, y=y)
        gap = rig.shape.gap(state.y, state.theta)
        left = gap - effect.gap(np.zeros(1), state, p, rig)
        assert abs(left[0]) < 0.01 * gap[0]  # a parabola is off a circle, and ψ off its sine, by squares of ψ


@pytest.mark.parametrize(
    "solid", [Box(half_extents=(0.05, 0.04, 0.03)), Ellipsoid(semi_axes=(0.035, 0.03, 0.025)), Sphere(radius=0.03)]
)
def test_a_soft_body_is_pressed_in_the_middle_of_what_the_surface_cuts_off(solid) -> None:
    rng, depth, grid = np.random.default_rng(2), 2e-4, np.linspace(-6e-3, 6e-3, 801)
    attitude = of_rotation_vector(rng.standard_normal((3, 40)))
    if solid.corners.size:  # well off its edges
        heights = np.sort(np.stack([SPACE.turned(attitude, c[:, None])[2] for c in solid.corners.T]), axis=0)
        attitude = attitude[:, heights[1] - heights[0] > 0.025]
    cut = np.stack([*(part.ravel() for part in np.meshgrid(grid, grid)), np.full(grid.size**2, depth)])
    for q in attitude.T[:8]:
        lowest = solid.lowest(q[:, None])
        body = SPACE.turned_back(q[:, None], lowest + cut)
        if solid.corners.size:
            inside = (np.abs(body) <= np.array(solid.half_extents)[:, None]).all(axis=0)
        else:
            axes = np.array(getattr(solid, "semi_axes", [solid.minkowski.radius] * 3))
            inside = ((body / axes[:, None]) ** 2).sum(axis=0) <= 1.0
        middle = cut[:2, inside].mean(axis=1)
        np.testing.assert_allclose(lean_in_space(solid, q[:, None])[:, 0] * depth, middle, atol=0.03 * depth)
