"""From a simulated rig to parameters: the law and the (μ, ε) that made the drops come out again."""

import numpy as np
import pytest

from thesis_lib.bodies.body import Noise
from thesis_lib.coefficients.cost import target_of
from thesis_lib.coefficients.ensemble import fit_ensemble
from thesis_lib.contact import LAWS
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.impacts.detect import find_impacts
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY
from thesis_lib.simulate.rig.release import Release
from thesis_lib.simulate.stepping.drops import simulate_drops

MU, EPSILON = 0.12, 0.6
SIGMAS = 4.0  # bootstrap standard errors: one failure in 16,000 if the errors are normal


@pytest.fixture(scope="module")
def target():
    drops = simulate_drops(
        ELLIPSE_BODY,
        Release(),
        150,
        mu=MU,
        epsilon=EPSILON,
        noise=Noise(position=3e-4, angle=3e-3),
        rng=np.random.default_rng(3),
    )
    impacts = find_impacts(Dataset("drops", drops.header, drops.trajectories)).impacts
    return target_of(impacts), impacts.trial


def fit(target, law):
    return fit_ensemble(LAWS[law], target[0], "impulse", trials=target[1], bootstrap=50, rng=np.random.default_rng(0))


def test_the_law_that_made_the_drops_gets_its_parameters_back(target):
    found = fit(target, "anitescu_potra_newton")
    assert abs(found.mu - MU) < SIGMAS * found.mu_std
    assert abs(found.epsilon - EPSILON) < SIGMAS * found.epsilon_std
    assert found.mu_std < 0.01 and found.epsilon_std < 0.01


def test_another_law_does_not_explain_them(target):
    assert fit(target, "wang_mason").cost > 3.0 * fit(target, "anitescu_potra_newton").cost
