"""Contacts that take time: restitution in closed form, energy, symmetry, the rigid limit, and a solver of its own."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from throws_for_tests import BODY, RIG, energy, touching

from thesis_lib.contact import LAWS
from thesis_lib.contact.space import velocity_error
from thesis_lib.thesis.residual.throwing.compliant_contact import CornerContact, compliant_path, press
from thesis_lib.thesis.residual.throwing.throw import LawImpact

CONTACT = CornerContact(omega=1000.0, damping=0.2, dashpot=0.15, mu=0.2, tau=0.3)
LONG = np.full(1, 0.02)


def on_a_corner(speed: float) -> tuple[np.ndarray, np.ndarray]:
    """A square that falls on its corner, centre above it: one degree of freedom."""
    q = np.array([[0.0, 0.0, np.pi / 4]])
    q[:, 1] -= BODY.gap(q)
    return q, np.array([[0.0, -speed, 0.0]])


@pytest.mark.parametrize("zeta", [0.05, 0.2, 0.4])
def test_a_dashpot_restitutes_as_the_oscillator_does_that_cannot_pull(zeta):
    contact = CornerContact(omega=1000.0, damping=0.0, dashpot=zeta, mu=0.0)
    q, v = on_a_corner(20.0)  # so fast that weight does not matter
    _, after, took = press(BODY, contact, q, v, LONG, dt=2e-6)
    # the force of −(Ω² x + 2 ζ Ω x') vanishes before the spring is relaxed
    root = np.sqrt(1.0 - zeta**2)
    expected = np.exp(-2.0 * zeta / root * np.arctan2(root, zeta))
    assert after[0, 1] / 20.0 == pytest.approx(expected, rel=0.01)
    assert took[0] >= 2.0 * np.arctan2(root, zeta) / (1000.0 * root) * 0.99


def test_hunt_and_crossley_restitute_less_the_faster_and_all_of_it_when_slow():
    contact = CornerContact(omega=1000.0, damping=0.3, dashpot=0.0, mu=0.0)
    e = []
    for speed in (0.3, 1.0, 3.0):
        q, v = on_a_corner(speed)
        _, after, _ = press(replace(BODY, gravity=0.0), contact, q, v, LONG, dt=1e-6)
        e.append(after[0, 1] / speed)
    assert 1.0 > e[0] > e[1] > e[2] > 0.0
    # e − ln-law of Hunt-Crossley: d (1 + e) v = ln((1 + d v)/(1 − d e v))
    for speed, e_n in zip((0.3, 1.0, 3.0), e):
        d = 0.3 * speed
        assert d * (1.0 + e_n) == pytest.approx(np.log((1.0 + d) / (1.0 - d * e_n)), rel=0.01)


def test_no_contact_gains_energy():
    q, v, _ = touching(300)
    after_q, after_v, _ = press(BODY, replace(CONTACT, flat=0.5, far=1.0), q, v, np.full(300, 0.02))
    assert (energy(after_q, after_v) <= energy(q, v) * (1.0 + 1e-3)).all()
    lossless = replace(CONTACT, damping=0.0, dashpot=0.0, mu=0.0)
    after_q, after_v, took = press(BODY, lossless, q, v, np.full(300, 0.02), dt=1e-5)
    left = took < 0.02 - 1e-9
    assert left.mean() > 0.9
    assert energy(after_q, after_v)[left] == pytest.approx(energy(q, v)[left], rel=5e-3)


def test_left_is_right_in_a_mirror():
    q, v, _ = touching(100)
    contact = replace(CONTACT, place=-0.05, far=1.0, flat=0.4)
    mirror = np.array([-1.0, 1.0, -1.0])
    one_q, one_v = compliant_path(BODY, contact, q, v, 0.03)
    two_q, two_v = compliant_path(BODY, replace(contact, place=0.05), q * mirror, v * mirror, 0.03)
    assert two_q == pytest.approx(one_q * mirror, abs=1e-6)
    assert two_v == pytest.approx(one_v * mirror, abs=1e-4)


def test_stiff_corners_without_friction_hit_like_the_law_with_their_restitution():
    """μ = 0 leaves one law only: c_n = (1 + e) of what ends the approach."""
    q, v, r = touching(300)
    zeta = 0.2
    contact = CornerContact(omega=20_000.0, damping=0.0, dashpot=zeta, mu=0.0)
    single = np.abs(np.sin(2.0 * q[:, 2])) > 0.5  # the neighbour comes much later
    # the damping ratio of the contact is ζ √K_nn: a lever is softer than a mass on its spring
    K = 1.0 + r[:, 0] ** 2 / RIG.k_g**2
    z = zeta * np.sqrt(K)
    root = np.sqrt(1.0 - z**2)
    e = np.exp(-2.0 * z / root * np.arctan2(root, z))
    law = LawImpact(LAWS["mirtich"], 0.0, e, RIG.k_g)
    _, expected, _ = law(q, v, r, np.zeros(300, bool))
    _, after, _ = press(BODY, contact, q, v, np.full(300, 0.002), dt=1e-6)
    error = velocity_error(after - expected, RIG.k_g)
    assert single.sum() > 100
    assert np.median(error[single]) < 0.02


def test_steps_are_small_enough():
    q, v, _ = touching(200)
    _, coarse = compliant_path(BODY, CONTACT, q, v, 0.012)
    _, fine = compliant_path(BODY, CONTACT, q, v, 0.012, dt=1e-5)
    error = velocity_error(coarse - fine, RIG.k_g)
    # against the 0.1 m/s by which measured contacts scatter
    assert np.median(error) < 0.02
    _, half = compliant_path(BODY, CONTACT, q, v, 0.012, dt=5e-5)
    assert np.median(velocity_error(half - fine, RIG.k_g)) < 0.7 * np.median(error)


def test_a_flat_landing_without_friction_is_what_a_solver_of_its_own_finds():
    contact = CornerContact(omega=800.0, damping=0.1, dashpot=0.1, mu=0.0)
    q, v = np.array([[0.0, 0.0, 0.03]]), np.array([[0.0, -2.0, 1.0]])
    q[:, 1] -= BODY.gap(q)

    def rate(_, s):
        y, theta, v_y, omega = s
        r_x = np.cos(theta) * BODY.u[:, 0] - np.sin(theta) * BODY.u[:, 1]
        gap = y + np.sin(theta) * BODY.u[:, 0] + np.cos(theta) * BODY.u[:, 1]
        v_n = v_y + r_x * omega
        f = np.maximum(800.0**2 * -gap * (1.0 - 0.1 * v_n) - 2.0 * 0.1 * 800.0 * v_n, 0.0) * (gap < 0.0)
        return [v_y, omega, f.sum() - 9.81, (r_x * f).sum() / RIG.k_g**2]

    start = [q[0, 1], q[0, 2], v[0, 1], v[0, 2]]
    end = solve_ivp(rate, (0.0, 0.012), start, rtol=1e-8, atol=1e-10, max_step=2e-5).y[:, -1]
    path_q, path_v = compliant_path(BODY, contact, q, v, 0.012, dt=2e-6)
    assert path_v[0, 1:] * [1.0, RIG.k_g] == pytest.approx(end[2:] * [1.0, RIG.k_g], abs=5e-3)
    assert path_q[0, 1:] == pytest.approx(end[:2], abs=1e-4)


def test_landing_flat_gives_back_more_where_the_contact_says_so():
    q = np.array([[0.0, 0.03, 0.0]])
    v = np.array([[0.0, -2.0, 0.0]])
    more, less = (press(BODY, replace(CONTACT, flat=b, flat_dashpot=b), q, v, LONG)[1][0, 1] for b in (0.8, 0.0))
    assert more > less
    corner, _ = (press(BODY, replace(CONTACT, flat=b), *on_a_corner(2.0), LONG)[1][0, 1] for b in (0.8, 0.0))
    assert corner == pytest.approx(press(BODY, CONTACT, *on_a_corner(2.0), LONG)[1][0, 1], rel=1e-9)
