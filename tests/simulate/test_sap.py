"""Drake's compliant contact: its forces balance, carry weight and obey Coulomb; where rigid contact agrees with it."""

import numpy as np
import pytest
from motions import BODIES, G, H, balance, checked, drops, limit_cycle

from benchmarks.sap import STIFFNESS, simulate_sap
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import arm_disk, arm_trajectories
from thesis_lib.simulate.stepping.multibody import Mechanism, PlanarFreeBody
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel

SOLVER_TOL = 1e-5  # N s; the solver's own accuracy is 1e-5 relative, of impulses of some N s; about 1e-7 is seen
WHEEL = RimlessWheel(8, 1.0, 1.0, 0.5, 0.15)


def obeys(mechanism, record, mu):
    assert np.abs(balance(mechanism, record)).max() < SOLVER_TOL
    assert (record.c_n >= -1e-9).all()
    assert (np.abs(record.c_t) <= mu * record.c_n + 1e-6).all()
    assert (record.phi[record.c_n > 1.0] < 1e-3).all()
    assert np.isnan(record.residual).all()


@pytest.mark.parametrize("name", BODIES)
def test_forces_read_out_balance_the_motion_of_drops(name):
    q, v = drops(name, 2, seed=1)
    for q0, v0 in zip(q, v):
        record = simulate_sap(BODIES[name], q0, v0, None, H, 300, 0.7)
        obeys(BODIES[name], record, 0.7)
        assert (record.c_n > 0).any() and record.phi.min() < 0  # compliant: it does press in


def test_arm_and_disk_balance_and_start_as_with_rigid_contact():
    arm = arm_disk()
    rigid = arm_trajectories(1, np.random.default_rng(1)).records[0]
    soft = simulate_sap(arm, rigid.q[0], rigid.v[0], rigid.f_ext, H, rigid.steps, 0.4)
    obeys(arm, soft, 0.4)
    assert (soft.c_n > 0).any(axis=0).all()
    first = int(np.argmax((rigid.c_n > 0).any(axis=1)))
    assert np.abs(soft.q[: first + 1] - rigid.q[: first + 1]).max() < 1e-9  # no contact yet
    # the impact is as dead in both: impulses of the first 50 ms within a tenth
    window = slice(first, first + 10)
    assert soft.c_n[window].sum() == pytest.approx(rigid.c_n[window].sum(), rel=0.1)


def test_weight_is_carried_at_the_depth_of_the_spring():
    record = simulate_sap(BODIES["disk"], [0, 0.5, 0], [0, 0, 0], None, H, 200, 0.7)
    assert record.c_n[-1, 0] == pytest.approx(G, rel=1e-6)
    assert -record.phi[-1, 0] == pytest.approx(G / STIFFNESS, rel=0.05)


@pytest.mark.parametrize("mu", [0.1, 0.6])
def test_sliding_and_sticking_on_a_slope_agree_with_rigid_contact(mu):
    body = PlanarFreeBody(BODIES["block"].shape, 1.0, 1.0 / 6.0, tilt=0.3)
    soft = simulate_sap(body, [0, 0.5, 0], [0, 0, 0], None, H, 200, mu)
    rigid = checked(body, [0, 0.5, 0], [0, 0, 0], 200, mu=mu, epsilon=0.0)
    assert soft.v[-1, 0] == pytest.approx(rigid.v[-1, 0], abs=0.01)


def test_disk_reaches_the_same_rolling_speed():
    soft = simulate_sap(BODIES["disk"], [0, 0.7, 0], [2, 0, 3], None, H, 400, 0.7)
    rigid = checked(BODIES["disk"], [0, 0.7, 0], [2, 0, 3], 400, epsilon=0.0)
    assert soft.v[-1] == pytest.approx(rigid.v[-1], abs=2e-3)


def test_wheel_rolls_downhill_near_its_limit_cycle():
    record = simulate_sap(WHEEL, *WHEEL.standing(0.0, -1.5), None, H, 1600, 0.7)
    obeys(WHEEL, record, 0.7)
    assert record.v[800:, 2].min() == pytest.approx(limit_cycle(WHEEL)[0], rel=0.15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"h": 0.0}, "positive h"),
        ({"stiffness": -1.0}, "stiffness"),
        ({"mu": np.nan}, "mu"),
        ({"q0": [0, np.nan, 0]}, "finite"),
        ({"torque": np.zeros(7)}, "external force"),
    ],
)
def test_wrong_input_is_refused(change, message):
    good = {"q0": [0, 1, 0], "v0": [0, 0, 0], "torque": None, "h": H, "steps": 5, "mu": 0.7}
    with pytest.raises(UserError, match=message):
        simulate_sap(BODIES["disk"], **(good | change))


def test_a_mechanism_that_drake_has_no_shape_for_is_refused():
    class Other(Mechanism):
        nv = 1
        pairs = ()
        mass_matrix = bias = gravity = contacts_of = lambda self, *a: None

    with pytest.raises(UserError, match="Other"):
        simulate_sap(Other(), [0], [0], None, H, 5, 0.7)
