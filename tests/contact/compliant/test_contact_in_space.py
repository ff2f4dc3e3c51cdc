"""Contacts of bodies in space that take time: the plane is a case, short ones have the impulse of a law, none gains."""

import numpy as np
import pytest

from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Hull, Sphere
from thesis_lib.contact import mirtich
from thesis_lib.contact.compliant import compiled_in_space
from thesis_lib.contact.compliant.watched_slide import on_ellipse
from thesis_lib.critique.contacts import pressing
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.episodes import Played
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.contacts.pressing import press
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.contact import contact, velocity_change
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import PLANE, SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.mujoco.contact import restitution_and_time, spring_and_damper
from thesis_lib.simulate.mujoco.tosses import MujocoTosses
from thesis_lib.simulate.tosses.own import OwnTosses
from thesis_lib.simulate.tosses.world import TossedWorld

FORCES = ["compliant_contact", "hertz_contact", "damped_contact", "hunt_crossley_contact", "convex_contact"]
IN_SPACE = [*FORCES, "pyramid_contact"]
VALUES = {"mu": 0.25, "epsilon": 0.5, "tau": 8e-4, "damping_ratio": 10.0, "impedance": 0.9}
K_G = 0.03
MOMENTS = np.diag([6e-4, K_G**2, 1.1e-3])
BOX = Box(half_extents=(0.05, 0.04, 0.03))
HEADER = SpaceHeader.model_validate({"schema": 2, "body": {"shape": BOX, "mass": 0.2, "homogeneous": True}})
SOLIDS = {
    "box": BOX,
    "rounded box": BOX.rounded(0.004),
    "sphere": Sphere(radius=0.04),
    "ellipsoid": Ellipsoid(semi_axes=(0.05, 0.04, 0.03)),
    "cylinder": Cylinder(radius=0.03, half_length=0.05, edge_radius=0.001),
    "capsule": Capsule(radius=0.025, half_length=0.03),
}
# a rectangle in the plane x, z, and two corners beside it that do not touch there
FLAT = Hull(
    vertices=[(0.05, 0, 0.03), (0.05, 0, -0.03), (-0.05, 0, 0.03), (-0.05, 0, -0.03), (0, 0.02, 0), (0, -0.02, 0)]
)
SECTIONS = {
    "corners": (Polygon(vertices=[(0.05, 0.03), (-0.05, 0.03), (-0.05, -0.03), (0.05, -0.03)]), FLAT),
    "outline": (Ellipse(semi_axes=(0.05, 0.03)), Ellipsoid(semi_axes=(0.05, 0.04, 0.03))),
}
SHORT = 2e-6  # s; nothing moves meanwhile
SAME = 1e-9  # m/s and k rad/s: rounding
# the same where corners are found in turn, in another order here, and of later corners, which in the plane press from
# the next step on: with eight times the usual steps
LATER = {"convex_contact": 5e-4, "damped_contact": 1e-3}
TURN = 0.8  # rad


def tossed(solid, n, seed=0):
    """Bodies (n,) that touch, and come down."""
    rng = np.random.default_rng(seed)
    attitude = of_rotation_vector(2.0 * rng.standard_normal((3, n)))
    v = np.concatenate([rng.uniform(-1, 1, (2, n)), rng.uniform(-2.5, -1.5, (1, n)), 6.0 * rng.standard_normal((3, n))])
    pose = np.concatenate([np.zeros((2, n)), -solid.lowest(attitude)[2:], attitude])
    states = State(pose, v, np.arange(n), np.zeros(n), None, SPACE)
    return states.select(np.flatnonzero(SPACE.velocity_at(v[:3], v[3:], solid.lowest(attitude))[2] < -0.2))


def in_space(solid, name, G=None, **values):
    G = solid.moments.inertia_per_mass if G is None else G
    rig = Rig(solid, float(np.sqrt(np.trace(G) / 3.0)), 9.81, 0.0, tensor=G)
    effects = tuple(EFFECTS[of] for of in {of.partition(".")[0] for of in values if "." in of})
    return bind(Model(BASES[name], effects, takes_time=True, space=SPACE), VALUES | values, rig)


