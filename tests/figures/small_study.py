"""A small made-up study: impacts of an ellipse under AP Newton with a little noise, and its tables."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
from known_truth import K_G, MASS, SHAPE, falling_ellipses

from thesis_lib.bodies.body import Body
from thesis_lib.contact import LAWS
from thesis_lib.thesis.impact_study.study import (
    convergence_table,
    held_out_errors,
    individual_table,
    split_table,
    topography_table,
)

TRUTH = "anitescu_potra_newton"
BODY = Body(shape=SHAPE, mass=MASS, radius_of_gyration=K_G)


def small_study() -> SimpleNamespace:
    """Sixty impacts and the tables that the figures take; equal at every call."""
    rng = np.random.default_rng(0)
    impacts = falling_ellipses(rng, 60, law=TRUTH, mu=0.1, epsilon=0.5, noise=0.02)
    ensemble = pd.DataFrame({"law": list(LAWS), "weighting": "kinetic", "mu": 0.09, "epsilon": 0.52})
    axes = np.linspace(0.0, 0.3, 9), np.linspace(0.2, 0.8, 9)
    return SimpleNamespace(
        impacts=impacts,
        ensemble=ensemble,
        individual=individual_table(impacts, [TRUTH], ["kinetic"]),
        errors=held_out_errors(impacts, split_table(impacts, np.zeros(60, bool)), ensemble, "kinetic"),
        topography=topography_table(impacts, "whittaker", 40, *axes, rng),
        convergence=convergence_table(impacts, [TRUTH], (10, 40), 2, rng),
    )
