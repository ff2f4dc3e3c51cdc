"""The map from (μ, ε, T) to an engine's numbers and back, each way against the engine itself."""

import numpy as np
import pytest
from engine_states import DISK, ELLIPSE, MASS

from thesis_lib.engines.drake_engine import DrakeEngine
from thesis_lib.engines.engine import impacts
from thesis_lib.engines.mujoco_engine import MujocoEngine
from thesis_lib.engines.parameters import (
    DrakeNumbers,
    MujocoNumbers,
    bullet_numbers,
    drake_numbers,
    mujoco_numbers,
    of_bullet,
    of_drake,
    of_mujoco,
)
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mujoco.contact import MujocoContact, spring_and_damper
from thesis_lib.simulate.rig.hidden_causes import REFERENCE_SPEED, CompliantContact

ASKED = [(0.2, 1e-3), (0.55, 3e-4), (0.55, 3e-3), (0.9, 1e-3)]
ROUND = 1e-6  # relative: roots to 1e-14, integrals to 1e-10
MEASURED = 3e-3  # of ε, and of T relative: 30 steps a contact in MuJoCo, 1e-3 of accuracy in Drake
FIELD = 0.03  # of both in hydroelastic contact, whose force is a power of the depth to a few per cent
GRAVITY = 1e-6  # m/s²: the map leaves it out


def landing(engine, body, slip=0.0, **options):
    """Velocity after, and duration of, a central impact at the reference speed."""
    q = np.array([[0.0, -body.shape.contact_point(np.zeros(1))[0, 1], 0.0]])
    made = impacts(engine(body, 1, gravity=GRAVITY, **options), q, np.array([[slip, -REFERENCE_SPEED, 0.0]]))
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
    with pytest.raises(UserError, match="two positive numbers, or two negative"):
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
@pytest.mark.parametrize("impedance", [0.01, 0.95])
def test_mujoco_lands_with_what_was_asked_for(epsilon, contact_time, impedance):
    contact = MujocoContact(epsilon=epsilon, contact_time=contact_time, impedance=impedance, steps=30)
    v, t = landing(MujocoEngine, DISK, contact=contact)
    # its force ends where K φ + B v = 0, below the surface: the body needs B/K more to be where it touched
    K, B = spring_and_damper(epsilon, contact_time)
    assert v[1] / REFERENCE_SPEED == pytest.approx(epsilon, abs=MEASURED)
    assert t - B / K == pytest.approx(contact_time, rel=MEASURED)


@pytest.mark.parametrize(("epsilon", "contact_time"), ASKED)
def test_drake_lands_with_what_was_asked_for(epsilon, contact_time):
    v, t = landing(DrakeEngine, DISK, contact=CompliantContact(epsilon=epsilon, contact_time=contact_time))
    assert v[1] / REFERENCE_SPEED == pytest.approx(epsilon, abs=MEASURED)
    assert t == pytest.approx(contact_time, rel=MEASURED)


@pytest.mark.parametrize("epsilon", [0.3, 0.7])
def test_drakes_pressure_field_lands_with_what_was_asked_for(epsilon):
    contact = CompliantContact(epsilon=epsilon, contact_time=2e-3)
    v, t = landing(DrakeEngine, ELLIPSE, contact=contact, surface="hydroelastic")
    assert v[1] / REFERENCE_SPEED == pytest.approx(epsilon, abs=FIELD)
    assert t == pytest.approx(contact.contact_time, rel=FIELD)


@pytest.mark.parametrize("mu", [0.05, 0.3])
@pytest.mark.parametrize("engine", [MujocoEngine, DrakeEngine])
def test_a_sliding_impact_has_the_friction_that_was_asked_for(engine, mu):
    """Momentum along the surface over momentum off it, of a body that slides from touch to end."""
    options = {"mu": mu, "contact_time": 2e-4}
    contact = MujocoContact(**options, steps=30) if engine is MujocoEngine else CompliantContact(**options)
    v, _ = landing(engine, DISK, slip=8.0, contact=contact)
    assert v[0] + v[2] * 0.03 > 1.0  # m/s: it still slides
    assert (8.0 - v[0]) / (v[1] + REFERENCE_SPEED) == pytest.approx(mu, rel=MEASURED)


def test_the_numbers_of_a_file_are_those_of_the_engine():
    """Drake's spring in series with itself is that of `spring`, which the engine uses."""
    from thesis_lib.simulate.drake.hunt_crossley import spring

    made = spring(0.55, 1e-3, MASS)
    numbers = drake_numbers(0.15, 0.55, 1e-3, mass=MASS)
    assert numbers == DrakeNumbers(
        pytest.approx(2.0 * made.stiffness, rel=ROUND), pytest.approx(made.dissipation, rel=ROUND), 0.15
    )
