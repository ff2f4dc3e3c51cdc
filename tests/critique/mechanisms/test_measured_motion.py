"""Continuous motion: steps from its samples, unit noise by the rule that fits its velocities, joints that stand still.

Stated errors of sensors are fitted, widen what is predicted, and show where they exceed what is stated.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from thesis_lib.critique.mechanisms.critique import believed_model, trials_of
from thesis_lib.critique.mechanisms.effects import CANDIDATES, SMOOTH_JOINT
from thesis_lib.critique.mechanisms.sensors import aligned, camera_delay, sensor_errors
from thesis_lib.critique.mechanisms.settings import EquationWindowSettings
from thesis_lib.critique.mechanisms.steps import interpolation, may_touch, rule_of
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.mechanisms.world import ForceFit, fit_effects, predict, sensor_excess
from thesis_lib.datasets.recordings.header import Sampling
from thesis_lib.simulate.engines.recording import simulate_recording
from thesis_lib.simulate.engines.sensors import Sensors
from thesis_lib.simulate.rig.release import Spread

NONE = Spread(low=0.0, high=0.0)
EXACT_CLOCKS = Sensors(velocity=2e-3, jitter=0.0, delay=NONE, ripple=NONE, offset=0.0)
ALONE = {"ripple": NONE, "offset": 0.0, "jitter": 0.0}  # clocks


@pytest.fixture(scope="module")
def recordings():
    return {
        truth: simulate_recording("arm", "arm", truth, "mujoco", seed=21, trials=8, sensors=EXACT_CLOCKS)
        for truth in ("nothing", "coulomb_joint_friction")
    }


def by_rule(recording, velocities):
    trials = [replace(t, velocities=velocities) for t in trials_of(recording)]
    return weak_form(trials, believed_model(recording.header))


@pytest.mark.parametrize("velocities", ["measured", "derived", "time_stepping"])
def test_an_engines_motion_leaves_unit_noise_and_is_no_time_stepping(velocities, recordings):
    """The first-order rule misses what happens within a step by many times the noise."""
    z = by_rule(recordings["nothing"], velocities).residual(np.zeros(5))
    if velocities == "time_stepping":
        assert np.mean(z**2) > 9.0
    else:
        assert abs(np.mean(z**2) - 1.0) < 4.0 * np.sqrt(2.0 / len(z))  # four standard errors


def test_a_joint_that_stands_has_no_equation_of_its_own(recordings):
    """Dry friction holds it with a force of any size; all other joints keep their equations."""
    weak = by_rule(recordings["coulomb_joint_friction"], "derived")
    pairs, standing = len(weak.model.mechanism.pairs), 0
    for window, active in enumerate(weak.active_pairs):
        for joint in (j - pairs for j in active if j >= pairs):
            at = slice(weak.starts[window], weak.ends[window])
            assert np.abs(weak.motion.v[at, joint]).max() < 0.2 and SMOOTH_JOINT < 0.2  # rad/s
            push = np.zeros_like(weak.f)
            push[at, joint] = 1.0
            rows = weak.gathered(push)[weak.window == window]
            assert np.abs(rows).max(initial=0.0) < 1e-9
            standing += 1
    assert standing > 0
    plain = by_rule(recordings["coulomb_joint_friction"], "time_stepping")
    assert max(max(active, default=0) for active in plain.active_pairs) < pairs


def arm(**sensors):
    recording = simulate_recording("arm", "arm", "nothing", "mujoco", seed=20, trials=6, sensors=Sensors(**sensors))
    return trials_of(recording), believed_model(recording.header), recording.header.sampling


def weak_form(trials, model):
    return WeakForm(trials, model, EquationWindowSettings())


def test_the_cameras_clock_is_found_from_the_gap():
    delays = Spread(low=1e-3, high=5e-3)
    trials, model, sampling = arm(**ALONE, delay=delays)
    late = camera_delay(trials, model, sampling.delay)
    # the joints' clock against the torques', from the dynamics, and the camera's, from the geometry
    fitted = fit_effects(weak_form(aligned(trials, model, late), model), (), sensor_errors(sampling, 2))
    joints = float(fitted.values["sensor_delay"][0])
    assert delays.low - 5e-4 < joints < delays.high + 5e-4
    assert delays.low - 5e-4 < joints + late < delays.high + 5e-4
    # shifted by a known time, the same estimate moves by it
    moved = camera_delay(aligned(trials, model, 1e-3), model, sampling.delay)
    assert moved == pytest.approx(late - 1e-3, abs=1e-4)


@pytest.mark.slow
def test_delayed_sensors_leave_unit_noise_only_when_their_clocks_are_fitted():
    trials, model, sampling = arm(**ALONE)
    late = camera_delay(trials, model, sampling.delay)
    with_clocks = fit_effects(weak_form(aligned(trials, model, late), model), (), sensor_errors(sampling, 2))
    without = fit_effects(weak_form(trials, model), ())
    n = len(with_clocks.z)
    assert np.mean(with_clocks.z**2) < 1.0 + 4.0 * np.sqrt(2.0 / n)  # four standard errors
    assert np.mean(without.z**2) > 2.0


@pytest.mark.slow
def test_what_sensors_leave_open_widens_the_prediction():
    """Judged windows have the log density of noise plus the spread of the sensors' errors, up to its constant."""
    trials, model, sampling = arm()
    first, second = (weak_form(part, model) for part in (trials[:3], trials[3:]))
    fitted = fit_effects(first, (), sensor_errors(sampling, 2))
    judged = predict(second, fitted)
    prior = fitted.prior[1]
    both = np.concatenate([fitted.columns, prior])
    U = fit_effects(second, (), fitted.sensors).columns
    S = np.eye(len(judged.z)) + U @ np.linalg.inv(both.T @ both) @ U.T
    plain = second.residual(
        sum(e.force(model, second.motion, fitted.values[e.name]) for e in fitted.sensors)  # pyright: ignore
    )
    expected = multivariate_normal.logpdf(plain, cov=S) + 0.5 * len(plain) * np.log(2.0 * np.pi)
    assert judged.total == pytest.approx(expected, rel=1e-6)
    assert judged.by_trial(judged.trials).sum() == pytest.approx(judged.total)
    assert (judged.spread >= 1.0).all() and judged.spread.max() > 1.5


