"""Small critiques with forced effects: quick, because nothing is searched."""

import numpy as np

from thesis_lib.bodies.body import Noise
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY
from thesis_lib.simulate.rig.release import Release, Spread
from thesis_lib.simulate.stepping.drops import simulate_drops

DROPS = 24
RELEASE = Release(height=Spread(low=0.06, high=0.6), vx=Spread(low=-1.2, high=1.2), omega=Spread(low=-15, high=15))


def drops(trajectories: bool = True) -> Dataset:
    """Simulated drops; without trajectories only their impacts."""
    made = simulate_drops(
        ELLIPSE_BODY,
        RELEASE,
        DROPS,
        mu=0.12,
        epsilon=0.6,
        noise=Noise(position=3e-4, angle=3e-3),
        rng=np.random.default_rng(1),
    )
    if trajectories:
        return Dataset("drops", made.header, made.trajectories)
    return Dataset("impacts", made.header, impacts=made.impacts)


def small_critique(dataset: Dataset, effects: tuple[str, ...]) -> DropsCritique:
    """The critique with these effects switched on."""
    settings = CritiqueSettings(folds=2, finalists=1)
    return criticise_drops(dataset, rng=np.random.default_rng(0), settings=settings, effects=effects)
