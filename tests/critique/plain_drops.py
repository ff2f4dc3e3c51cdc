"""Drops of the LCP simulator with nothing hidden, made once, and their observations."""

from functools import cache

import numpy as np
from hidden_effects import RIG_NOISE

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE
from thesis_lib.simulate.rig.record import DropsWithTruth
from thesis_lib.simulate.stepping.drops import simulate_drops

TRUTH = {"mu": 0.2, "epsilon": 0.6}
LAW = LAWS["anitescu_potra_newton"]  # that of the simulator


@cache
def drops(n: int = 40, seed: int = 0) -> DropsWithTruth:
    rng = np.random.default_rng(seed)
    return simulate_drops(ELLIPSE_BODY, PROOF_RELEASE, n, **TRUTH, noise=RIG_NOISE, rng=rng)


@cache
def observed(n: int = 40, seed: int = 0) -> Observations:
    one = drops(n, seed)
    """Single hits; episodes have tests of their own."""
    return observe(Dataset("plain", one.header, one.trajectories), episodes=False)


def sizes(effect: Effect, factor: float = 1.0) -> dict[str, float]:
    """Parameters of an effect at a multiple of their scales, by full name."""
    return {
        f"{effect.name}.{p.name}": p.null + factor * p.scale if p.discrete is None else p.discrete
        for p in effect.parameters
    }


def injected(name: str, factor: float = 1.0, seed: int = 5) -> tuple[Observations, dict[str, float]]:
    """Observations as the law with one effect would have made them, and the true values."""
    effect = EFFECTS[name]
    values = TRUTH | sizes(effect, factor)
    rng = np.random.default_rng(seed)
    return synthesise(Comparison(Model(LAW, (effect,)), values, observed()), rng), values
