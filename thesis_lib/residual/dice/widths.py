"""How the belief over a throw widens from contact to contact, and how much of it contacts do (figure 4-4).

Held-out throws are thrown from states drawn from the covariance of their start, once with uncertain contacts and once
with the same contacts without uncertainty.  A throw's width is the standard deviation of x over its particles, in
sides:

    std, certain    median over throws of the width with uncertain contacts, and without
    ratio           median over throws of one over the other

Start noise grows on the way by itself, as a thrown die is chaotic.  So a wider belief does not show that contacts are
uncertain, but the ratio does: it is 1 where they add nothing, and √2 where they add half of the variance.
"""

import numpy as np
import pandas as pd

from thesis_lib.residual.dice.data import ThrowReleases
from thesis_lib.residual.dice.models import Thrower, perturbed, throw_starts
from thesis_lib.residual.dice.settings import DiceStudySettings
from thesis_lib.residual.dice.tables import spread
from thesis_lib.residual.throwing.propagation import Sampled

STATES = ("start", "first contact", "second contact", "rest")
FEWEST = 5  # particles that have a contact, for a width after it


def belief_widths(
    thrower: Thrower, held: ThrowReleases, side: float, settings: DiceStudySettings, rng: np.random.Generator
) -> pd.DataFrame:
    """A row per state: throws, std, certain and ratio, each with its standard error (bootstrap over throws).

    `side` in m.  A throw counts where at least `FEWEST` of its particles have the contact, thrown either way.
    """
    start_rng, contact_rng, bootstrap_rng = rng.spawn(3)
    q, v = perturbed(held, settings.particles, start_rng)

    def widths(contact: Sampled) -> np.ndarray:
        """Widths (states, throws), NaN where too few particles have the contact."""
        out = throw_starts(thrower.model, contact, q, v, settings.throw, contact_rng)
        x = np.stack([q[:, 0], out.snapshot_q[0, :, 0], out.snapshot_q[1, :, 0], out.q[:, 0]])
        x = x.reshape(len(STATES), len(held), -1) / side
        enough = np.isfinite(x).sum(axis=2) >= FEWEST
        found = np.full(enough.shape, np.nan)
        found[enough] = np.nanstd(x[enough], axis=1)
        return found

    wide, narrow, rows = widths(thrower.contact), widths(thrower.certain), []
    for i, state in enumerate(STATES):
        known = np.isfinite(wide[i]) & np.isfinite(narrow[i])
        row: dict[str, object] = {"state": state, "throws": int(known.sum())}
        for name, values in (("std", wide[i]), ("certain", narrow[i]), ("ratio", wide[i] / narrow[i])):
            error = spread(values[known], np.median, settings.bootstrap, bootstrap_rng)[0]
            row |= {name: float(np.median(values[known])), f"{name}_error": error}
        rows.append(row)
    return pd.DataFrame(rows)
