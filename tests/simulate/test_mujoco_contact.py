"""MuJoCo's contact: the map between (ε, T) and its stiffness and damping both ways, what its friction does."""

import mujoco
import numpy as np
import pytest
from falling import DISK

from thesis_lib.simulate.mujoco.causes import MujocoCauses
from thesis_lib.simulate.mujoco.contact import MujocoContact, damped_bounce, restitution_and_time, spring_and_damper
from thesis_lib.simulate.mujoco.model import drop_model, share

RADIUS = DISK.shape.radius
SPEED = 2.0


@pytest.mark.parametrize("epsilon", [0.05, np.exp(-2.0), 0.3, 0.55, 0.9, 1.0])
@pytest.mark.parametrize("contact_time", [2e-5, 1e-3])
def test_the_map_is_its_own_inverse(epsilon, contact_time):
    back = restitution_and_time(*spring_and_damper(epsilon, contact_time))
    np.testing.assert_allclose(back, (epsilon, contact_time), rtol=1e-6)


def test_the_bounce_is_smooth_where_damping_becomes_critical():
    below, at, above = (np.array(damped_bounce(z)) for z in (1.0 - 1e-4, 1.0, 1.0 + 1e-4))
    np.testing.assert_allclose(at, 0.5 * (below + above), rtol=1e-6)
    assert damped_bounce(1.0)[0] == pytest.approx(np.exp(-2.0))
    assert damped_bounce(0.0) == (1.0, pytest.approx(np.pi))


def test_impedance_says_whether_the_contact_time_knows_the_effective_mass():
    """Near 1 an off-centre impact lasts as long as a central one; near 0 it is a spring, T ~ sqrt(m_eff)."""
    lasting = {}
    for impedance in (0.9999, 1e-3):
        for lever in (0.0, 0.02):
            contact = MujocoContact(epsilon=0.9, mu=0.0, impedance=impedance)
            model = drop_model(DISK, contact, MujocoCauses(com_offset_x=-lever), 0.0)
            data = mujoco.MjData(model)
            data.qpos[1], data.qvel[1], pressed = RADIUS + 1e-7, -SPEED, 0
            for _ in range(2 * contact.steps):
                mujoco.mj_step(model, data)
                pressed += data.nefc > 0 and data.efc_force[0] > 0.0
            lasting[impedance, lever] = pressed
    assert lasting[0.9999, 0.02] == pytest.approx(lasting[0.9999, 0.0], rel=0.02)
    spring = np.sqrt(1.0 / (1.0 + 0.02**2 / DISK.radius_of_gyration**2))
    # 0.9: damping shortens it a little more
    assert lasting[1e-3, 0.02] / lasting[1e-3, 0.0] == pytest.approx(spring, rel=0.02)


@pytest.mark.parametrize("epsilon", [0.3, 0.55])
def test_a_contact_that_sticks_keeps_the_share_epsilon_squared_of_its_slip(epsilon):
    # so short that the lever is the same throughout
    contact = MujocoContact(epsilon=epsilon, mu=2.0, contact_time=2e-5, impedance=0.9999, impratio=1.0, steps=2000)
    model, slip, force = drop_model(DISK, contact, MujocoCauses(), 0.0), 0.05, []
    data = mujoco.MjData(model)
    data.qpos[1], data.qvel[:2] = RADIUS + 1e-4 * SPEED * contact.contact_time, (slip, -SPEED)
    for _ in range(int(1.5 * contact.steps)):
        mujoco.mj_step(model, data)
        force.append(data.efc_force.copy() if data.nefc else np.zeros(3))
    normal, *friction = np.array(force).T
    assert (np.hypot(*friction) < 0.999 * 2.0 * normal)[normal > 0.0].mean() > 0.99  # it never slides
    left = data.qvel[0] + RADIUS * data.qvel[2]
    assert left / slip == pytest.approx(epsilon**2, rel=0.02)


def test_a_contact_that_slides_is_lifted_by_what_friction_would_need_beyond_its_cone():
    """a_n − a_n* + R_n f_n = μ |a_t − a_t* + R_t f_t|, the complementarity of the convex program (Todorov 2011)."""
    mu, slip, depth = 0.15, 3.0, 2e-4
    contact = MujocoContact(mu=mu)
    model = drop_model(DISK, contact, MujocoCauses(), 9.81)
    data = mujoco.MjData(model)
    data.qpos[1], data.qvel[:2] = RADIUS - depth, (slip, -SPEED)
    mujoco.mj_forward(model, data)
    assert np.hypot(*data.efc_force[1:]) == pytest.approx(mu * data.efc_force[0], rel=1e-6)
    beyond = data.efc_J.reshape(-1, model.nv) @ data.qacc - data.efc_aref + data.efc_R * data.efc_force
    assert beyond[0] == pytest.approx(mu * np.hypot(*beyond[1:]), rel=1e-6)
    assert beyond[0] > 0.1 * mu * spring_and_damper(0.55, 1e-3)[1] * slip  # and that is more than rounding


def test_the_share_of_a_central_impact_is_that_of_the_constraint():
    contact = MujocoContact(impedance=0.4, mu=0.0)
    model = drop_model(DISK, contact, MujocoCauses(), 9.81)
    data = mujoco.MjData(model)
    data.qpos[1], data.qvel[1] = RADIUS - 1e-4, -SPEED
    mujoco.mj_forward(model, data)
    mass = 1.0 / DISK.mass
    expected = mass / (mass + data.efc_R[0]) / contact.impedance
    assert share(model, contact) == pytest.approx(expected, rel=1e-9)
