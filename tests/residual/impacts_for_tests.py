"""Impacts of an ellipse whose law is known, and models that a critique saved, for the tests of learners and dice."""

import numpy as np

from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.contact import LAWS
from thesis_lib.contact.space import contact_space
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.impacts import Impacts

SHAPE, MASS, K_G = Ellipse(semi_axes=(0.035, 0.025)), 0.0364, 0.0192


def made_impacts(
    n: int,
    seed: int = 0,
    *,
    law: str = "anitescu_potra_newton",
    mu: float = 0.1,
    epsilon: float = 0.5,
    noise: float = 0.0,
    couple: float = 0.0,
    speed: float = 1.0,
) -> Impacts:
    """n approaching impacts under `law`; `couple` adds τ = couple · m k v_t, `noise` is in m/s."""
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-np.pi, np.pi, 3 * n)
    v_pre = np.stack([rng.normal(0.0, 0.6, 3 * n), rng.uniform(-2.5, -1.0, 3 * n), rng.normal(0.0, 8.0, 3 * n)], 1)
    v_pre *= speed
    r = SHAPE.contact_point(theta)
    keep = np.flatnonzero(v_pre[:, 1] + r[:, 0] * v_pre[:, 2] < -0.1)[:n]
    theta, v_pre, r = theta[keep], v_pre[keep], r[keep]
    v_post = LAWS[law](v_pre, r, mass=MASS, k_g=K_G, mu=mu, epsilon=epsilon).v_post
    v_post[:, 2] += couple * contact_space(v_pre, r, mass=MASS, k_g=K_G).v_t / K_G
    v_post += noise * rng.normal(size=v_pre.shape) / [1.0, 1.0, K_G]
    trial = np.arange(len(theta))
    q = np.stack([np.zeros_like(theta), -r[:, 1], theta], axis=1)
    return Impacts(trial, np.zeros_like(trial), q, v_pre, v_post, r, k_g=K_G, mass=MASS)


def saved_model(
    effects: dict[str, float],
    *,
    law: str = "anitescu_potra_newton",
    mu: float = 0.1,
    epsilon: float = 0.5,
    shape: Ellipse | Polygon = SHAPE,
    k_g: float = K_G,
) -> SavedModel:
    """A critique's model with these values of its effects' parameters."""
    parameters = {"mu": mu, "epsilon": epsilon} | effects
    return SavedModel.model_validate(
        {
            "law": law,
            "effects": list(dict.fromkeys(name.split(".")[0] for name in effects)),
            "parameters": {name: {"value": value, "unit": "1"} for name, value in parameters.items()},
            "rig": {"shape": shape.model_dump(), "radius_of_gyration": k_g, "gravity": 9.81, "height": 0.0},
        }
    )
