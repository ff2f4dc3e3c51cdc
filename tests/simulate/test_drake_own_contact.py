"""Drake's own contact, point and hydroelastic: its map both ways, forces of the two shapes, and drops over it."""

import numpy as np
import pytest
from scipy.integrate import quad

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.drake.drops import SURFACES, simulate_drake_drops
from thesis_lib.simulate.drake.hunt_crossley import dissipation, duration, restitution, spring
from thesis_lib.simulate.drake.modulus import central_angle, solid, static_force
from thesis_lib.simulate.rig.hidden_causes import CAUSES, PROOF_RELEASE, REFERENCE_SPEED, CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.release import Release, Spread

ELLIPSE = Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=0.0364, radius_of_gyration=0.01924)
DISK = Body(shape=Disk(radius=0.03), mass=0.05, radius_of_gyration=0.02)
CORNERS = ((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03))
SQUARE = Body(shape=Polygon(vertices=CORNERS), mass=0.05, radius_of_gyration=0.0245)
TRIANGLE = Body(
    shape=Polygon(vertices=((0.03, -0.02), (0.0, 0.04), (-0.03, -0.02))), mass=0.05, radius_of_gyration=0.02
)
FLAT = 0.0285  # m: lever of a corner of the square, 0.03 where it lands flat
PRE, POST = ["vx_pre", "vy_pre", "omega_pre"], ["vx_post", "vy_post", "omega_post"]
OWN = ("point", "hydroelastic")
GRAVITY = 0.01  # of a restitution: what gravity does in a contact of 1 ms at 1 m/s and more


def run(surface, n=10, body=ELLIPSE, release=PROOF_RELEASE, seed=0, hidden=None, contact=None, **options):
    return simulate_drake_drops(
        body,
        release,
        n,
        contact=CompliantContact(**({"contact_time": 1e-3} | (contact or {}))),
        hidden=HiddenCauses(**(hidden or {})),
        surface=surface,
        rng=np.random.default_rng(seed),
        **({"duration": 0.4} | options),
    )


def at(**values):
    """A release of one state; a (low, high) pair spreads it."""
    state = {"height": 0.3, "theta": 0.0, "vx": 0.0, "omega": 0.0} | values
    pairs = {name: value if isinstance(value, tuple) else (value, value) for name, value in state.items()}
    return Release(**{name: Spread(low=low, high=high) for name, (low, high) in pairs.items()})


def first(drops):
    return drops.impacts[drops.impacts["impact"] == 0]


@pytest.mark.parametrize("epsilon", [0.1, 0.3, 0.55, 0.9])
def test_dissipation_and_restitution_are_inverse(epsilon):
    assert restitution(dissipation(epsilon), REFERENCE_SPEED) == pytest.approx(epsilon, rel=1e-6)
    # restitution falls with the speed, from 1
    speeds = [restitution(dissipation(epsilon), v) for v in (1e-3, 1.0, 2.5, 5.0)]
    assert (np.diff(speeds) < 0.0).all() and speeds[0] > 0.99


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_an_elastic_contact_lasts_as_long_as_its_potential_says(exponent):
    half = quad(lambda s: (1.0 - s ** (exponent + 1.0)) ** -0.5, 0.0, 1.0)[0]
    deepest = ((exponent + 1.0) / 2.0) ** (1.0 / (exponent + 1.0))
    assert duration(0.0, exponent) == pytest.approx(2.0 * deepest * half, rel=1e-6)


