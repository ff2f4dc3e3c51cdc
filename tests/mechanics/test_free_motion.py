"""Free flight: what Euler's equations conserve, closed forms, an independent integration, and its columns."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from thesis_lib.mechanics.free_motion import MOST_STEPS, attitudes, columns, flown
from thesis_lib.mechanics.inertia import in_world
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.turning import ORDER

INTEGRATED = 1e-10  # rad, after a turn or two
CONSERVED = 1e-8  # relative
DIFFERENCED = 1e-5  # of central differences

G = np.array([[1.1e-4, 1e-5, -2e-5], [1e-5, 2.0e-4, 1.5e-5], [-2e-5, 1.5e-5, 2.6e-4]])  # m²
TAU = np.concatenate([np.arange(-12, 13) / 250.0, [0.3, -0.2]])  # s, neither in order nor of one sign
N = 8


@pytest.fixture
def start(rng) -> tuple[np.ndarray, np.ndarray]:
    """Poses (7, N) and motions (6, N) of bodies that turn with 15 rad/s or so."""
    turns = Rotation.random(N, rng=rng).as_quat(scalar_first=True).T
    pose = np.concatenate([rng.uniform(-1.0, 1.0, (3, N)), turns])
    return pose, np.concatenate([rng.standard_normal((3, N)), 15.0 * rng.standard_normal((3, N))])


def away(one: np.ndarray, other: np.ndarray) -> float:
    """Largest angle in rad between attitudes (4, ...)."""
    return np.abs(SPACE.turn_between(one.reshape(4, -1), other.reshape(4, -1))).max()


def test_angular_momentum_energy_and_length_are_kept(start):
    pose, motion = start
    q, spin = attitudes(pose[3:], motion[3:], G, TAU)
    assert q.shape == (4, len(TAU), N) and spin.shape == (3, len(TAU), N)
    np.testing.assert_allclose((q * q).sum(axis=0), 1.0, atol=1e-14)
    moment = np.einsum("ijn,jn->in", in_world(G, q.reshape(4, -1)), spin.reshape(3, -1)).reshape(spin.shape)
    before = np.einsum("ijn,jn->in", in_world(G, pose[3:]), motion[3:])
    np.testing.assert_allclose(moment, np.broadcast_to(before[:, None], moment.shape), atol=1e-15)
    energy = (moment * spin).sum(axis=0)
    np.testing.assert_allclose(energy / (before * motion[3:]).sum(axis=0), 1.0, atol=CONSERVED)


def test_an_independent_integration_of_eulers_equations_agrees(start):
    """ω in axes of the body, G ω̇ = −ω × G ω, and the attitude as a product of many small turns of scipy's."""
    pose, motion = (part[:, :2] for part in start)
    found, spin = attitudes(pose[3:], motion[3:], G, np.array([0.2]))
    for i in range(2):
        first = Rotation.from_quat(pose[3:, i], scalar_first=True)
        times = np.linspace(0.0, 0.2, 2001)
        euler = solve_ivp(
            lambda _, w: np.linalg.solve(G, -np.cross(w, G @ w)),
            (0.0, 0.2),
            first.inv().apply(motion[3:, i]),
            t_eval=np.sort(np.concatenate([times, 0.5 * (times[1:] + times[:-1])])),
            rtol=1e-12,
            atol=1e-12,
        )
        turn = first
        for small in Rotation.from_rotvec(euler.y[:, 1::2].T * np.diff(times)[:, None]):  # ω in the middle of each
            turn = turn * small
        assert away(found[:, 0, i], turn.as_quat(scalar_first=True)) <= 2e-5  # (ω h)² of the small turns
        np.testing.assert_allclose(spin[:, 0, i], turn.apply(euler.y[:, -1]), rtol=1e-4, atol=1e-3)


