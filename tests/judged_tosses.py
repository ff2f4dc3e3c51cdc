"""Tosses of a solid in space, with a law and an effect fitted to them and judged: what pages draw, without a search."""

from typing import Any, cast

import numpy as np
from tosses import simulate_tosses

from thesis_lib.critique.drops.criticise import DropsCritique, fit_model
from thesis_lib.critique.drops.judgement import judge
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.datasets import dataset_of

LAW = "anitescu_potra_newton"  # that of the tosses
NOISE = {"position": 2e-4, "rotation": 3e-3}
BOX = {"kind": "box", "half_extents": [0.05, 0.04, 0.03]}


def judged_tosses(shape: dict, trials: int = 8, held_out: int = 5) -> DropsCritique:
    """Fits of `LAW`, alone and with an effect that is not there, to all tosses, judged on the last `held_out` ones."""
    body = {"shape": shape, "mass": 0.25, "homogeneous": True}
    header = {"schema": 2, "body": body, "rate": 240.0, "noise": NOISE}
    made = simulate_tosses(header, trials, np.random.default_rng(5), LAW)
    dataset = dataset_of(header, trajectories=made.trajectories)
    fits = [fit_model(dataset, LAW, names) for names in ((), ("wrong_size",))]
    o = fits[0].whitening.observations
    parts = [o.select(np.arange(trials)[rows]) for rows in (slice(-held_out), slice(-held_out, None))]
    labels = ("no effect", "wrong_size")
    ladder = tuple((label, fitted, judge(fitted, parts[1])) for label, fitted in zip(labels, fits))
    nothing = cast(Any, None)
    return DropsCritique(
        "tosses", CritiqueSettings(), o, *parts, nothing, ladder, {}, {}, nothing, 0.0, 0.0, 0.0, source=dataset
    )
