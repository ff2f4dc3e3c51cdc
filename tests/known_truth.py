"""Impacts whose truth is known: made with a law, for the tests of identification."""

from dataclasses import replace

import numpy as np

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.contact import LAWS
from thesis_lib.contact.space import contact_space
from thesis_lib.datasets.format.impacts import Impacts

SHAPE = Ellipse(semi_axes=(0.035, 0.025))
K_G = float(np.sqrt(3.7e-4))
MASS = 0.0364


def falling_ellipses(
    rng: np.random.Generator,
    n: int,
    law: str = "",
    mu: np.ndarray | float = 0.0,
    epsilon: np.ndarray | float = 0.0,
    noise: float = 0.0,
) -> Impacts:
    """n approaching ellipses like the experiment's, with the outcome of a law if one is named (else none).

    Trials are numbered from 10, two impacts each.
    """
    theta = rng.uniform(-np.pi, np.pi, n)
    v_pre = rng.normal([0.0, -2.0, 0.0], [0.6, 0.3, 10.0], (n, 3))
    r = SHAPE.contact_point(theta)
    away = contact_space(v_pre, r, mass=MASS, k_g=K_G).v_n >= -0.2
    v_pre[away, 2] = 0.0
    trial = 10 + np.arange(n) // 2
    q = np.stack([np.zeros(n), -r[:, 1], theta], axis=1)
    impacts = Impacts(trial, np.arange(n) % 2, q, v_pre, v_pre.copy(), r, K_G, MASS)
    return with_outcome(impacts, law, mu, epsilon, noise, rng) if law else impacts


def with_outcome(
    impacts: Impacts,
    law: str,
    mu: np.ndarray | float,
    epsilon: np.ndarray | float,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
) -> Impacts:
    """The impacts with the outcome of a law, plus `noise` in m/s on each of v_x, v_y and k ω."""
    out = LAWS[law](impacts.v_pre, impacts.r, mass=impacts.mass, k_g=impacts.k_g, mu=mu, epsilon=epsilon)
    v_post = out.v_post
    if noise:
        v_post = v_post + noise * rng.standard_normal(v_post.shape) / [1.0, 1.0, impacts.k_g]
    return replace(impacts, v_post=v_post)
