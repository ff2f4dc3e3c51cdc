"""The time stepping of contact: its conditions in every step, motions with a known outcome, and what is refused."""

import numpy as np
import pytest
from motions import BALANCE_TOL, BODIES, EPSILON, MU, RESIDUAL_TOL, G, H, balance, checked, contact_velocity, drops

from thesis_lib.bodies.shapes import Disk
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.contact_modes import V_REBOUND, solve_one, solve_several
from thesis_lib.simulate.stepping.lcp import (
    LcpStatus,
    complementarity_residual,
    contact_lcp,
    lcp_matrices,
    solve_lcp_enumeration,
)
from thesis_lib.simulate.stepping.multibody import ContactGeometry, Mechanism, PlanarFreeBody
from thesis_lib.simulate.stepping.stepping import StateTerms, simulate, step_lcp

EXACT = 1e-12  # rounding over some hundred steps
AGREE = 1e-9  # relative, between two direct solvers of one LCP


@pytest.mark.parametrize("name", BODIES)
def test_drops_obey_contact_in_every_step(name):
    q, v = drops(name, 20)
    touched = fast = slid = 0
    for q0, v0, mu in zip(q, v, 10 * (MU, 0.1)):
        record = checked(BODIES[name], q0, v0, 300, mu=mu)
        v_n, v_t = contact_velocity(record)
        touched += (record.c_n > 0).any(axis=1).sum()
        fast += ((record.c_n > 0) & (v_n > V_REBOUND)).sum()
        slid += ((record.c_n > 0) & (np.abs(v_t) > 1e-9)).sum()
    assert touched > 40 and min(fast, slid) > 5  # else nothing was tested


def test_the_checks_notice_a_wrong_force_and_a_wrong_mode():
    q, v = drops("ellipse", 1)
    record = checked(BODIES["ellipse"], q[0], v[0], 300)
    k = int(np.argmax(record.c_n[:, 0] > 0))
    record.c_n[k, 0] *= 1.0 + 1e-6
    assert np.abs(balance(BODIES["ellipse"], record)).max() > BALANCE_TOL
    z = np.array([[1.0, 0.0, 0.0, 0.0]])
    M, w = lcp_matrices(np.eye(2), np.array([0.0, -1.0]), np.zeros(1), np.array([0.5]))
    assert complementarity_residual(M[None], w[None], z * (1 + 1e-8))[0] > RESIDUAL_TOL


@pytest.mark.parametrize("name", BODIES)
def test_flight_is_the_discrete_parabola(name):
    q0, v0 = drops(name, 1, seed=3)
    record = checked(BODIES[name], q0[0] + [0, 20, 0], v0[0], 200)
    k = np.arange(201)
    assert np.abs(record.v[:, 1] - (v0[0, 1] - G * H * k)).max() < EXACT
    # y_k = y_0 + h k v_0 - g h² k (k+1) / 2
    y = q0[0, 1] + 20 + H * k * v0[0, 1] - 0.5 * G * H**2 * k * (k + 1)
    assert np.abs(record.q[:, 1] - y).max() < 1e-11
    assert np.ptp(record.v[:, [0, 2]], axis=0).max() == 0.0
    assert not record.c_n.any() and not record.residual.any()


def test_leaping_over_flight_changes_nothing():
    for name, body in BODIES.items():
        q, v = drops(name, 1, seed=4)
        leaping = checked(body, q[0], v[0], 300)
        single = checked(body, q[0], v[0], 300, torque=lambda t, q, v: np.zeros(3))
        assert np.abs(leaping.q - single.q).max() < 1e-9
        assert np.abs(leaping.c_n - single.c_n).max() < 1e-6 * leaping.c_n.max()


