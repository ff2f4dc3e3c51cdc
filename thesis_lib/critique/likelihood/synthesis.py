"""Measurements drawn from a model: what a critique of its own data starts from."""

from dataclasses import replace

import numpy as np

from thesis_lib.critique.likelihood.at_impact import lines_beside
from thesis_lib.critique.likelihood.beside import drawn
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.mechanics.state import State


def synthesise(comparison: Comparison, rng: np.random.Generator, scatter: float = 0.0) -> Observations:
    """Observations drawn from a model, at the states and with the noise of those that it is compared with.

    The states before impact and at mid-flight are taken as true.  `scatter`: σ_m in m/s of the velocity after impact.
    """
    dynamics, o, before = comparison.dynamics, comparison.observations, comparison.before
    if o.arcs:
        # at impact the body touches: set its measured height accordingly
        true = dynamics.to_true(before)
        raise_by = dynamics.gap(true) + dynamics.strike(before, o.offset)[1]
        before = dynamics.to_measured(true.moved(y=true.y - raise_by))
    struck = before.moved(omega=before.omega + o.spin * rng.standard_normal(len(o))) if o.spin else before
    after = dynamics.predict(struck, o.offset)
    played = np.zeros(len(o), bool)
    q, v = after.q, after.v
    for rows, ends in dynamics.played(struck, o.span) if o.arcs else ():
        q[rows], v[rows], played[rows] = ends.q, ends.v, True
    v = v + scatter * rng.standard_normal((len(o), 3)) / [1.0, 1.0, o.rig.k_g]
    after = State.of(q, v, o.trial, o.t + o.span, before.surface)
    value, slope = np.empty_like(o.value), np.empty_like(o.slope)
    if o.arcs:
        # `after` contains the jump already: the pose is that of before plus one jump
        met = np.where(played[:, None], q, before.q + dynamics.jump(before, after))
        sides = before, State.of(met, v, o.trial, after.t, after.surface)
        for side, state in enumerate(sides):
            value[:, side], slope[:, side] = lines_beside(dynamics, o, side, state)
    else:
        for side, state in enumerate((before, after)):
            value[:, side], slope[:, side] = state.q, state.v
    L = np.linalg.cholesky(o.cov + 1e-30 * np.eye(2))
    noise = (L @ rng.standard_normal((*o.cov.shape[:3], 2, 1)))[..., 0]
    flights, *supports = (drawn(beside, dynamics, rng) for beside in o.beside)
    return replace(
        o, value=value + noise[..., 0], slope=slope + noise[..., 1], flights=flights, supports=tuple(supports)
    )
