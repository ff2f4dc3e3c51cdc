"""Episodes that no model can predict from the measurements before them.

A small error of the angle before a body lands flat decides which corner hits first, and after a few hits nothing is
left of the prediction.  Such an episode cannot test a contact model.  It is left out, before any model is chosen, if
the noise of the flight before it alone spreads the predicted state after it by more than the share `unpredictable` of
the change of velocity.  The prediction is by Mirtich's law, fitted to the single hits of the training trials.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.datasets.impacts.found import LEFT_OUT_COLUMNS

REFERENCE = "mirtich"


def predictable(observations: Observations, training: Observations, settings: CritiqueSettings) -> Observations:
    """`observations` without unpredictable episodes; these are listed as left out, with the spread in m/s.

    Single hits stay.  `training`: observations of the training trials.
    """
    o = observations
    rows = np.flatnonzero(o.span)
    if not len(rows):
        return o
    alone = training.single
    model = Model(LAWS[REFERENCE], takes_time=settings.contact_time and o.arcs, space=o.space)
    fitted = fit(model, alone if len(alone) else training)
    episodes = o.rows(rows)
    here = fitted.on(episodes)
    S, metric = here.covariance(), episodes.metric
    spread = np.sqrt(np.einsum("nij,nji->n", S[:, : o.space.motions, : o.space.motions], metric))
    change = episodes.norm(here.prediction.v - here.before.v)
    wide = ~(spread < settings.unpredictable * change)
    left_out = [o.found.left_out]
    for i in np.flatnonzero(wide):
        detail = f"the noise before it spreads the prediction by {spread[i]:.2g} m/s"
        numbers = np.arange(episodes.hits[i]) + episodes.impact[i]
        columns = (episodes.trial[i], numbers, episodes.t[i], "unpredictable", detail)
        left_out.append(pd.DataFrame(dict(zip(LEFT_OUT_COLUMNS, columns))))
    table = pd.concat(left_out, ignore_index=True).sort_values(["trial", "impact"], ignore_index=True)
    keep = np.ones(len(o), bool)
    keep[rows[wide]] = False
    return replace(o.rows(np.flatnonzero(keep)), found=replace(o.found, left_out=table))
