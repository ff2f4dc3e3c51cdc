"""Central contacts under each normal force: what textbooks and two simulators' own relations say of them."""

import numpy as np
import pytest

from thesis_lib.contact.compliant.normal_force import HuntCrossley, LinearDamper, NormalForce
from thesis_lib.critique.contacts.contact_time import duration
from thesis_lib.simulate.mujoco.contact import damped_bounce

TABLE = 2e-4  # of ε, S and s between the nodes of the table
EPSILON = np.array([0.1, 0.3, 0.55, 0.8, 0.99])
FORCES = [NormalForce(), NormalForce(1.5), LinearDamper(), HuntCrossley(), HuntCrossley(1.5)]


@pytest.mark.parametrize("force", FORCES, ids=repr)
def test_the_loss_of_a_restitution_has_this_restitution(force):
    assert force.restitution(force.loss(EPSILON)) == pytest.approx(EPSILON, abs=TABLE)
    assert force.epsilon_at(EPSILON, np.ones(5), -np.ones(5)) == pytest.approx(EPSILON, abs=TABLE)
    assert force.tau_at(np.full(5, 1e-3), EPSILON, np.ones(5), -np.ones(5)) == pytest.approx(1e-3)


@pytest.mark.parametrize("ratio", [0.05, 0.22, 0.6, 1.5])
def test_a_damped_contact_is_a_damped_half_oscillation(ratio):
    force, loss = LinearDamper(), np.array(2.0 * ratio)
    epsilon, time = damped_bounce(ratio)
    assert force.restitution(loss) == pytest.approx(epsilon, abs=TABLE)
    assert force.duration(loss) == pytest.approx(time, rel=TABLE)
    # it ends below the surface, where the damper pulls as much as the spring pushes
    assert force.centroid(loss) == pytest.approx(epsilon * (time + 2.0 * ratio) / (1.0 + epsilon), rel=TABLE)


def test_restitution_of_hunt_and_crossley_falls_with_speed_whatever_the_exponent():
    v = np.array([0.3, 1.0, 3.0])
    linear, hertz = (f.epsilon_at(np.full(3, 0.7), np.ones(3), -v) for f in (HuntCrossley(), HuntCrossley(1.5)))
    assert linear == pytest.approx(hertz, abs=TABLE)
    D = HuntCrossley().loss(np.array(0.7)) * v
    # from v dv / (1 + d v) = −k/m δⁿ dδ
    assert D * (1.0 + linear) == pytest.approx(np.log((1.0 + D) / (1.0 - linear * D)), abs=10 * TABLE)
    assert linear[0] > 0.7 > linear[2]


def test_a_light_end_loses_more_to_a_damper_and_not_to_the_others():
    b, v = np.array([1.0, 2.0, 4.0]), -np.ones(3)
    damped = LinearDamper().epsilon_at(np.full(3, 0.7), b, v)
    assert (np.diff(damped) < -0.05).all()
    assert damped[2] == pytest.approx(damped_bounce(LinearDamper().loss(np.array(0.7)))[0], abs=TABLE)  # D √4 = 2 ζ'
    for force in (NormalForce(), HuntCrossley()):
        assert force.epsilon_at(np.full(3, 0.7), b, v) == pytest.approx(0.7, abs=TABLE)


def test_times_of_the_hysteretic_spring():
    force, loss = NormalForce(), EPSILON**2
    assert force.duration(loss) == pytest.approx(0.5 * np.pi * (1.0 + EPSILON))
    assert force.duration(loss) / force.centroid(loss) == pytest.approx([duration(1.0, e) for e in EPSILON], rel=1e-5)


def test_a_contact_of_hertz_is_shorter_in_faster_impacts():
    tau = NormalForce(1.5).tau_at(np.full(2, 1e-3), np.full(2, 0.5), np.ones(2), -np.array([1.0, 32.0]))
    assert tau[1] / tau[0] == pytest.approx(0.5)  # T ~ v^(−1/5)
    lighter = NormalForce(1.5).tau_at(np.full(1, 1e-3), np.full(1, 0.5), np.full(1, 32.0), -np.ones(1))
    assert lighter[0] / np.sqrt(32.0) == pytest.approx(1e-3 * 32.0**-0.4)  # T ~ m^(2/5)