def test_a_symmetric_top_precesses_as_in_the_textbook(rng):
    """About L with the rate L/G_x, and about its own axis with ω_z (1 − G_z/G_x)."""
    G_x, G_z = 1e-4, 2.7e-4
    first = Rotation.random(N, rng=rng)
    omega = first.apply(rng.standard_normal((N, 3)) * 15.0)
    in_body = first.inv().apply(omega)
    L = first.apply(in_body * [G_x, G_x, G_z])
    found, _ = attitudes(first.as_quat(scalar_first=True).T, omega.T, np.diag([G_x, G_x, G_z]), TAU)
    for k, t in enumerate(TAU):
        own = np.stack([np.zeros(N), np.zeros(N), in_body[:, 2] * (1.0 - G_z / G_x) * t], axis=1)
        expected = Rotation.from_rotvec(L / G_x * t) * first * Rotation.from_rotvec(own)
        assert away(found[:, k], expected.as_quat(scalar_first=True).T) <= INTEGRATED


def test_the_error_falls_with_the_order_of_the_series(start):
    pose, motion = start
    q, w = pose[3:], 15.0 * motion[3:] / np.linalg.norm(motion[3:], axis=0)
    exact, _ = attitudes(q, w, G, np.array([0.4]), step=0.2)
    errors = [away(attitudes(q, w, G, np.array([0.4]), step=step)[0], exact) for step in (1.6, 1.2, 0.6)]
    slopes = np.log2(np.divide(errors[:-1], errors[1:])) / np.log2([1.6 / 1.2, 1.2 / 0.6])
    assert np.all(slopes > ORDER - 2.0) and errors[-1] <= INTEGRATED


def test_forwards_and_back_again(start):
    pose, motion = start
    there = flown(pose, motion, G, np.array([[0.0], [0.0], [-9.81]]), np.array([0.3]))
    back = flown(there.pose[:, 0], there.motion[:, 0], G, np.array([[0.0], [0.0], [-9.81]]), np.array([-0.3]))
    np.testing.assert_allclose(back.motion[:, 0], motion, atol=1e-6)
    assert np.abs(SPACE.difference(back.pose[:, 0], pose)).max() <= INTEGRATED


def test_each_body_has_its_own_inertia_and_times(start, rng):
    pose, motion = start
    own = np.stack([factor * G for factor in rng.uniform(0.5, 2.0, N)], axis=-1)
    tau = rng.uniform(-0.1, 0.1, (5, N))
    tau[2, 3] = np.nan
    q, spin = attitudes(pose[3:], motion[3:], own, tau)
    for i in (0, 3, 7):
        alone, spin_alone = attitudes(pose[3:, [i]], motion[3:, [i]], own[:, :, i], tau[:, i])
        there = np.isfinite(tau[:, i])
        assert away(q[:, there, i], alone[:, there, 0]) <= INTEGRATED
        np.testing.assert_allclose(spin[:, there, i], spin_alone[:, there, 0], atol=1e-6)
        assert np.isnan(q[:, ~there, i]).all() and np.isnan(spin_alone[:, ~there, 0]).all()


def test_a_turn_of_all_turns_the_flight(start):
    pose, motion = start
    turn = Rotation.from_rotvec([0.3, -1.2, 0.8])
    turned = np.concatenate(
        [turn.apply(pose[:3].T).T, SPACE.attitude_after(pose[3:], np.array([[0.3], [-1.2], [0.8]]))]
    )
    turned_motion = np.concatenate([turn.apply(motion[:3].T).T, turn.apply(motion[3:].T).T])
    a = np.array([[0.0], [1.0], [-9.81]])
    flight = flown(pose, motion, G, a, TAU)
    other = flown(turned, turned_motion, G, turn.apply(a.T).T, TAU)
    for part, found in ((flight.pose[:3], other.pose[:3]), (flight.motion[:3], other.motion[:3])):
        expected = turn.apply(part.reshape(3, -1).T).T.reshape(part.shape)
        np.testing.assert_allclose(found, expected, atol=1e-12)
    of_attitude = SPACE.attitude_after(flight.pose[3:].reshape(4, -1), np.array([[0.3], [-1.2], [0.8]]))
    assert away(other.pose[3:], of_attitude) <= 1e-11


def test_the_centre_of_mass_flies_a_parabola(start):
    pose, motion = start
    a = np.array([[0.1], [0.2], [-9.81]])
    flight = flown(pose, motion, G, a, TAU)
    for k, t in enumerate(TAU):
        np.testing.assert_allclose(flight.pose[:3, k], pose[:3] + t * motion[:3] + 0.5 * t * t * a, atol=1e-14)
        np.testing.assert_allclose(flight.motion[:3, k], motion[:3] + t * a, atol=1e-14)


