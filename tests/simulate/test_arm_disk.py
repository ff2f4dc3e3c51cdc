"""Arm and disk: Drake's dynamics against two links by hand, contact in every step, mirror image, refusals."""

import numpy as np
import pytest
from motions import SLIDES, G, checked, contact_velocity

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import arm_disk, arm_trajectories
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.stepping import simulate

EXACT = 1e-12
GOOD = {
    "link_lengths": (0.8, 0.7),
    "link_masses": (1.1, 0.9),
    "link_coms": (0.3, 0.4),
    "link_inertias": (0.06, 0.05),
    "disk_radius": 0.25,
    "disk_mass": 1.3,
    "disk_inertia": 0.04,
    "base": (0.1, 0.5),
}
ARM = ArmDisk(**GOOD)


def by_hand(q, v):
    """M, C v and gravity (all on the left-hand side's terms) of two links in the plane, from Lagrange's equations."""
    (l1, _), (m1, m2), (c1, c2), (I1, I2) = (
        GOOD[k] for k in ("link_lengths", "link_masses", "link_coms", "link_inertias")
    )
    cos2, sin2 = np.cos(q[1]), np.sin(q[1])
    M22 = I2 + m2 * c2**2
    M12 = M22 + m2 * l1 * c2 * cos2
    M11 = I1 + m1 * c1**2 + m2 * l1**2 + M22 + 2 * m2 * l1 * c2 * cos2
    k = m2 * l1 * c2 * sin2
    bias = [-k * (2 * v[0] * v[1] + v[1] ** 2), k * v[0] ** 2]
    first, second = np.cos(q[0]), np.cos(q[0] + q[1])
    gravity = [-G * ((m1 * c1 + m2 * l1) * first + m2 * c2 * second), -G * m2 * c2 * second]
    return np.array([[M11, M12], [M12, M22]]), np.array(bias), np.array(gravity)


def states(n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (n, 5)), rng.uniform(-4, 4, (n, 5))


def test_drake_gives_the_dynamics_of_two_links_by_hand():
    for q, v in zip(*states(30)):
        M, bias, gravity = by_hand(q, v)
        full = np.zeros((5, 5))
        full[:2, :2], full[2:, 2:] = M, np.diag([1.3, 1.3, 0.04])
        assert np.abs(ARM.mass_matrix(q) - full).max() < EXACT
        assert np.abs(ARM.bias(q, v) - [*bias, 0, 0, 0]).max() < 1e-11
        assert np.abs(ARM.gravity(q) - [*gravity, 0, -1.3 * G, 0]).max() < 1e-11


def test_centre_of_mass_off_the_link_keeps_the_inertia_about_it():
    off = ArmDisk(**(GOOD | {"link_coms": ((0.3, 0.1), (0.0, -0.2))}))
    q = np.zeros(5)
    # about the second joint: I2 + m2 (c_x² + c_y²)
    assert off.mass_matrix(q)[1, 1] == pytest.approx(0.05 + 0.9 * 0.04)
    assert off.gravity(q)[1] == pytest.approx(0.0, abs=EXACT)  # it hangs below the joint


def test_each_step_of_pushing_the_disk_obeys_contact():
    arm, kept = arm_disk(), arm_trajectories(3, np.random.default_rng(1))
    for record in kept.records:
        again = checked(arm, record.q[0], record.v[0], record.steps, mu=0.4, epsilon=0.0, torque=record.f_ext)
        assert np.array_equal(again.q, record.q)
        assert (record.c_n > 0).all(axis=1).sum() >= 50  # both pairs at once
        assert record.phi.min() > -2e-3
        _, v_t = contact_velocity(record)
        slip = (record.c_n > 0) & (np.abs(v_t) > SLIDES)
        assert slip[:, 1].any()  # on the ground, without which mass and inertia of the disk are not identifiable


