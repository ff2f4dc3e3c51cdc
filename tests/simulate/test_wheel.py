"""The rimless wheel: it rolls on its spokes with the known limit cycle, or slides where friction is low."""

import numpy as np
import pytest
from motions import G, checked, contact_velocity, limit_cycle

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel

WHEEL = RimlessWheel(8, 1.0, 1.0, 0.5, 0.15)


def rolled(h, seconds=10.0, mu=0.7, wheel=WHEEL, omega=-1.5):
    return checked(wheel, *wheel.standing(0.0, omega), round(seconds / h), mu=mu, epsilon=0.0, h=h)


def speeds_at_steps(record):
    """Angular velocities before and after each change of spoke; a dead impact takes two steps, closing and stopping."""
    standing = record.c_n.argmax(axis=1)
    carried = (record.c_n > 0).any(axis=1)
    change = np.flatnonzero((standing[1:] != standing[:-1]) & carried[1:] & carried[:-1]) + 1
    return record.v[change, 2], record.v[change + 2, 2]


def test_it_rolls_down_without_slip_spoke_after_spoke():
    record = rolled(5e-3)
    _, v_t = contact_velocity(record)
    assert np.abs(v_t[record.c_n > 0]).max() < 1e-9
    order = record.c_n.argmax(axis=1)[(record.c_n > 0).any(axis=1)]
    steps = np.diff(order)[np.diff(order) != 0] % 8
    assert len(steps) > 15 and len(set(steps)) == 1  # always the next one
    assert record.q[-1, 0] > 10.0 and record.v[-1, 2] < 0


@pytest.mark.slow
def test_limit_cycle_is_reached_to_first_order_in_the_time_step():
    errors = []
    for h in (4e-3, 2e-3, 1e-3):
        before, after = speeds_at_steps(rolled(h))
        expected = np.array(limit_cycle(WHEEL))
        found = np.array([before[-5:].mean(), after[-5:].mean()])
        errors.append(np.abs(found - expected).max())
    assert errors[-1] < 0.02 and errors[-1] < 0.6 * errors[0]


def test_support_carries_the_wheel_on_average():
    record = rolled(2e-3)
    half = record.steps // 2
    # over many steps the mean acceleration is small: the mean force is the weight's normal part
    assert record.c_n[half:].sum(axis=1).mean() == pytest.approx(G * np.cos(0.15), rel=0.02)


def test_it_slides_where_friction_is_below_the_slope():
    record = rolled(5e-3, seconds=4.0, mu=0.05)
    a = G * (np.sin(0.15) - 0.05 * np.cos(0.15))
    assert record.v[-1, 0] - record.v[400, 0] == pytest.approx(a * 400 * 5e-3, rel=0.03)
    _, v_t = contact_velocity(record)
    assert (v_t[400:][record.c_n[400:] > 0] > 0).all()


def test_mass_and_inertia_in_proportion_change_nothing_but_the_forces():
    one, two = (rolled(5e-3, wheel=RimlessWheel(8, 1.0, m, 0.5 * m, 0.15)) for m in (1.0, 2.0))
    assert np.abs(one.q - two.q).max() < 1e-7
    assert two.c_n.sum() == pytest.approx(2 * one.c_n.sum(), rel=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"spokes": 2}, "spokes"),
        ({"length": -1.0}, "spokes"),
        ({"slope": 1.6}, "slope"),
        ({"slope": -0.1}, "slope"),
        ({"mass": 0.0}, "mass"),
        ({"inertia": np.nan}, "inertia"),
    ],
)
def test_wrong_wheels_are_refused(change, message):
    good = {"spokes": 8, "length": 1.0, "mass": 1.0, "inertia": 0.5, "slope": 0.15}
    with pytest.raises(UserError, match=message):
        RimlessWheel(**(good | change))


def test_a_lean_beyond_the_next_spoke_is_refused():
    with pytest.raises(UserError, match="stands on one"):
        WHEEL.standing(0.5, -1.0)
