"""Drops in Drake, over a pad and in Drake's own contact: restitution both ways, forces of two shapes, paths in contact.

What drops of every engine promise is in `test_engine_contract`.
"""

from functools import partial

import numpy as np
import pytest
from falling import DISK, ELLIPSE, FLAT, POST, SQUARE, at, contact_velocity, first, run
from scipy.integrate import quad

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.drake import drops
from thesis_lib.simulate.drake.drops import SUPPORTED, WITHOUT_ELEMENT, DropsInDrake
from thesis_lib.simulate.drake.hunt_crossley import dissipation, duration, restitution, spring
from thesis_lib.simulate.drake.modulus import central_angle, solid, static_force
from thesis_lib.simulate.drake.viscoelastic_pad import design, rebound
from thesis_lib.simulate.rig.hidden_causes import CAUSES, PROOF_RELEASE, REFERENCE_SPEED, CompliantContact, HiddenCauses

TRIANGLE = Body(
    shape=Polygon(vertices=((0.03, -0.02), (0.0, 0.04), (-0.03, -0.02))), mass=0.05, radius_of_gyration=0.02
)
pad = partial(run, "pad")

# --- over a pad ---


@pytest.mark.slow
@pytest.mark.parametrize("epsilon", [0.3, 0.55, 0.9, 1.0])
def test_restitution_depends_neither_on_speed_nor_on_the_lever(epsilon):
    contact = {"epsilon": epsilon, "mu": 0.0}
    one = first(pad(25, SQUARE, at(height=(0.06, 0.6), theta=(-0.7, 0.7)), contact=contact, duration=0.4))
    v, after = contact_velocity(one, "pre")[1], contact_velocity(one, "post")[1]
    apart = np.abs(one["r_x"]) < FLAT  # else two corners land together
    assert v.min() < 3.0 * v.max() < 0.0 and np.abs(one["r_x"])[apart].max() > 0.02
    np.testing.assert_allclose((-after / v)[apart], epsilon, atol=0.005)


def test_drakes_own_dissipation_makes_restitution_fall_with_speed():
    hidden = {"hunt_crossley": 0.07}
    one = first(pad(8, DISK, at(height=(0.05, 0.8)), hidden=hidden, duration=0.42))
    speed, ratio = -one["vy_pre"].to_numpy(), (-one["vy_post"] / one["vy_pre"]).to_numpy()
    slope = np.polyfit(speed, ratio, 1)[0]
    own = first(run("own", 8, DISK, at(height=(0.05, 0.8)), hidden=hidden, duration=0.42))
    own_slope = np.polyfit(-own["vy_pre"], -own["vy_post"] / own["vy_pre"], 1)[0]
    assert slope == pytest.approx(own_slope, rel=0.1) and slope < -0.01  # one d, two contacts
    # slower is never more: the order of the ratios is that of the speeds
    assert (np.diff(ratio[np.argsort(speed)]) < 0.0).all()


@pytest.mark.slow
def test_tighter_error_control_changes_little(monkeypatch):
    rough = first(pad(6))[POST]
    monkeypatch.setattr(drops, "ACCURACY", 0.01 * drops.ACCURACY)
    np.testing.assert_allclose(rough, first(pad(6))[POST], rtol=0, atol=5e-4)


@pytest.mark.parametrize("epsilon", [0.3, 0.55, 0.9])
def test_pad_gives_back_the_same_at_any_effective_mass(epsilon):
    pad = design(epsilon, 2e-5, 0.05, 0.4)
    scale = pad.k_contact
    layers = [(k / scale, c / np.sqrt(scale * 0.05)) for k, c in pad.layers]
    every = [rebound(mass, layers)[0] for mass in np.linspace(0.4, 1.0, 13)]
    np.testing.assert_allclose(every, epsilon, atol=2e-3)
    assert rebound(1.0, layers)[1] / np.sqrt(scale / 0.05) == pytest.approx(2e-5, rel=1e-6)
    # one layer alone does not
    single = [rebound(mass, layers[:1])[0] for mass in (0.4, 1.0)]
    assert abs(single[1] - single[0]) > 0.01


# --- in its own contact ---


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
    made = run("point", 1, DISK, at(height=0.3), contact=contact, rate=2000.0)
    one, path = first(made).iloc[0], made.trajectories
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


def test_says_what_a_surface_cannot_carry():
    assert set(SUPPORTED) | set(WITHOUT_ELEMENT) == set(CAUSES)
    with pytest.raises(UserError, match="epsilon"):
        pad(1, contact={"epsilon": 0.1})
    with pytest.raises(UserError, match="rectangles"):
        run("hydroelastic", 1, TRIANGLE)
    with pytest.raises(UserError, match="no surface 'foam'"):
        simulate_compliant_drops(ELLIPSE, PROOF_RELEASE, 1, engine=DropsInDrake("foam"), rng=np.random.default_rng(0))
