"""Stated errors of sensors are fitted, widen what is predicted, and show where they exceed what is stated."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from thesis_lib.critique.mechanisms.critique import believed_model, trials_of
from thesis_lib.critique.mechanisms.effects import CANDIDATES
from thesis_lib.critique.mechanisms.sensors import aligned, camera_delay, sensor_errors
from thesis_lib.critique.mechanisms.settings import EquationWindowSettings
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.mechanisms.world import ForceFit, fit_effects, predict, sensor_excess
from thesis_lib.datasets.recordings.header import Sampling
from thesis_lib.simulate.engines.recording import simulate_recording
from thesis_lib.simulate.engines.sensors import Sensors
from thesis_lib.simulate.rig.release import Spread

ALONE = {"ripple": Spread(low=0.0, high=0.0), "offset": 0.0, "jitter": 0.0}


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