# --- columns ---


def test_columns_are_the_derivatives_of_the_turns(start):
    q, w = start[0][3:], start[1][3:]
    found = columns(q, w, G, TAU)
    assert found.shape == (3, 6, len(TAU), N)
    # a spin of 1 rad/s counts little in a tenth of a second
    size = np.repeat([1e-5, 1e-3], 3)
    changes = np.repeat(np.concatenate([np.diag(size), -np.diag(size)], axis=1), N, axis=1)  # (6, 12 N), a body each
    turned = SPACE.attitude_after(np.tile(q, 12), changes[:3])
    ends, _ = attitudes(turned, np.tile(w, 12) + changes[3:], G, TAU)
    above, below = ends.reshape(4, len(TAU), 2, 6 * N).transpose(2, 0, 1, 3).reshape(2, 4, -1)
    slope = SPACE.turn_between(below, above).reshape(3, len(TAU), 6, N).transpose(0, 2, 1, 3)
    np.testing.assert_allclose(found, slope / (2.0 * size[:, None, None]), rtol=DIFFERENCED, atol=DIFFERENCED)


def test_columns_of_a_body_that_does_not_turn_grow_with_time():
    q, tau = np.array([[1.0, 0.0, 0.0, 0.0]]).T, np.array([-0.1, 0.0, 0.3])
    found = columns(q, np.zeros((3, 1)), np.diag([1e-3, 2e-3, 2.5e-3]), tau)[:, 3:, :, 0]
    np.testing.assert_allclose(found, np.eye(3)[:, :, None] * tau, atol=1e-12)


def test_regression_on_the_columns_finds_the_spin_before_an_impact(rng):
    """A tumbling 60 × 40 × 20 mm box, 25 samples at 250 Hz with 3 mrad: as good as its own covariance.

    Straight lines through the rotation vector err by some rad/s at 30 rad/s.
    """
    n, sigma, speed = 200, 3e-3, 30.0
    half = np.array([0.03, 0.02, 0.01])
    box = np.diag((half @ half - half**2) / 3.0)
    q = Rotation.random(n, rng=rng).as_quat(scalar_first=True).T
    w = rng.standard_normal((3, n))
    w *= speed / np.linalg.norm(w, axis=0)
    tau = -np.arange(1, 26) / 250.0
    measured, _ = attitudes(q, w, box, tau)
    noise = sigma * rng.standard_normal((3, 25, n))
    measured = SPACE.attitude_after(measured.reshape(4, -1), noise.reshape(3, -1)).reshape(measured.shape)
    # believed: off by 1 rad/s and 0.02 rad
    q_0, w_0 = SPACE.attitude_after(q, 0.02 * rng.standard_normal((3, n))), w + rng.standard_normal((3, n))
    for _ in range(3):
        believed, _ = attitudes(q_0, w_0, box, tau)
        off = SPACE.turn_between(believed.reshape(4, -1), measured.reshape(4, -1)).reshape(3, 25, n)
        A = columns(q_0, w_0, box, tau).transpose(3, 2, 0, 1).reshape(n, 75, 6)
        b = off.transpose(2, 1, 0).reshape(n, 75, 1)
        change = np.linalg.solve(A.mT @ A, A.mT @ b)
        q_0, w_0 = SPACE.attitude_after(q_0, change[:, :3, 0].T), w_0 + change[:, 3:, 0].T
    covariance = sigma**2 * np.linalg.inv(A.mT @ A)[:, 3:, 3:]
    error = (w_0 - w).T
    chi2 = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error).mean()
    assert abs(chi2 - 3.0) <= 4.0 * np.sqrt(6.0 / n)
    assert np.sqrt((error**2).mean()) < 0.1


def test_a_flight_without_end_is_refused():
    q = np.array([[1.0], [0.0], [0.0], [0.0]])
    with pytest.raises(ValueError, match="check the spins and times"):
        attitudes(q, np.array([[1e3], [0.0], [0.0]]), G, np.array([0.13 * MOST_STEPS]))