def energy(states, G):
    spin = SPACE.turned_back(states.attitude, states.spin)
    return 0.5 * ((states.velocity**2).sum(0) + np.einsum("in,ij,jn->n", spin, G, spin)) + 9.81 * states.height


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("name", FORCES)
def test_a_motion_in_a_plane_of_space_is_that_of_the_plane(name, section, monkeypatch):
    monkeypatch.setattr(pressing, "STEPS", 8 * pressing.STEPS)
    shape, solid = SECTIONS[section]
    rng, n = np.random.default_rng(4), 40
    theta = rng.uniform(-np.pi, np.pi, n)
    y = -shape.contact_point(theta)[:, 1]
    v = np.stack([rng.uniform(-1, 1, n), -rng.uniform(1, 2.5, n), 6.0 * rng.standard_normal(n)])
    flat = State.planar(np.zeros(n), y, theta, *v, np.arange(n), np.zeros(n))
    rig = Rig(shape, K_G, 9.81, 0.0)
    # MuJoCo's estimate of a mass differs in the plane, and with it the impedance of the same motion
    d = VALUES["impedance"]
    same = 1.0 / (1.0 + 2.0 / 3.0 * (1.0 - d) / d)
    plane = bind(Model(BASES[name], takes_time=True, space=PLANE), VALUES, rig)
    flat = flat.select(np.flatnonzero(plane.contact(flat)[1].v_n < -0.2))
    none = np.zeros(len(flat))
    attitude = of_rotation_vector(np.stack([none, -flat.theta, none]))
    pose = np.concatenate([np.stack([flat.x, none, flat.y]), attitude])
    motion = np.stack([flat.vx, none, flat.vy, none, -flat.omega, none])
    states = State(pose, motion, flat.trial, flat.t, None, SPACE)
    expected, time = press(plane, flat)
    found, elapsed = press(in_space(solid, name, MOMENTS, impedance=same), states)
    off = np.abs(
        [found.motion[0] - expected.vx, found.motion[2] - expected.vy, K_G * (found.motion[4] + expected.omega)]
    )
    assert off.max() < LATER.get(name, 1e-5)
    assert np.median(off.max(axis=0)) < (LATER[name] if name == "convex_contact" else SAME)
    np.testing.assert_allclose(found.motion[[1, 3, 5]], 0.0, atol=1e-9)
    np.testing.assert_allclose(elapsed, time, atol=2e-5)
    np.testing.assert_allclose(found.height, expected.y, atol=2e-6)


@pytest.mark.parametrize("shape", SOLIDS)
@pytest.mark.parametrize("name", IN_SPACE)
def test_no_contact_gains_energy_and_all_leave_the_surface(name, shape):
    solid = SOLIDS[shape]
    states, G = tossed(solid, 60), solid.moments.inertia_per_mass
    after, elapsed = press(in_space(solid, name), states)
    assert np.all(energy(after, G) < energy(states, G)) and np.all((elapsed > 2e-4) & (elapsed < 1e-2))
    gap = after.height + solid.lowest(after.attitude)[2]
    over = elapsed < 3.9 * VALUES["tau"] * BASES[name].force.lasting(VALUES["epsilon"])  # others come to rest
    assert np.all(gap[over] > -1e-7) and over.mean() > 0.9
    np.testing.assert_allclose((after.attitude**2).sum(axis=0), 1.0, rtol=1e-12)


