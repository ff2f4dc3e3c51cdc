"""The map from (μ, ε, T) to an engine's numbers and back, each way against the engine itself."""

import numpy as np
import pytest
from engine_states import DISK, ELLIPSE, ENGINES, MASS, SOFT, SQUARE, STILL, of

from thesis_lib.engines.engine import impacts
from thesis_lib.engines.parameters import (
    MujocoNumbers,
    bullet_numbers,
    drake_numbers,
    mujoco_numbers,
    of_bullet,
    of_drake,
    of_mujoco,
)
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.drake.modulus import central_angle
from thesis_lib.simulate.mujoco.contact import spring_and_damper
from thesis_lib.simulate.rig.hidden_causes import REFERENCE_SPEED

ASKED = [(0.2, 1e-3), (0.55, 3e-4), (0.55, 3e-3), (0.9, 1e-3)]
ROUND = 1e-6  # relative: roots to 1e-14, integrals to 1e-10
# of ε, and of T relative: 30 steps a contact in MuJoCo, 1e-3 of accuracy in Drake, a hundred implicit steps in Bullet
MEASURED = 3e-3
FIELD = 0.03  # of both in hydroelastic contact, whose force is a power of the depth to a few per cent


def landing(name, body, slip=0.0, theta=0.0, **contact):
    """Velocity after, and duration of, a central impact at the reference speed."""
    q = np.array([[0.0, -body.shape.contact_point(np.array([theta]))[0, 1], theta]])
    made = impacts(of(name, body, 1, gravity=STILL, **contact), q, np.array([[slip, -REFERENCE_SPEED, 0.0]]))
    assert made.left.all() and made.t[0] > 0.0
    return made.v[0], made.t[0]


@pytest.mark.parametrize(("epsilon", "contact_time"), ASKED)
@pytest.mark.parametrize("impedance", [0.01, 0.95])
@pytest.mark.parametrize("points", [1, 2, 4])
def test_mujocos_numbers_and_back(epsilon, contact_time, impedance, points):
    numbers = mujoco_numbers(0.23, epsilon, contact_time, impedance=impedance, points=points)
    back = of_mujoco(numbers, points)
    np.testing.assert_allclose(back, (0.23, epsilon, contact_time), rtol=ROUND)
    if impedance < 0.5 and points > 1:  # and the number of points matters
        assert of_mujoco(numbers)[2] > 1.3 * contact_time


def test_mujocos_own_form_of_solref_is_the_same_contact():
    """Time constant and damping ratio: b = 2/(d t), k = 1/(d t ζ)², as its documentation has them."""
    t, zeta, d = 0.02, 0.4, 0.95
    direct = MujocoNumbers((-1.0 / (t * zeta) ** 2 / d, -2.0 / t), (d, d, 1e-3, 0.5, 2.0), 0.1, 1.0)
    own = MujocoNumbers((t, zeta), direct.solimp, 0.1, 1.0)
    np.testing.assert_allclose(of_mujoco(own), of_mujoco(direct), rtol=ROUND)
    with pytest.raises(UserError, match="two positive or two negative numbers"):
        of_mujoco(MujocoNumbers((0.02, -1.0), direct.solimp, 0.1, 1.0))


@pytest.mark.parametrize(("epsilon", "contact_time"), ASKED)
@pytest.mark.parametrize("points", [1, 2])
def test_drakes_numbers_and_back(epsilon, contact_time, points):
    for speed in (None, 1.0):
        numbers = drake_numbers(0.23, epsilon, contact_time, mass=MASS, points=points, speed=speed)
        np.testing.assert_allclose(of_drake(numbers, MASS, points, speed), (0.23, epsilon, contact_time), rtol=ROUND)


@pytest.mark.parametrize(("epsilon", "contact_time"), [*ASKED, (0.05, 1e-3)])
@pytest.mark.parametrize("points", [1, 2])
def test_bullets_numbers_and_back(epsilon, contact_time, points):
    for steps in (100, 1000):
        more = {"mass": MASS, "step": contact_time / steps, "points": points}
        numbers = bullet_numbers(0.23, epsilon, contact_time, **more)
        np.testing.assert_allclose(of_bullet(numbers, **more), (0.23, epsilon, contact_time), rtol=ROUND)


def test_bullets_numbers_hold_for_one_time_step():
    """Implicit steps damp: without a damper a hundred steps in a contact leave 0.952, at any mass and time."""
    more = {"mass": MASS, "step": 1e-5}
    numbers = bullet_numbers(0.23, 0.99, 1e-3, **more)
    assert numbers.damping == 0.0 and of_bullet(numbers, **more)[1] == pytest.approx(0.952, abs=5e-4)
    numbers = bullet_numbers(0.23, 0.6, 1e-3, **more)
    assert of_bullet(numbers, MASS, 1e-4)[1] < 0.45 and of_bullet(numbers, MASS, 1e-6)[1] > 0.61


@pytest.mark.parametrize(("epsilon", "contact_time"), ASKED)
@pytest.mark.parametrize("name", SOFT)
def test_an_engine_lands_with_what_was_asked_for(name, epsilon, contact_time):
    # the force of a damper ends where K φ + B v = 0, below the surface: the body needs B/K more to be where it touched
    K, B = spring_and_damper(epsilon, contact_time)
    late, rough = (0.0, 0.0) if name == "drake" else (B / K, B * contact_time / 100 if name == "bullet" else 0.0)
    for given in ({"impedance": 0.01}, {"impedance": 0.95}) if name == "mujoco" else ({},):
        v, t = landing(name, DISK, epsilon=epsilon, contact_time=contact_time, **given)
        assert v[1] / REFERENCE_SPEED == pytest.approx(epsilon, abs=MEASURED)
        assert t - late == pytest.approx(contact_time, rel=MEASURED + rough)


@pytest.mark.parametrize("body", [ELLIPSE, SQUARE], ids=["ellipse", "square"])
@pytest.mark.parametrize("epsilon", [0.3, 0.7])
def test_drakes_pressure_field_lands_with_what_was_asked_for(epsilon, body):
    field = {"options": {"surface": "hydroelastic"}, "theta": central_angle(body) + 1e-3}
    v, t = landing("drake", body, epsilon=epsilon, contact_time=2e-3, **field)
    assert v[1] / REFERENCE_SPEED == pytest.approx(epsilon, abs=FIELD)
    assert t == pytest.approx(2e-3, rel=FIELD)


@pytest.mark.parametrize("mu", [0.05, 0.3])
@pytest.mark.parametrize("name", ENGINES)
def test_a_sliding_impact_has_the_friction_that_was_asked_for(name, mu):
    """Momentum along the surface over momentum off it, of a body that slides from touch to end."""
    for slip in (8.0, -8.0):
        v, _ = landing(name, DISK, slip=slip, mu=mu, contact_time=2e-4)
        assert abs(v[0] + v[2] * 0.03) > 1.0  # m/s: it still slides
        assert (slip - v[0]) / (v[1] + REFERENCE_SPEED) == pytest.approx(np.sign(slip) * mu, rel=MEASURED)
