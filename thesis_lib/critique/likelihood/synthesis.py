"""Measurements drawn from a model, for a critique of simulated data."""

from dataclasses import replace

import numpy as np

from thesis_lib.critique.likelihood.at_impact import lines_beside
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.mechanics.state import State


def synthesise(comparison: Comparison, rng: np.random.Generator, scatter: float = 0.0) -> Observations:
    """Observations drawn from a model, with the states and the noise of the observations in `comparison`.

    The states before impact and at mid-flight are taken as true.  `scatter`: σ_m in m/s of the velocity after impact.
    """
    dynamics, o, before = comparison.dynamics, comparison.observations, comparison.before
    space = o.space
    if o.arcs:
        # the body touches at impact: set its measured height accordingly
        true = dynamics.to_true(before)
        raise_by = dynamics.gap(true) + dynamics.strike(before, o.offset)[1]
        up = np.eye(space.dimension)[:, -1:]
        before = dynamics.to_measured(true.changed(position=true.position - raise_by * up))
    struck = before
    if o.spin:
        struck = before.changed(spin=before.spin + o.spin * rng.standard_normal((space.turns, len(o))))
    after = dynamics.predict(struck, o.offset)
    played = np.zeros(len(o), bool)
    q, v = after.q, after.v
    for rows, ends in dynamics.played(struck, o.span) if o.arcs else ():
        q[rows], v[rows], played[rows] = ends.q, ends.v, True
    unit = np.repeat([1.0, o.rig.k_g], [space.dimension, space.turns])
    v = v + scatter * rng.standard_normal((len(o), space.motions)) / unit
    after = State.of(q, v, o.trial, o.t + o.span, before.surface, space)
    value, slope = np.empty_like(o.value), np.empty_like(o.slope)
    if o.arcs:
        # `after` already contains the jump: use the pose before plus one jump
        met = np.where(played[:, None], q, space.shift(before.pose, dynamics.jump(before, after).T).T)
        sides = before, State.of(met, v, o.trial, after.t, after.surface, space)
        for side, state in enumerate(sides):
            value[:, side], slope[:, side] = lines_beside(dynamics, o, side, state)
    else:
        for side, state in enumerate((before, after)):
            value[:, side], slope[:, side] = state.q, state.v
    m = o.cov.shape[-1]
    L = np.linalg.cholesky(o.cov + 1e-30 * np.eye(m))
    noise = (L @ rng.standard_normal((*o.cov.shape[:-1], 1))).reshape(*o.slope.shape, 2)
    value = np.stack([space.shift(value[:, side].T, noise[:, side, :, 0].T).T for side in (0, 1)], axis=1)
    flights, *supports = (beside.drawn(dynamics, rng) for beside in o.beside)
    return replace(o, value=value, slope=slope + noise[..., 1], flights=flights, supports=tuple(supports))
