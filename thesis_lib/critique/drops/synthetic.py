"""Draw observations from a model, at the states and with the noise of given observations.

The parametric bootstrap uses this.  The states before impact and at mid-flight are taken as true.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from thesis_lib.critique.drops.model import Model
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.critique.drops.residuals import ARC_MEAN, flight_residuals, states_at_impact


def synthesise(
    model: Model,
    values: Mapping[str, float],
    observations: Observations,
    rng: np.random.Generator,
    scatter: float = 0.0,
) -> Observations:
    """Observations drawn from `model` at `values`; `scatter` adds σ_m (m/s) to the velocity after impact."""
    o, rig = observations, observations.rig
    before, _ = states_at_impact(model, values, o)
    active = model.active(values)
    if o.arcs:
        # at impact the body touches: set its measured height accordingly
        true = model.to_true(before, active, rig)
        raised = model.to_measured(true.moved(y=true.y - model.gap(true, values, rig)), active, rig)
        before = before.moved(y=raised.y)
    after = model.predict(before, values, rig, o.offset)
    jitter = scatter * rng.standard_normal((len(o), 3)) / [1.0, 1.0, rig.k_g]
    after = after.with_velocity(after.v + jitter)
    value, slope = np.empty_like(o.value), np.empty_like(o.slope)
    for side, state in enumerate((before, after)):
        pose, speed = state.q, state.v
        if o.arcs:
            if side == 1:
                # `after` contains the jump already: the pose is that of before plus one jump
                pose = before.q + model.jump(before, after, values)
            a = model.acceleration(state, values, rig)
            if model.has_varying_flight:
                v = speed + ARC_MEAN * o.bow[:, side, 1:] * a
                a = model.acceleration(state.with_velocity(v), values, rig)
            beyond = model.arc(o.nodes[:, side], state, values, rig)
            if beyond is not None:
                line = o.weights[:, side] @ beyond
                pose, speed = pose + line[:, 0], speed + line[:, 1]
            pose, speed = pose + o.bow[:, side, :1] * a, speed + o.bow[:, side, 1:] * a
        value[:, side], slope[:, side] = pose, speed
    L = np.linalg.cholesky(o.cov + 1e-30 * np.eye(2))
    noise = (L @ rng.standard_normal((*o.cov.shape[:3], 2, 1)))[..., 0]
    flights = o.flights
    acceleration = flights.acceleration - flight_residuals(model, values, flights, rig)
    acceleration = acceleration + np.sqrt(flights.variance) * rng.standard_normal(acceleration.shape)
    flights = replace(flights, acceleration=acceleration)
    return replace(o, value=value + noise[..., 0], slope=slope + noise[..., 1], flights=flights)
