"""No-U-Turn sampler against the exact answer: networks that are linear, so that the bank of filters is exact."""

import subprocess
import sys

import numpy as np
import pytest
from pushes_for_tests import make_samples, sample_push

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.kalman import KalmanBank
from thesis_lib.jenga.learners.learner import Scaling
from thesis_lib.jenga.learners.networks import BayesianNetworks, layer_shapes
from thesis_lib.jenga.learners.settings import LearnerSettings, NetworkSettings, NutsSettings
from thesis_lib.jenga.robot.samples import ADVANCE
from thesis_lib.jenga.study.showcase_nuts import Sampler, agreement


def linear_learner() -> Hma:
    """Three abstractions: the block follows the pusher, half, or not at all; force rises with the lag."""
    import torch

    settings = LearnerSettings(network=NetworkSettings(hidden=(4,)))
    learner = Hma(settings)
    samples, _ = make_samples(60, np.random.default_rng(0))
    learner.scaling = Scaling.of(samples, 0.1, True)
    shapes = layer_shapes(11, (4,))
    mean = [torch.zeros((3, *shape)) for shape in shapes]
    for k, move in enumerate((1.0, 0.5, 0.0)):
        change = np.array([move, 0, 0, 0.6 * (1 - move), 0, 1.0, 0])
        mean[-1][k, -1, :7] = torch.as_tensor((change - learner.scaling.drift) / learner.scaling.change)
        mean[-1][k, 0, 3] = 0.05 * (k + 1)  # force rises with the lag: a state-dependent, still linear law
        mean[-1][k, -1, 7:] = -0.5
    nets = BayesianNetworks(settings.network, mean, [torch.full_like(m, -20.0) for m in mean], [m[0] for m in mean])
    nets.redraw(torch.Generator().manual_seed(0))
    learner.networks = nets
    learner.shares = learner.first = np.array([0.4, 0.3, 0.3])
    learner.noise = np.array([0.5, 0.3, 0.3, 0.1, 0.1, 1e-3, 0.3]) ** 2
    learner.mixture = None
    return learner


def _push(learner: Hma, abstraction: int, steps: int):
    rng = np.random.default_rng(abstraction)
    actions = rng.uniform(-0.1, 0.1, (steps, 2))
    context = np.array([9.0, 0.0])
    states, readings = sample_push(learner, rng, actions, context, abstraction)
    readings[:, ADVANCE] = states[:, ADVANCE]
    return readings, actions, context


@pytest.mark.slow
def test_sampler_agrees_with_the_exact_filter() -> None:
    learner = linear_learner()
    readings, actions, context = _push(learner, 1, 2)
    settings = NutsSettings(warm_up=300, draws=500)
    posterior = Sampler(learner, settings).sample(readings, actions, context, np.random.default_rng(1))
    assert posterior.r_hat < 1.02 and posterior.ess > 200 and posterior.divergences == 0
    bank = KalmanBank(learner.at_mean(), context, learner.noise, readings[0])
    for action, reading in zip(actions, readings[1:]):
        bank.step(action, reading)
    apart = agreement(bank, posterior)
    assert apart["belief_apart"] < 0.05 and apart["state_apart"] < 0.2
    assert 0.02 < posterior.belief.max() < 0.98  # neither abstraction is certain


def test_readings_and_actions_must_fit() -> None:
    with pytest.raises(UserError, match="readings"):
        Sampler(linear_learner(), NutsSettings()).sample(
            np.zeros((3, 7)), np.zeros((3, 2)), np.zeros(2), np.random.default_rng(0)
        )


def test_the_configuration_is_read_without_what_the_sampler_needs():
    heavy = {"torch", "pandas", "scipy", "jax"}
    code = f"import sys, thesis_lib.jenga.play.settings; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