@pytest.mark.parametrize("epsilon", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("name", ["disk", "ellipse"])
def test_contact_adds_no_energy_without_friction(name, epsilon):
    body = BODIES[name]
    M = body.mass_matrix(np.zeros(3))
    q, v = drops(name, 10, seed=5)
    for q0, v0 in zip(q, v):
        record = checked(body, q0, v0, 300, mu=0.0, epsilon=epsilon)
        hit = (record.c_n[:, 0] > 0) & (record.phi[:, 0] >= 0)  # undoing a penetration may add some
        v_free = record.v[:-1] + H * np.array([0.0, -G, 0.0])
        before = 0.5 * np.einsum("ki,ij,kj->k", v_free, M, v_free)
        after = 0.5 * np.einsum("ki,ij,kj->k", record.v[1:], M, record.v[1:])
        assert hit.any() and (after <= before * (1 + 1e-12))[hit].all()


def test_central_impacts_with_friction_add_no_energy_and_the_eccentric_can():
    """Newton's restitution promises it for the disk only; with friction a body off its normal can gain (Kane)."""

    def gain(body, theta, v0, mu):
        q0 = np.array([0.0, 0.0, theta])
        q0[1] = -body.contacts(q0).phi.min()
        _, v1, out = step_lcp(body, q0, np.array(v0), np.zeros(3), 1e-9, mu, 1.0)
        assert out.residual <= RESIDUAL_TOL
        M = body.mass_matrix(q0)
        return 0.5 * (v1 @ M @ v1 - v0 @ M @ v0)

    rng = np.random.default_rng(6)
    velocities = rng.uniform([-3, -3, -10], [3, -0.5, 10], (300, 3))
    disk = [gain(BODIES["disk"], 0.0, v, 0.5) for v in velocities]
    assert max(disk) < 1e-6
    block = [gain(BODIES["block"], 0.35, v, 0.5) for v in velocities if v[1] + 0.6 * abs(v[2]) < 0]
    assert max(block) > 1e-3


def test_terms_of_a_state_serve_all_steps_from_it():
    q, v = drops("block", 1)
    record = checked(BODIES["block"], q[0], v[0], 300)
    k = int(np.flatnonzero(record.c_n.any(axis=1))[0])
    state = BODIES["block"], record.q[k], record.v[k]
    terms = StateTerms.of(*state)
    for push in (0.0, 1.0):
        f_ext = np.array([push, 0.0, 0.0])
        given, made = (step_lcp(*state, f_ext, H, MU, EPSILON, at) for at in (terms, None))
        assert (given[0] == made[0]).all() and (given[1] == made[1]).all()
        assert given[2].impulse and (given[2].c_n == made[2].c_n).all()


def test_disk_goes_from_flight_to_rolling_at_the_speed_of_its_angular_momentum():
    body, v0 = BODIES["disk"], np.array([2.0, 0.0, 3.0])
    record = checked(body, [0.0, 1.0, 0.0], v0, 600)
    R, m, I = 0.5, 1.0, 0.125
    # the angular momentum about points of the surface, I ω - m R v_x, is kept
    v_x = (m * R * v0[0] - I * v0[2]) / (I / R + m * R)
    assert record.v[-1] == pytest.approx([v_x, 0.0, -v_x / R], abs=1e-9)
    assert np.abs(record.phi[-50:]).max() < EXACT
    assert record.c_n[-50:, 0] == pytest.approx(G, abs=1e-9)


def test_block_at_rest_stays_and_is_carried():
    record = checked(BODIES["block"], [0.3, 0.5, 0.0], [0, 0, 0], 300)
    assert np.abs(record.q - [0.3, 0.5, 0.0]).max() < EXACT
    assert record.c_n.sum(axis=1) == pytest.approx(G, abs=1e-9)


@pytest.mark.parametrize(("tilt", "slides"), [(0.2, False), (0.35, True)])
def test_block_on_a_slope_sticks_or_slides_by_the_friction_angle(tilt, slides):
    mu = 0.3  # atan 0.3 = 0.291
    body = PlanarFreeBody(BODIES["block"].shape, 1.0, 1.0 / 6.0, tilt=tilt)
    record = checked(body, [0.0, 0.5, 0.0], [0, 0, 0], 200, mu=mu)
    a = G * (np.sin(tilt) - mu * np.cos(tilt)) if slides else 0.0
    assert record.v[-1] == pytest.approx([a * 200 * H, 0.0, 0.0], abs=1e-9)


def test_rod_sticks_with_its_first_end_then_slides_on_the_second():
    """The rod of figure 2-2: the left end lands, holds and carries the turn; then the right end comes down."""
    record = checked(BODIES["rod"], [0.0, 0.6, 0.5], [0.0, 0.0, 0.0], 200, epsilon=0.0)
    left, right = record.c_n[:, 0] > 0, record.c_n[:, 1] > 0
    assert left.any() and right.any() and np.argmax(left) < np.argmax(right)
    assert np.abs(record.v[-1]).max() < 1e-9 and np.abs(record.q[-1, [1, 2]]).max() < 1e-9


@pytest.mark.slow
def test_support_converges_with_the_time_step():
    """A rocking ellipse that rolls: the pose at 0.5 s to first order, the gap to second."""

    def rock(h):
        q0 = np.array([0.0, 0.0, 0.3])
        q0[1] = -BODIES["ellipse"].contacts(q0).phi[0]
        record = checked(BODIES["ellipse"], q0, [0, 0, 0], round(0.5 / h), mu=2.0, epsilon=0.0, h=h)
        assert (record.c_n[2:, 0] > 0).all()
        return record.q[-1], np.abs(record.phi).max()

    steps = np.array([8e-3, 4e-3, 2e-3, 1e-3]) / 1.6
    exact, _ = rock(steps[-1] / 20)
    runs = [rock(h) for h in steps]
    pose = [np.abs(q - exact).max() for q, _ in runs]
    slope = np.polyfit(np.log(steps), np.log(pose), 1)[0]
    assert 0.8 < slope < 1.3
    gap = [phi for _, phi in runs]
    assert np.polyfit(np.log(steps), np.log(gap), 1)[0] > 1.8


@pytest.mark.parametrize("name", BODIES)
def test_mirrored_starts_give_mirrored_motions(name):
    body = BODIES[name]
    mirror = np.array([-1.0, 1.0, -1.0])
    q, v = drops(name, 3, seed=9)
    for q0, v0 in zip(q, v):
        here = checked(body, q0, v0, 120)
        there = checked(body, mirror * q0, mirror * v0, 120)
        assert np.abs(here.q * mirror - there.q).max() < 1e-7  # rounding, grown by some impacts
        assert here.c_n.sum(axis=1) == pytest.approx(there.c_n.sum(axis=1), rel=1e-5, abs=1e-6)


def random_contacts(rng, k, nv=6):
    A = rng.normal(size=(nv, nv))
    J = rng.normal(size=(2 * k, nv))
    return J @ np.linalg.inv(A @ A.T + np.eye(nv)) @ J.T, rng.uniform(-2, 2, 2 * k)


def test_modes_of_one_contact_agree_with_enumeration_and_with_moby():
    rng = np.random.default_rng(10)
    for _ in range(300):
        K, v_c = random_contacts(rng, 1)
        v_c[1], mu, epsilon = -abs(v_c[1]) - 0.05, rng.uniform(0, 0.8), rng.uniform(0, 1)
        if K[1, 1] <= mu * abs(K[0, 1]):
            continue  # Painlevé: several solutions
        b = -epsilon * v_c[1]
        c_t, c_n, residual = solve_one(K[0, 0], K[0, 1], K[1, 1], v_c[0], v_c[1], b, mu)
        assert residual <= RESIDUAL_TOL
        by_bases = contact_lcp(K[None], v_c[None], mu, epsilon).c[0]
        by_moby, residual = solve_several(K, v_c, np.array([b]), np.array([mu]))
        assert residual <= RESIDUAL_TOL
        assert [c_t, c_n] == pytest.approx(by_bases, rel=AGREE, abs=AGREE)
        assert [c_t, c_n] == pytest.approx(by_moby, rel=AGREE, abs=AGREE)


def test_two_contacts_agree_with_enumeration_but_for_problems_with_several_solutions():
    rng, agree, n = np.random.default_rng(11), 0, 60
    for _ in range(n):
        K, v_c = random_contacts(rng, 2)
        b, mu = np.zeros(2), rng.uniform(0, 0.5, 2)
        c, residual = solve_several(K, v_c, b, mu)
        assert residual <= RESIDUAL_TOL
        z, status = solve_lcp_enumeration(*(x[None] for x in lcp_matrices(K, v_c, b, mu)))
        assert status[0] == LcpStatus.SOLVED
        other = np.concatenate([z[0, 4:6] - z[0, 2:4], z[0, :2]])
        agree += np.allclose(c, other, rtol=AGREE, atol=AGREE)
    assert agree >= 0.9 * n


class Unphysical(Mechanism):
    """Negative inertia against the normal: no impulse can stop the approach."""

    nv = 2
    pairs = ("ground",)

    def mass_matrix(self, q):
        return -np.eye(2)

    def bias(self, q, v):
        return np.zeros(2)

    def gravity(self, q):
        return np.array([np.nan, 0.0]) if q[1] > 10 else np.zeros(2)

    def contacts_of(self, q):
        n = len(q)
        return ContactGeometry(q[:, 1:2], np.tile([[[0.0, 1.0]]], (n, 1, 1)), np.tile([[[1.0, 0.0]]], (n, 1, 1)))


def test_a_step_without_solution_has_a_status_and_what_follows_is_nan():
    record = simulate(Unphysical(), [0.0, 0.02], [0.0, -1.0], None, 5e-3, 10, 0.5, 0.5)
    k = int(np.argmax(record.status != LcpStatus.SOLVED))
    assert not record.solved and k > 0
    assert (record.status[k:] == LcpStatus.NO_SOLUTION).all() and (record.status[:k] == LcpStatus.SOLVED).all()
    assert np.isfinite(record.q[: k + 1]).all() and np.isnan(record.q[k + 1 :]).all()
    assert np.isnan(record.c_n[k:]).all() and np.isnan(record.residual[k:]).all()
    invalid = simulate(Unphysical(), [0.0, 11.0], [0.0, 0.0], None, 5e-3, 3, 0.5, 0.5)
    assert (invalid.status == LcpStatus.INVALID_INPUT).all()


def test_forces_known_and_hidden():
    body = BODIES["disk"]
    push = np.array([2.0, 0.0, 0.0])
    known = checked(body, [0, 5, 0], [0, 0, 0], 50, torque=push)
    assert known.v[-1, 0] == pytest.approx(2.0 * 50 * H)
    hidden = simulate(body, [0, 5, 0], [0, 0, 0], None, H, 50, MU, EPSILON, hidden=lambda t, q, v: push)
    assert np.abs(hidden.v - known.v).max() < EXACT and not hidden.f_ext.any()
    by_state = checked(body, [0, 5, 0], [1, 0, 0], 50, torque=lambda t, q, v: np.array([-v[0], 0.0, 0.0]))
    assert by_state.v[-1, 0] == pytest.approx((1 - H) ** 50)
    assert by_state.f_ext[:, 0] == pytest.approx(-by_state.v[:-1, 0])


def test_windows_are_records_of_their_own():
    q, v = drops("block", 1)
    record = checked(BODIES["block"], q[0], v[0], 300)
    part = record.window(100, 160)
    assert part.steps == 60 and part.q.shape == (61, 3) and part.t[-1] == pytest.approx(60 * H)
    assert np.abs(balance(BODIES["block"], part)).max() <= BALANCE_TOL
    with pytest.raises(UserError, match="window"):
        record.window(100, 301)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q0": [0, np.nan, 0]}, "finite"),
        ({"v0": [0, 0]}, "finite"),
        ({"h": 0.0}, "time step"),
        ({"steps": 0}, "at least one step"),
        ({"mu": -0.1}, "mu"),
        ({"mu": [0.1, 0.2]}, "mu"),
        ({"epsilon": 1.1}, "epsilon"),
        ({"q0": [0, 0.4, 0]}, "deep"),
        ({"torque": np.zeros((3, 3))}, "external force"),
        ({"torque": np.array([0, np.inf, 0])}, "NaN or infinity"),
    ],
)
def test_wrong_input_is_refused(change, message):
    good = {"q0": [0, 1, 0], "v0": [0, 0, 0], "torque": None, "h": H, "steps": 10, "mu": MU, "epsilon": EPSILON}
    with pytest.raises(UserError, match=message):
        simulate(BODIES["disk"], **(good | change))


@pytest.mark.parametrize("wrong", [{"mass": 0.0}, {"inertia": np.inf}, {"gravity": -1.0}, {"tilt": np.nan}])
def test_unphysical_bodies_are_refused(wrong):
    with pytest.raises(UserError, match="needs"):
        PlanarFreeBody(Disk(radius=0.5), **({"mass": 1.0, "inertia": 0.1} | wrong))
