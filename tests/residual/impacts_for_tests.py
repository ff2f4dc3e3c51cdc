"""Impacts of an ellipse whose law is known, and models that a critique saved, for the tests of learners and dice."""

from dataclasses import replace

import numpy as np
from known_truth import K_G, MASS, SHAPE, falling_ellipses, with_outcome

from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.contact.space import contact_space
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.impacts import Impacts


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
    states = falling_ellipses(rng, n)
    states = replace(states, trial=np.arange(n), impact=np.zeros(n, int), v_pre=speed * states.v_pre)
    impacts = with_outcome(states, law, mu, epsilon, noise, rng)
    v_t = contact_space(impacts.v_pre, impacts.r, mass=MASS, k_g=K_G).v_t
    impacts.v_post[:, 2] += couple * v_t / K_G
    return impacts


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