@pytest.mark.parametrize(("epsilon", "contact_time"), [(0.3, 1e-3), (0.55, 3e-4), (0.55, 3e-3), (0.9, 1e-3)])
def test_point_contact_has_the_restitution_and_time_that_were_asked_for(epsilon, contact_time):
    """Of a body that lands at the reference speed, in Drake; and less restitution where it lands faster."""
    fall = 0.03 + np.array([0.5, 1.0, 1.5]) ** 2 * REFERENCE_SPEED**2 / (2.0 * 9.81)
    contact = {"epsilon": epsilon, "contact_time": contact_time, "mu": 0.0}
    ratios = []
    for height in fall:
        one = first(run("point", 1, DISK, at(height=height), contact=contact, duration=0.7)).iloc[0]
        ratios.append(-one["vy_post"] / one["vy_pre"])
    speeds = np.array([0.5, 1.0, 1.5]) * REFERENCE_SPEED
    expected = [restitution(dissipation(epsilon), v) for v in speeds]
    # gravity acts for the time of contact, and the end is seen up to a twentieth of it late
    np.testing.assert_allclose(ratios, expected, atol=2e-3 + 1.5 * 9.81 * contact_time / speeds.min())
    middle = first(run("point", 1, DISK, at(height=fall[1]), contact=contact, duration=0.7)).iloc[0]
    assert 0.99 * contact_time < middle["duration"] < 1.08 * contact_time


@pytest.mark.parametrize(("body", "exponent"), [(ELLIPSE, 2.0), (SQUARE, 2.0)], ids=["ellipse", "square"])
def test_hydroelastic_force_grows_with_the_square_of_the_depth(body, exponent):
    """An edge or an ellipsoid meets the plate in an area that grows with the depth, and so does its pressure."""
    made = solid(body, 0.55, 1e-3)
    force = static_force(body, made, central_angle(body), np.array([2e-4, 4e-4, 8e-4]))
    np.testing.assert_allclose(np.diff(np.log2(force)), exponent, atol=0.1)
    flat = static_force(SQUARE, made, 0.0, np.array([2e-4, 4e-4]))
    assert flat[1] / flat[0] == pytest.approx(2.0, rel=0.05)  # a whole face from the start


def test_hydroelastic_force_is_the_pressure_over_the_cut_of_a_box():
    """On a corner, depth s: pressure E p / a, p the depth below the nearer face, over a strip 2 s wide, 2 a long."""
    made, depth, half = solid(SQUARE, 0.55, 1e-3), 5e-4, 0.03
    # across the strip the nearer face is up to s / sqrt(2) away
    expected = 2.0 * half * made.modulus / half * depth**2 / np.sqrt(2.0)
    assert static_force(SQUARE, made, central_angle(SQUARE), np.array([depth]))[0] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("body", [ELLIPSE, SQUARE], ids=["ellipse", "square"])
def test_hydroelastic_contact_has_the_time_and_restitution_that_were_asked_for(body):
    height = body.shape.extent + REFERENCE_SPEED**2 / (2.0 * 9.81)
    release = at(height=height, theta=central_angle(body) + 1e-3)
    one = first(run("hydroelastic", 1, body, release, contact={"mu": 0.0}, duration=0.5)).iloc[0]
    assert -one["vy_post"] / one["vy_pre"] == pytest.approx(0.55, abs=0.02)
    assert 0.95e-3 < one["duration"] < 1.15e-3


@pytest.mark.parametrize("surface", OWN)
@pytest.mark.parametrize("body", [ELLIPSE, SQUARE], ids=["ellipse", "square"])
def test_impulses_obey_coulomb_momentum_and_energy(surface, body):
    one = run(surface, 12, body, contact={"contact_time": 1e-4, "mu": 0.15}).impacts
    assert (np.abs(one["c_t"] / one["c_n"]) < 0.15 + 1e-6).all()
    d = one[POST].to_numpy() - one[PRE].to_numpy()
    free = np.outer(one["duration"], [0.0, -9.81])
    np.testing.assert_allclose(body.mass * (d[:, :2] - free), one[["c_t", "c_n"]].to_numpy(), atol=1e-9)
    # a flat square is pressed over its whole side, or at two corners
    single = one["r_x"].abs() < FLAT
    error = body.radius_of_gyration**2 * d[:, 2] - one["r_x"] * d[:, 1] + one["r_y"] * d[:, 0]
    lever = 2e-4 if surface == "point" else 1e-3  # m: the middle of a patch is not the lowest point
    np.testing.assert_allclose(error[single], 0.0, atol=lever * np.abs(d[:, :2]).max())
    assert (one["energy_change"] < 1e-3).all() and one["energy_change"].mean() < -0.01