# a pyramid is the same after a quarter of a turn, or has edges that turn with the body
@pytest.mark.parametrize(
    ("name", "angle", "edges"),
    [*((name, TURN, 0.0) for name in FORCES), *(("pyramid_contact", 0.5 * np.pi + by, by) for by in (0.0, TURN))],
)
def test_turned_about_the_vertical_the_outcome_is_turned(name, angle, edges):
    states = tossed(BOX, 60)
    about = of_rotation_vector(np.array([[0.0], [0.0], [angle]]))

    def turned(s):
        every = np.repeat(about, len(s), axis=1)
        parts = [SPACE.turned(every, part) for part in (s.position, s.velocity, s.spin)]
        attitude = SPACE.attitude_after(s.attitude, np.outer([0.0, 0.0, angle], np.ones(len(s))))
        return s.changed(parts[0], attitude, parts[1], parts[2])

    model, other = in_space(BOX, name), in_space(BOX, name, edge_angle=edges)
    expected, found = turned(press(model, states)[0]), press(other, turned(states))[0]
    np.testing.assert_allclose(found.motion, expected.motion, atol=1e-7)
    np.testing.assert_allclose(SPACE.difference(found.pose, expected.pose), 0.0, atol=1e-9)
    slide = np.append(model.sliding(states), np.zeros((1, len(states))), axis=0)
    np.testing.assert_allclose(other.sliding(turned(states)), SPACE.turned(about, slide)[:2], atol=1e-9)


@pytest.mark.parametrize("shape", ["box", "sphere", "cylinder"])
def test_a_short_contact_has_the_impulse_of_mirtich(shape):
    solid = SOLIDS[shape]
    states, G = tossed(solid, 80, seed=3), solid.moments.inertia_per_mass
    found, _ = press(in_space(solid, "compliant_contact", tau=SHORT), states)
    at = contact(states, solid.lowest(states.attitude), mobility(SPACE, G[:, :, None], states.attitude))
    n = len(states)
    c = mirtich.impulse(at, np.full(n, VALUES["mu"]), np.full(n, VALUES["epsilon"]))
    expected = states.motion + velocity_change(c, at.r, at.mobility)
    off = np.abs(found.motion - expected) * np.repeat([1.0, 0.03], 3)[:, None]
    assert np.median(off) < 1e-3 and np.quantile(off, 0.98) < 0.02  # m/s; 64 steps a contact


def test_friction_by_speed_acts_along_an_integrated_slip_as_along_the_path_of_an_impulse():
    effect, ball = EFFECTS["velocity_dependent_friction"], SOLIDS["sphere"]
    states, G = tossed(ball, 80, seed=5), ball.moments.inertia_per_mass
    rig, v = Rig(ball, K_G, 9.81, 0.0, tensor=G), {}
    for s in (0.0, 0.8):
        values = VALUES | {"mu": 0.08, "tau": SHORT}
        values |= {"velocity_dependent_friction.s": s, "velocity_dependent_friction.v_s": 0.5}
        lasts = Model(BASES["compliant_contact"], (effect,), takes_time=True, space=SPACE)
        instant = Model(BASES["mirtich"], (effect,), space=SPACE)
        after = press(bind(lasts, values, rig), states)[0], bind(instant, values, rig).strike(states)[0]
        v[s] = np.stack([one.velocity[:2] for one in after])
    found, expected = v[0.8] - v[0.0]
    slips = np.linalg.norm(expected, axis=0) > 5e-3  # m/s; others stick, or are too fast
    assert slips.mean() > 0.3
    np.testing.assert_allclose(found[:, slips], expected[:, slips], rtol=0.05, atol=1e-3)  # 64 steps a contact


@pytest.mark.parametrize("name", ["compliant_contact", "convex_contact"])
def test_errors_fall_with_the_step(name, monkeypatch):
    states, model, found = tossed(BOX, 60, seed=6), in_space(BOX, name), {}
    for steps in (64, 128, 1024):
        monkeypatch.setattr(pressing, "STEPS", steps)
        found[steps] = press(model, states)[0].motion
    coarse, fine = (np.median(np.abs(found[steps] - found[1024])) for steps in (64, 128))
    assert coarse < 1e-3 and fine < 0.5 * coarse


