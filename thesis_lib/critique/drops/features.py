"""Features on which the error of an impact may depend: state in the contact frame, pose, and time."""

import numpy as np
import pandas as pd

from thesis_lib.critique.drops.fit import Fit
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.critique.drops.residuals import states_at_impact

FEATURES = {
    "v_t": ("m/s", "tangential velocity of the contact point before impact"),
    "v_n": ("m/s", "normal velocity of the contact point before impact"),
    "omega": ("rad/s", "angular velocity before impact"),
    "r_x": ("m", "contact point ahead of the centre of mass"),
    "theta": ("rad", "body angle, within half a turn"),
    "x": ("m", "position along the surface"),
    "trial": ("1", "number of the release"),
    "t": ("s", "time since the first sample"),
}


def features(fitted: Fit, observations: Observations) -> pd.DataFrame:
    """Features of n impacts, columns and units as in `FEATURES`; t only for trajectories."""
    before, _ = states_at_impact(fitted.model, fitted.values, observations)
    true = fitted.model.to_true(before, fitted.model.active(fitted.values), observations.rig)
    r = observations.rig.shape.contact_point(true.theta)
    table = pd.DataFrame(
        {
            "v_t": true.vx - r[:, 1] * true.omega,
            "v_n": true.vy + r[:, 0] * true.omega,
            "omega": true.omega,
            "r_x": r[:, 0],
            "theta": np.remainder(true.theta + 0.5 * np.pi, np.pi) - 0.5 * np.pi,
            "x": true.x,
            "trial": observations.trial.astype(float),
        }
    )
    if observations.arcs:
        table["t"] = observations.t
    return table