def test_frictionless_point_contact_agrees_with_our_integration_of_the_same_force():
    """k and d of Drake's contact in the other integrator, whose spring is elastic.

    Corners have one contact point; that of an ellipsoid is Drake's choice.
    """
    own = spring(0.55, 1e-3, SQUARE.mass)
    lasting = np.pi * np.sqrt(SQUARE.mass / own.stiffness)
    elastic = CompliantContact(mu=0.0, epsilon=1.0, contact_time=lasting, steps=1000)
    hidden = HiddenCauses(hunt_crossley=own.dissipation)
    rng = np.random.default_rng(0)
    ours = simulate_compliant_drops(SQUARE, PROOF_RELEASE, 12, contact=elastic, hidden=hidden, duration=0.4, rng=rng)
    ours = first(ours).set_index("trial")
    drake = first(run("point", 12, SQUARE, contact={"mu": 0.0})).set_index("trial")
    assert len(drake) >= 10 and list(drake.index) == list(ours.index)
    late = 9.81 * 5e-5  # Drake looks twenty times per contact whether it has ended
    np.testing.assert_allclose(drake[POST] * [1, 1, 0.02], ours[POST] * [1, 1, 0.02], atol=1e-3 + late)


def test_samples_within_a_contact_are_on_its_path():
    """A contact of 4 ms, sampled at 2 kHz: the body is below the surface, as deep as a damped half-oscillation."""
    contact = {"contact_time": 4e-3, "mu": 0.0}
    drops = run("point", 1, DISK, at(height=0.3), contact=contact, rate=2000.0)
    one, path = first(drops).iloc[0], drops.trajectories
    within = path[(path["t"] > one["t"]) & (path["t"] < one["t"] + one["duration"])]
    assert len(within) >= 6
    k, d = (lambda s: (s.stiffness, s.dissipation))(spring(0.55, 4e-3, DISK.mass))
    # dδ/dt = v, dv/dt = −k/m δ (1 + d v) + g, in small steps
    t, depth, v, h, expected = one["t"], 0.0, -one["vy_pre"], 1e-6, []
    for sample in within["t"]:
        while t < sample - 0.5 * h:
            v += h * (9.81 - k / DISK.mass * depth * (1.0 + d * v))
            depth += h * v
            t += h
        expected.append(0.03 - depth)
    np.testing.assert_allclose(within["y"], expected, atol=1e-5)
    assert within["y"].min() < 0.03 - 2e-3


def test_contact_loses_with_the_trial_under_wear():
    """Each drop has a contact of its own restitution."""
    hidden = {"wear": 0.4}
    one = first(run("point", 5, DISK, at(height=0.3), hidden=hidden, contact={"mu": 0.0}))
    ratio = (-one["vy_post"] / one["vy_pre"]).to_numpy()
    expected = 0.55 * (1.0 + 0.4 * np.linspace(-0.5, 0.5, 5))
    np.testing.assert_allclose(np.diff(ratio), np.diff(expected), rtol=0.1)


def test_each_surface_makes_its_causes_or_refuses_them_by_name():
    for surface, made in SURFACES.items():
        for name in set(CAUSES) - set(made):
            body = SQUARE if CAUSES[name].polygon_only else ELLIPSE
            with pytest.raises(UserError, match=name):
                run(surface, 1, body, hidden={name: CAUSES[name].size})
    with pytest.raises(UserError, match="rectangles"):
        run("hydroelastic", 1, TRIANGLE)
    with pytest.raises(UserError, match="no surface 'foam'"):
        run("foam", 1)