def test_a_central_contact_in_space_has_the_restitution_and_the_time_of_its_force():
    ball = Sphere(radius=0.04)
    pose = np.array([[0.0], [0.0], [0.04], [1.0], [0.0], [0.0], [0.0]])
    states = State(pose, np.array([[0.0, 0.0, -1.0, 0.0, 0.0, 0.0]]).T, np.zeros(1), np.zeros(1), None, SPACE)
    for name in IN_SPACE:
        after, elapsed = press(in_space(ball, name, mu=0.0, tau=1e-4), states)
        assert after.velocity[2] == pytest.approx(VALUES["epsilon"], abs=6e-3)
        lasting = 1e-4 * BASES[name].force.lasting(VALUES["epsilon"])
        assert elapsed > 0.97 * lasting  # until it is out of its dent
        assert "crossley" not in name or elapsed == pytest.approx(lasting, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("lever", [0.0, 0.006])
@pytest.mark.parametrize(("impratio", "d"), [(1.0, 0.9), (50.0, 0.999)])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_convex_contacts_are_those_of_mujoco(cone, impratio, d, lever):
    lasts, mu, epsilon = 1e-3, 0.3, 0.5
    torsion = {"torsional_friction.m_t": lever} if lever else {}
    engine, world = MujocoTosses(cone, impratio, (d, d), steps=400), TossedWorld(HEADER, mu, epsilon, lasts, torsion)
    states = tossed(BOX, 40, seed=2)
    times = np.full((len(states), 1), 3.0 * lasts)
    expected = engine.moves(world, states.changed(states.position + [[0.0], [0.0], [1e-6]]), times)
    # R m along the surface; on a pyramid MuJoCo's own estimate of it is (1 + μ²) times that, and R across it is less,
    # so that its spring and damper, which MuJoCo divides by d, are harder
    slack = (1.0 - d) / d / impratio * (1.0 + mu**2)
    stiffer = 1.0 / (d * (1.0 + 0.5 * mu**2 * slack))
    harder = restitution_and_time(*(stiffer * np.array(spring_and_damper(epsilon, lasts))))
    own = {
        "elliptic": ("convex_contact", d, epsilon, lasts),
        "pyramidal": ("pyramid_contact", 1.0 / (1.0 + slack), *harder),
    }
    off = {}
    for of, (name, impedance, e, T) in own.items():
        values = {"mu": mu, "epsilon": e, "tau": T / BASES[name].force.lasting(e)}
        values |= {"damping_ratio": impratio, "impedance": impedance} | torsion
        model = in_space(BOX, name, HEADER.body.inertia_per_mass, **values)
        after, elapsed = press(model, states)
        fallen = after.velocity - 9.81 * (3.0 * lasts - elapsed) * [[0.0], [0.0], [1.0]]
        apart = np.concatenate([fallen - expected.velocity, K_G * (after.spin - expected.spin)])
        off[of] = float(np.median(np.linalg.norm(apart, axis=0)))
    other = "elliptic" if cone == "pyramidal" else "pyramidal"
    assert off[cone] < 0.01 and off[other] > 0.1, off


@pytest.mark.parametrize(
    "hidden",
    [{}, {"velocity_dependent_friction.s": 1.4, "velocity_dependent_friction.v_s": 0.5}]
    + [{"torsional_friction.m_t": 6e-3}, {"contact_torque.m_r": 1.5e-3}]
    + [{"anisotropic_friction.a_c": 0.28, "anisotropic_friction.a_s": 0.25}],
    ids=lambda hidden: next(iter(hidden), "nothing"),
)
def test_damped_contacts_are_those_of_our_own_tosses(hidden):
    lasts, epsilon, close = 2.5e-3, 0.6, 1e-5
    tau = lasts / BASES["damped_contact"].force.lasting(epsilon)
    model = in_space(BOX, "damped_contact", HEADER.body.inertia_per_mass, mu=0.3, epsilon=epsilon, tau=tau, **hidden)
    states = tossed(BOX, 60, seed=2)
    after, elapsed = press(model, states)
    # their velocity is that between two poses
    middle = elapsed[:, None] + 5.0 * close
    world = TossedWorld(HEADER, 0.3, epsilon, lasts, hidden)
    moved = OwnTosses(steps=1600).moves(world, states, middle + [-close, close])
    pose = moved.pose.reshape(7, -1, 2)
    expected = 0.5 * SPACE.difference(pose[:, :, 1], pose[:, :, 0]) / close
    fallen = after.velocity - 5.0 * close * np.array([[0.0], [0.0], [9.81]])
    apart = np.linalg.norm(np.concatenate([fallen - expected[:3], K_G * (after.spin - expected[3:])]), axis=0)
    over = elapsed < 3.5 * lasts
    assert over.mean() > 0.9
    # as differences of paths, added to the impulse: 5e-3 and 3e-2 m/s with friction by speed or torsion
    assert np.median(apart[over]) < 1.5e-3 and np.quantile(apart[over], 0.9) < 6e-3


def test_a_body_that_slides_on_a_pyramid_loses_its_faster_component_first_as_in_mujoco():
    mu = 0.3
    pose, motion = [[0.0, 0.0, 0.03, 1.0, 0.0, 0.0, 0.0]], [[0.4, -0.2, 0.0, 0.0, 0.0, 0.0]]
    flat = State(np.array(pose).T, np.array(motion).T, np.zeros(1), np.zeros(1), None, SPACE)
    # both components are equal after 0.2 m/s / μ g = 68 ms, and 0 after 204 ms
    force, moved = BASES["pyramid_contact"].force, MujocoTosses("pyramidal")
    for first, last in ((0.0, 0.06), (0.02, 0.12), (0.08, 0.16), (0.12, 0.3)):
        t = np.linspace(first, last, 40)
        path = moved.moves(TossedWorld(HEADER, mu, 0.5, 2e-3), flat, t[None]).position[:2]
        half_a, slip, _ = np.polyfit(t - t.mean(), path.T, 2)
        expected = force.sliding(slip[:, None], np.array([mu * 9.81]), np.zeros((2, 1)), last - first)[:, 0]
        # in MuJoCo the larger component gives way gradually
        np.testing.assert_allclose(2.0 * half_a, expected, atol=0.07 * mu * 9.81)


def test_a_body_that_slides_on_a_pyramid_down_a_slope_keeps_equal_components_equal():
    force, limit, dt = BASES["pyramid_contact"].force, 2.1, 1e-4
    pull = np.array([0.5, -0.34])
    for slip in ([0.5, -0.1], [0.1, -0.6], [-0.2, -0.35], [0.3, 0.28], [0.15, -0.2]):
        v, seen = np.array(slip), []
        for _ in range(3000):
            seen.append(v)
            push = v + dt * pull  # friction takes from the larger component, and from both where they are equal
            size, left = np.abs(push), limit * dt
            more = min(left, abs(size[0] - size[1]))
            size[size.argmax()] -= more
            v = np.sign(push) * np.maximum(size - 0.5 * (left - more), 0.0)
        t = dt * np.arange(len(seen))
        path = dt * np.cumsum(seen, axis=0)
        half_a, middle, _ = np.polyfit(t - t.mean(), path, 2)
        expected = force.sliding(middle[:, None], np.array([limit]), pull[:, None], t[-1])[:, 0]
        np.testing.assert_allclose(2.0 * half_a, expected, atol=0.03 * limit)


@pytest.mark.parametrize("pull", [(0.0, 0.0), (0.6, -0.4)])
@pytest.mark.parametrize(("a_c", "a_s"), [(0.3, 0.2), (-0.25, 0.25), (0.0, 0.0)])
def test_a_slide_on_an_ellipse_turns_and_stops_as_in_small_steps(a_c, a_s, pull):
    mu_g, dt = 2.9, 1e-4
    M, steps = mu_g * np.array([[1.0 + a_c, a_s], [a_s, 1.0 - a_c]]), [500, 1500, 3000]
    for slip in ([0.5, -0.1], [0.1, -0.6], [-0.2, -0.35], [0.3, 0.28]):
        v, seen = np.array(slip), []
        for _ in range(max(steps)):
            seen.append(v)
            push = v + dt * np.array(pull)
            c = np.linalg.solve(M, push) / dt  # what would end the slip, within the ball
            away = M @ push
            v = push - dt * M @ (away / np.linalg.norm(away)) if c @ c > 1.0 else 0.0 * v
        for count in steps:
            t = dt * np.arange(count)
            half_a, middle, _ = np.polyfit(t - t.mean(), dt * np.cumsum(seen[:count], axis=0), 2)
            expected = on_ellipse(middle[:, None], M[:, :, None], np.array(pull)[:, None], t[-1])[:, 0]
            np.testing.assert_allclose(2.0 * half_a, expected, atol=0.02 * mu_g)


def test_a_box_that_turns_over_an_edge_moves_the_same_where_its_contact_is_cut(monkeypatch):
    rng, n = np.random.default_rng(1), 100
    lean, zero = rng.uniform(0.1, 0.5, n), np.zeros(n)
    attitude = of_rotation_vector(np.stack([zero, lean, 0.02 * rng.standard_normal(n)]))
    place = np.concatenate([np.zeros((2, n)), -BOX.lowest(attitude)[2:], attitude])
    motion = [0.2 * rng.standard_normal(n), zero, rng.uniform(-0.8, -0.3, n), zero, rng.uniform(2.0, 8.0, n), zero]
    states = State(place, np.stack(motion), np.arange(n), zero, None, SPACE)
    model, ends = in_space(BOX, "damped_contact", mu=0.6, epsilon=0.1, tau=1e-4), []
    for cut in (pressing.CUT, np.inf):
        monkeypatch.setattr(pressing, "CUT", cut)
        ends.append(Played(model, states, np.full(n, 0.03)))
    (cut, whole), off = ends, SPACE.difference(ends[0].after.pose, ends[1].after.pose)
    assert (cut.hits > whole.hits).mean() > 0.5
    assert np.median(np.linalg.norm(cut.after.velocity - whole.after.velocity, axis=0)) < 1e-4
    assert np.median(np.abs(off), axis=1).max() < 1e-4


def test_a_contact_that_a_fit_cannot_integrate_stops_the_body(monkeypatch):
    integrate = pressing.compiled_in_space.integrate

    def spoilt(*args):
        shift, turn, velocity, *others = integrate(*args)
        velocity[:, 0], turn[:, 1], velocity[:, 1] = np.nan, np.nan, 1e6
        return shift, turn, velocity, *others

    model, states = in_space(BOX, "damped_contact"), tossed(BOX, 10)
    whole, _ = press(model, states)
    monkeypatch.setattr(pressing.compiled_in_space, "integrate", spoilt)
    after, _ = press(model, states)
    np.testing.assert_allclose(after.v[:2], 0.0)
    np.testing.assert_allclose(after.pose[:, :2], states.pose[:, :2])
    np.testing.assert_array_equal(after.v[2:], whole.v[2:])


def test_the_force_on_the_side_of_the_cone_is_the_minimum_in_the_cone():
    rng, found = np.random.default_rng(0), 0
    for _ in range(300):
        L, c, mu = rng.normal(size=(3, 3)), rng.normal(size=4), rng.uniform(0.05, 1.0)
        Q = np.diag([0.1, 0.1, 0.1, 1.0])
        Q[:3, :3] += L @ L.T
        f_1, f_2, f_n, _ = least = compiled_in_space._in_cone(Q, c, mu, 0.0, 0.0)
        turn = rng.normal(scale=0.3)
        start = np.cos(turn) * f_1 - np.sin(turn) * f_2, np.sin(turn) * f_1 + np.cos(turn) * f_2
        *on_side, is_least = compiled_in_space._on_side(Q, c, mu, *start)
        if is_least:
            np.testing.assert_allclose(on_side, least[:3], rtol=1e-6, atol=1e-8)
            assert np.hypot(*on_side[:2]) == pytest.approx(mu * on_side[2], rel=1e-12)
        is_inside = np.hypot(f_1, f_2) < mu * f_n * (1.0 - 1e-6)
        assert not (is_inside and is_least)
        found += is_least
    assert found > 100
