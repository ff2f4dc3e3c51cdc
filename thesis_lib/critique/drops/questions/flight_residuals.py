"""Residuals in flight: acceleration measured minus predicted, in units of its noise.

    z_c = (a_c − â_c(q, v)) / σ_c,    z = √(Σ_c z_c² / 3),    c = x, y, θ

a_c comes from a parabola through all samples of the flight, σ_c from their noise (`observations`), and â_c from the
model.  Noise alone gives z_c a spread of 1.  State and features are those of the centre of mass at mid-flight.  The
duration of the flight is a feature too: σ_c falls with its power −5/2, so that only long flights show small
deviations.  The columns `residual_x`, `_y`, `_theta` hold z_c, and `misfit` holds z; in space the table has the misfit
alone.
"""

import numpy as np
import pandas as pd

from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.features import within_half_a_turn
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.flights import Flights
from thesis_lib.effects.effect import Rig

FLIGHT_UNITS = {"v_x": "m/s", "v_y": "m/s", "omega": "rad/s", "theta": "rad", "r_x": "m", "x": "m", "y": "m"}
FLIGHT_UNITS |= {"speed": "m/s", "v_n": "m/s", "spin": "rad/s", "z": "m"} | {"span": "s", "trial": "1", "t": "s"}
RESIDUALS = ("residual_x", "residual_y", "residual_theta")


def relative_residuals(fitted: Fit, flights: Flights, rig: Rig) -> np.ndarray:
    """z_c (m, 3) of m flights, in space (m, 12)."""
    return flights.whitened(bind(fitted.model, fitted.values, rig))


def flight_features(fitted: Fit, flights: Flights, rig: Rig) -> pd.DataFrame:
    """Features of each flight, columns as in `FLIGHT_UNITS` and foundation/columns.yaml."""
    true = bind(fitted.model, fitted.values, rig).to_true(flights.state)
    if rig.space.is_plane:
        columns = {
            "v_x": true.vx,
            "v_y": true.vy,
            "omega": true.omega,
            "theta": within_half_a_turn(true.theta),
            "r_x": rig.shape.contact_point(true.theta)[:, 0],
            "x": true.x,
            "y": true.y,
        }
    else:
        speed, spin = np.hypot(*true.velocity[:2]), np.linalg.norm(true.spin, axis=0)
        columns = {"speed": speed, "v_n": true.velocity[2], "spin": spin} | dict(zip("xyz", true.position))
    rest = {"span": flights.span, "trial": flights.state.trial.astype(float), "t": flights.state.t}
    return pd.DataFrame(columns | rest)


def flight_table(critique: DropsCritique) -> pd.DataFrame:
    """A row per flight and model (base, and augmented if there are effects); empty without trajectories."""
    flights, rig = critique.observations.flights, critique.observations.rig
    trial = flights.state.trial.astype(int)
    held_out = np.isin(trial, critique.held_out.trial).astype(int)
    models = {"base": critique.ladder[0][1]}
    if len(critique.ladder) > 1:
        models["augmented"] = critique.ladder[-1][1]
    parts = []
    for name, fitted in models.items():
        z = relative_residuals(fitted, flights, rig)
        columns = {"trial": trial, "t": flights.state.t, "model": name, "held_out": held_out}
        residuals = dict(zip(RESIDUALS, z.T)) if rig.space.is_plane else {}
        table = pd.DataFrame(columns | residuals | {"misfit": misfit(z)})
        features = flight_features(fitted, flights, rig).drop(columns=["trial", "t"])
        parts.append(pd.concat([table, features], axis=1))
    return pd.concat(parts, ignore_index=True)


def misfit(residuals: np.ndarray) -> np.ndarray:
    """z (m,) of the components z_c (m, c)."""
    return np.sqrt(np.mean(residuals**2, axis=1))
