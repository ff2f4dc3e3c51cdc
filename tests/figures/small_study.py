"""A small made-up study: impacts of an ellipse under AP Newton with a little noise, and its tables."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.coefficients.cost import target_of
from thesis_lib.coefficients.individual import fit_individual
from thesis_lib.contact import LAWS
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.thesis.impact_study.study import convergence_table, held_out_errors, split_table, topography_table

TRUTH = "anitescu_potra_newton"
BODY = Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=0.0364, radius_of_gyration=0.0192)


@dataclass(frozen=True)
class Study:
    """Impacts and the tables that the figures take."""

    impacts: Impacts
    ensemble: pd.DataFrame
    individual: pd.DataFrame
    errors: pd.DataFrame
    topography: pd.DataFrame
    convergence: pd.DataFrame


def made_impacts(n: int, rng: np.random.Generator, noise: float = 0.02) -> Impacts:
    """n approaching impacts, resolved by AP Newton with μ = 0.1, ε = 0.5; `noise` in m/s."""
    theta = rng.uniform(-np.pi, np.pi, n)
    v_pre = np.stack([rng.normal(0.0, 0.6, n), rng.uniform(-2.5, -1.0, n), rng.normal(0.0, 8.0, n)], axis=1)
    r = BODY.shape.contact_point(theta)
    keep = v_pre[:, 1] + r[:, 0] * v_pre[:, 2] < 0.0
    theta, v_pre, r = theta[keep], v_pre[keep], r[keep]
    k_g = BODY.radius_of_gyration
    out = LAWS[TRUTH](v_pre, r, mass=BODY.mass, k_g=k_g, mu=0.1, epsilon=0.5)
    v_post = out.v_post + noise * rng.normal(size=v_pre.shape) / [1.0, 1.0, k_g]
    trial = np.arange(len(theta))
    q = np.stack([np.zeros_like(theta), -r[:, 1], theta], axis=1)
    return Impacts(trial, np.zeros_like(trial), q, v_pre, v_post, r, k_g=k_g, mass=BODY.mass)


def small_study() -> Study:
    """Some fifty impacts and their tables; equal at every call."""
    rng = np.random.default_rng(0)
    impacts = made_impacts(60, rng)
    names = list(LAWS)
    ensemble = pd.DataFrame({"law": names, "weighting": "kinetic", "mu": 0.09, "epsilon": 0.52})
    fit = fit_individual(LAWS[TRUTH], target_of(impacts), "impulse")
    individual = pd.DataFrame(
        {
            "trial": impacts.trial,
            "impact": impacts.impact,
            "law": TRUTH,
            "mu": fit.mu,
            "epsilon": fit.epsilon,
            "misfit": fit.error,
        }
    )
    axes = np.linspace(0.0, 0.3, 9), np.linspace(0.2, 0.8, 9)
    return Study(
        impacts,
        ensemble,
        individual,
        held_out_errors(impacts, split_table(impacts, np.zeros(len(impacts), bool)), ensemble, "kinetic"),
        topography_table(impacts, "whittaker", 40, *axes, rng),
        convergence_table(impacts, [TRUTH], (10, 40), 2, rng),
    )
