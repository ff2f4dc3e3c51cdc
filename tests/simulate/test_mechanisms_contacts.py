"""Gaps and contact Jacobians against finite differences and against the formulas of the thesis (2.19 to 2.22)."""

import numpy as np
import pytest
from motions import BODIES

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel

STEP = 1e-6  # central differences: error of second order 1e-12, rounding 1e-10
FD_TOL = 1e-8
EXACT = 1e-13
ARM = ArmDisk((0.8, 0.7), (1.0, 0.8), ((0.3, 0.05), (0.4, -0.02)), (0.06, 0.05), 0.25, 1.0, 0.04, base=(0.1, 0.5))
MECHANISMS = BODIES | {"wheel": RimlessWheel(8, 1.0, 1.0, 0.5, 0.15), "arm": ARM}


def configurations(name, n=40, seed=0):
    rng = np.random.default_rng(seed)
    if name != "arm":
        return rng.uniform([-1, 0.5, -6], [1, 3, 6], (n, 3))
    q = rng.uniform([-0.5, -2, -1, 0.2, -3], [1.5, 2, 2, 1.5, 3], (n, 5))
    return q[ARM.contacts_of(q).phi[:, 0] > -0.2]  # the centre of the disk is off the link


def central(function, q):
    """Derivative of function (..., k) -> (...) along each coordinate at q (k,), last axis k."""
    steps = STEP * np.eye(len(q))
    return np.stack([(function(q + d) - function(q - d)) / (2 * STEP) for d in steps], axis=-1)


@pytest.mark.parametrize("name", MECHANISMS)
def test_normal_jacobian_is_the_gradient_of_the_gap(name):
    mechanism = MECHANISMS[name]
    for q in configurations(name):
        J = central(lambda x: mechanism.contacts(x).phi, q)
        assert np.abs(mechanism.contacts(q).J_n - J).max() < FD_TOL


@pytest.mark.parametrize("name", BODIES)
def test_jacobians_of_a_free_body_are_the_velocity_of_its_touching_point(name):
    body = BODIES[name]
    for q in configurations(name):
        c, s = np.cos(q[2]), np.sin(q[2])
        on_body = body.contact_points(q[2:])[0] @ np.array([[c, -s], [s, c]])  # R'r: points fixed in the body

        def place(x, points=on_body):
            c, s = np.cos(x[2]), np.sin(x[2])
            return x[:2] + points @ np.array([[c, s], [-s, c]])

        J = central(place, q)
        assert np.abs(body.contacts(q).J_t - J[:, 0]).max() < FD_TOL
        assert np.abs(body.contacts(q).J_n - J[:, 1]).max() < FD_TOL


def test_tangential_jacobian_of_the_arm_is_the_slip_of_the_touching_points():
    for q in configurations("arm"):
        elbow, tip = (x[0] for x in ARM.joints(q[None]))
        along = (tip - elbow) / 0.7
        reach = np.clip((q[2:4] - elbow) @ along, 0, 0.7)
        n = q[2:4] - elbow - reach * along
        n /= np.linalg.norm(n)
        turn = np.array([[np.cos(q[4]), -np.sin(q[4])], [np.sin(q[4]), np.cos(q[4])]])
        on_disk = {0: turn.T @ (-0.25 * n), 1: turn.T @ np.array([0.0, -0.25])}

        def slip(x, t, pair, on_disk=on_disk, reach=reach):
            c, s = np.cos(x[4]), np.sin(x[4])
            point = x[2:4] + np.array([[c, -s], [s, c]]) @ on_disk[pair]
            if pair == 0:
                elbow, tip = (y[0] for y in ARM.joints(x[None]))
                point = point - elbow - reach * (tip - elbow) / 0.7
            return t @ point

        J_t = ARM.contacts(q).J_t
        for pair, t in ((0, np.array([n[1], -n[0]])), (1, np.array([1.0, 0.0]))):
            J = central(lambda x, t=t, pair=pair: slip(x, t, pair), q)
            assert np.abs(J_t[pair] - J).max() < FD_TOL


@pytest.mark.parametrize("name", MECHANISMS)
def test_one_configuration_and_many_agree(name):
    mechanism, q = MECHANISMS[name], configurations(name)
    many = mechanism.contacts_of(q)
    assert many.phi.shape == (len(q), len(mechanism.pairs))
    for i, row in enumerate(q):
        one = mechanism.contacts(row)
        for field in ("phi", "J_n", "J_t"):
            assert np.abs(getattr(one, field) - getattr(many, field)[i]).max() < EXACT


def test_block_has_the_gap_and_jacobians_of_the_thesis():
    a, y = 1.0, 1.3
    for theta in np.linspace(-3.0, 3.0, 25):
        phi = BODIES["block"].contacts(np.array([0.2, y, theta])).phi
        # (2.19)
        terms = [y + sign * a / np.sqrt(2) * np.cos(np.pi / 4 + turn * theta) for sign in (-1, 1) for turn in (-1, 1)]
        assert phi.min() == pytest.approx(min(terms), abs=EXACT)
    # (2.20), its vertex being the lowest for 0 < θ < π/2
    theta = 0.3
    contacts = BODIES["block"].contacts(np.array([0.0, y, theta]))
    i = int(contacts.phi.argmin())
    assert contacts.J_n[i] == pytest.approx([0, 1, -a / np.sqrt(2) * np.sin(np.pi / 4 - theta)])
    assert contacts.J_t[i] == pytest.approx([1, 0, a / np.sqrt(2) * np.cos(np.pi / 4 - theta)])


def test_ellipse_touches_where_2_21_says_and_2_22_means_another_angle():
    """β of (2.21) is the parameter of (a cos β, b sin β); l of (2.22) needs the polar angle of the same point."""
    a, b = 2.0, 1.0
    body = PlanarFreeBody(Ellipse(semi_axes=(a, b)), 1.0, 1.25)
    for theta in (0.2, 0.7, 1.2):
        r = body.contact_points(np.array([theta]))[0, 0]
        on_body = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]]) @ r
        beta = np.arctan2(on_body[1] / b, on_body[0] / a)
        assert np.tan(np.pi - theta) == pytest.approx(-b / a / np.tan(beta))  # (2.21)

        def length(angle):  # (2.22)
            return a * b / np.sqrt(b**2 * np.cos(angle) ** 2 + a**2 * np.sin(angle) ** 2)

        polar = np.arctan2(on_body[1], on_body[0])
        assert length(polar) == pytest.approx(np.linalg.norm(r), rel=1e-12)
        assert abs(length(beta) - np.linalg.norm(r)) > 0.01


def test_wheel_touches_with_its_spokes_in_turn():
    wheel = MECHANISMS["wheel"]
    for i in range(8):
        q, _ = wheel.standing(0.1, -1.0, spoke=i)
        phi = wheel.contacts(q).phi
        assert phi.argmin() == i and phi[i] == pytest.approx(0.0, abs=EXACT)


def test_names_of_pairs():
    assert BODIES["block"].pairs == ("vertex_0", "vertex_1", "vertex_2", "vertex_3")
    assert BODIES["rod"].pairs == ("end_0", "end_1")
    assert BODIES["ellipse"].pairs == BODIES["disk"].pairs == ("ground",)
    assert ARM.pairs == ("arm", "ground") and MECHANISMS["wheel"].pairs[7] == "spoke_7"