def test_errors_of_the_stated_size_are_no_excess_and_twice_as_large_ones_are():
    """Linear Gaussian data whose parameters are drawn from the prior, or twice as wide."""
    rng = np.random.default_rng(3)
    errors = sensor_errors(Sampling(delay=0.005, torque_offset=0.03, torque_ripple=0.015), 2)
    sigma, ends = np.concatenate([e.prior for e in errors]), np.cumsum([len(e.parameters) for e in errors])[:-1]
    U = rng.standard_normal((400, len(sigma))) / sigma
    both = np.concatenate([U, np.diag(1.0 / sigma)])
    excess = {1.0: [], 2.0: []}
    for times, found in excess.items():
        for _ in range(20):
            data = U @ (times * sigma * rng.standard_normal(len(sigma))) + rng.standard_normal(len(U))
            p = np.linalg.lstsq(both, np.concatenate([data, np.zeros(len(sigma))]), rcond=None)[0]
            values = dict(zip((e.name for e in errors), np.split(p, ends)))
            found.append(sensor_excess(ForceFit((), values, {}, data - U @ p, U, errors)))
    assert np.mean([e for e, _ in excess[1.0]]) == pytest.approx(1.0, abs=0.1)
    assert np.mean([p < 0.01 for _, p in excess[1.0]]) <= 0.1
    assert all(e > 1.5 and p < 0.01 for e, p in excess[2.0])


def test_only_stated_errors_of_driven_joints_are_fitted():
    assert sensor_errors(Sampling(), 2) == () and sensor_errors(Sampling(delay=0.005, torque_ripple=0.01), 0) == ()
    names = [e.name for e in sensor_errors(Sampling(torque_offset=0.1), 2)]
    assert names == ["sensor_offset"] and names[0] not in {e.name for e in CANDIDATES["arm"]}


def errors_of(velocities: str, h: float) -> np.ndarray:
    """Largest errors of q, v, v̇ at one instant of a sine sampled every h seconds."""
    t = h * np.arange(-10, 11)
    q, v = np.sin(3.0 * t)[:, None], 3.0 * np.cos(3.0 * t)[:, None]
    rule, k = rule_of(velocities, h), np.array([10])
    at = 0.5 * h if velocities == "measured" else 0.0
    true = np.sin(3.0 * at), 3.0 * np.cos(3.0 * at), -9.0 * np.sin(3.0 * at)
    return np.array([abs(rule.of(s, q, v, k)[0, 0] - x) for s, x in zip((rule.q, rule.v, rule.a), true)])


@pytest.mark.parametrize("velocities", ["measured", "derived"])
def test_steps_of_continuous_motion_are_of_second_order(velocities):
    coarse, fine = errors_of(velocities, 0.02), errors_of(velocities, 0.01)
    assert (fine <= 0.26 * coarse + 1e-12).all() and coarse.max() > 1e-5


def test_steps_of_a_time_stepping_simulation_are_exact():
    h, rng = 0.01, np.random.default_rng(0)
    a = rng.standard_normal((20, 2))
    v = np.concatenate([np.zeros((1, 2)), h * np.cumsum(a, axis=0)])
    rule, k = rule_of("time_stepping", h), np.arange(20)
    assert np.abs(rule.of(rule.a, v, v, k) - a).max() < 1e-12
    assert (rule.kernel(5) == 1.0).all()


def test_a_second_difference_sees_the_mean_of_two_constant_forces():
    """A unit mass under forces that are constant from sample to sample: what `derived` calls f is its acceleration."""
    h, rng = 0.01, np.random.default_rng(1)
    f = rng.standard_normal(30)
    q, v = [0.0], [0.0]
    for force in f:
        q.append(q[-1] + h * v[-1] + 0.5 * h * h * force)
        v.append(v[-1] + h * force)
    rule, k = rule_of("derived", h), np.arange(5, 25)
    a = rule.of(rule.a, np.array(q)[:, None], np.array(v)[:, None], k)[:, 0]
    known = sum(w * f[k + j] for j, w in rule.f)
    # exact to the share of the kernel: an impulse between samples counts by its instant
    assert np.abs(a - known).max() < 1e-9


@pytest.mark.parametrize("shift", [-1.3, -0.4, 0.25, 2.0])
def test_interpolation_is_exact_for_cubics(shift):
    x = np.arange(12.0)
    W = interpolation(12, shift)
    assert np.abs(W @ (x**3 - 2.0 * x) - ((x + shift) ** 3 - 2.0 * (x + shift))).max() < 1e-9
    assert np.abs(W.sum(axis=1) - 1.0).max() < 1e-12


def test_a_bounce_between_samples_counts_as_contact():
    # falls and rises by 4 mm a sample, and is never sampled within the margin of 1 mm
    phi = np.array([10.0, 6.0, 2.0, 3.0, 7.0, 11.0])[:, None] * 1e-3
    touching = may_touch(phi, np.full_like(phi, 1e-3))[:, 0]
    assert touching.tolist() == [False, True, True, True, False]
