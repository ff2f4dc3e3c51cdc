"""Continuous motion: unit noise by the rule that fits its velocities, and joints that stand still."""

from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.critique.mechanisms.critique import believed_model, trials_of
from thesis_lib.critique.mechanisms.effects import SMOOTH_JOINT
from thesis_lib.critique.mechanisms.settings import EquationWindowSettings
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.simulate.engines.recording import simulate_recording
from thesis_lib.simulate.engines.sensors import Sensors
from thesis_lib.simulate.rig.release import Spread

NONE = Spread(low=0.0, high=0.0)
EXACT_CLOCKS = Sensors(velocity=2e-3, jitter=0.0, delay=NONE, ripple=NONE, offset=0.0)


@pytest.fixture(scope="module")
def recordings():
    return {
        truth: simulate_recording("arm", "arm", truth, "mujoco", seed=21, trials=8, sensors=EXACT_CLOCKS)
        for truth in ("nothing", "coulomb_joint_friction")
    }


def weak_form(recording, velocities, settings=None):
    trials = [replace(t, velocities=velocities) for t in trials_of(recording)]
    return WeakForm(trials, believed_model(recording.header), settings or EquationWindowSettings())


@pytest.mark.slow
@pytest.mark.parametrize("velocities", ["measured", "derived"])
def test_an_engines_motion_leaves_unit_noise(velocities, recordings):
    z = weak_form(recordings["nothing"], velocities).residual(np.zeros(5))
    assert abs(np.mean(z**2) - 1.0) < 4.0 * np.sqrt(2.0 / len(z))  # four standard errors


def test_an_engines_motion_is_no_time_stepping(recordings):
    """The first-order rule misses what happens within a step by many times the noise."""
    z = weak_form(recordings["nothing"], "time_stepping").residual(np.zeros(5))
    assert np.mean(z**2) > 9.0


def test_a_joint_that_stands_has_no_equation_of_its_own(recordings):
    """Dry friction holds it with a force of any size; all other joints keep their equations."""
    weak = weak_form(recordings["coulomb_joint_friction"], "derived")
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
    plain = weak_form(recordings["coulomb_joint_friction"], "time_stepping")
    assert max(max(active, default=0) for active in plain.active_pairs) < pairs