def test_contact_on_the_arm_conserves_what_it_should():
    """Horizontal momentum of a disk in the air changes only by the arm's force, which acts back on the arm."""
    q = np.array([0.3, -1.2, 0.0, 2.0, 0.0])
    elbow, tip = (x[0] for x in ARM.joints(q[None]))
    across = np.array([elbow[1] - tip[1], tip[0] - elbow[0]]) / 0.7
    q[2:4] = 0.5 * (elbow + tip) + (0.25 + 1e-3) * across
    v = np.array([0.0, 0.0, *(-2.0 * across), 0.0])
    record = checked(ARM, q, v, 1, mu=0.5, epsilon=0.3, h=1e-3)
    c = record.h * record.c_n[0, 0] * across
    assert record.c_n[0, 0] > 0
    assert 1.3 * (record.v[1, 2:4] - v[2:4] - [0, -G * 1e-3]) == pytest.approx(
        c + record.h * record.c_t[0, 0] * np.array([across[1], -across[0]]), abs=1e-10
    )
    # the link's share is that of the opposite force at the touching point: virtual work
    force = -c - record.h * record.c_t[0, 0] * np.array([across[1], -across[0]])
    touch = 0.5 * (elbow + tip)
    moments = [np.cross([*(touch - o), 0], [*force, 0])[2] for o in (ARM.base, elbow)]
    M, _, gravity = by_hand(q, v)
    assert M @ record.v[1, :2] - 1e-3 * gravity == pytest.approx(moments, abs=1e-10)


def test_mirror_image():
    """Mirrored about the base's vertical: q_1 -> π - q_1, all other angles, x and torques change sign."""
    arm = ArmDisk(**(GOOD | {"base": (0.0, 0.5)}))
    record = arm_trajectories(1, np.random.default_rng(2)).records[0]
    flip = np.array([-1.0, -1.0, -1.0, 1.0, -1.0])
    offset = np.array([np.pi, 0, 0, 0, 0])
    options = {"mu": 0.4, "epsilon": 0.3}
    here = checked(arm, record.q[0], record.v[0], 120, torque=record.f_ext[:120], **options)
    there = checked(
        arm, flip * record.q[0] + offset, flip * record.v[0], 120, torque=flip * record.f_ext[:120], **options
    )
    assert (here.c_n > 0).any(axis=0).all()
    assert np.abs(flip * here.q + offset - there.q).max() < 1e-6
    assert here.c_n == pytest.approx(there.c_n, rel=1e-4, abs=1e-4)


def test_free_swing_keeps_its_energy_to_first_order_in_the_time_step():
    q0, v0 = np.array([0.3, 0.4, 5.0, 10.0, 0.0]), np.zeros(5)

    def drift(h):
        record = simulate(ARM, q0, v0, None, h, round(0.5 / h), 0.5, 0.0)
        energy = []
        for q, v in zip(record.q, record.v):
            M, _, _ = by_hand(q, v)
            heights = 0.3 * np.sin(q[0]), 0.8 * np.sin(q[0]) + 0.4 * np.sin(q[0] + q[1])
            energy.append(0.5 * v[:2] @ M @ v[:2] + G * (1.1 * heights[0] + 0.9 * heights[1]))
        return np.ptp(energy)

    assert drift(1e-3) / drift(5e-4) == pytest.approx(2.0, rel=0.1)


def test_trajectories_repeat_and_those_left_out_are_counted():
    one, two = (arm_trajectories(3, np.random.default_rng(5)) for _ in range(2))
    assert all(np.array_equal(a.q, b.q) for a, b in zip(one.records, two.records))
    assert one.tried == 3 + sum(one.left_out.values())


@pytest.mark.parametrize("part", ["link_lengths", "link_masses", "link_inertias"])
def test_unphysical_links_are_refused(part):
    with pytest.raises(UserError, match="link 2"):
        ArmDisk(**(GOOD | {part: (1.0, 0.0)}))


def test_other_refusals():
    with pytest.raises(UserError, match="disk"):
        ArmDisk(**(GOOD | {"disk_mass": -1.0}))
    with pytest.raises(UserError, match="finite"):
        ArmDisk(**(GOOD | {"base": (np.nan, 0.0)}))
    with pytest.raises(UserError, match="no normal"):
        ARM.contacts(np.array([0.0, 0.0, 1.2, 0.5, 0.0]))
    with pytest.raises(ValueError, match="finite"):
        ARM.mass_matrix(np.full(5, np.nan))
    with pytest.raises(UserError, match="finite"):
        simulate(ARM, np.full(5, np.inf), np.zeros(5), None, 5e-3, 3, 0.4, 0.0)
