"""Hits on an object other than the surface: a hand in flight, another object on the table.

Such hits appear in two forms, neither of which depends on the law of contact:

- between two free flights the velocity jumps (`off_surface`) where the body is far from the surface in the final model,
  too.  No fit uses such a hit.  It counts if a hit on the surface follows in its trial: an object that stops the body
  at the end of a trial does not affect the flights that are used;
- a single hit is used, but in the final model the body is then above or below the surface, or touches it so much later
  that the flights do not meet, by many times the noise and many times the spread of the other hits.

One such hit may be an error of tracking.  Such hits in several trials have a cause that no effect in the library
describes, so the verdict is `unexplained`.  Planar data are not judged: there a release also counts as a hit away from
the walls.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.drops.judgement import misfits
from thesis_lib.critique.drops.settings import ElsewhereSettings
from thesis_lib.critique.likelihood.channels import MEET, TOUCH
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.in_space.episodes import ELSEWHERE, OFF_SURFACE
from thesis_lib.critique.likelihood.in_space.observed import contact_velocity
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.datasets.impacts.found import Away
from thesis_lib.statistics.spread import robust_std

SHOWN = 5  # hits that are listed
PUSHED = 0.5  # share of a velocity change that the final model must leave; by then no distortion by a camera is left
LEAST = 0.05  # m/s, least velocity change that the model must leave; a weaker push does not matter


@dataclass(frozen=True)
class HitsElsewhere:
    """Hits away from the surface.

    Attributes:
        trials: number of trials with such hits; of: number of all trials.
        hits: trial and time in s since the first sample of the trial, by trial and time.
    """

    trials: int
    of: int
    hits: Sequence[tuple[int, float]]

    def content(self) -> dict:
        """Content for diagnosis.json."""
        shown = [{"trial": trial, "t": t} for trial, t in self.hits[:SHOWN]]
        return {"trials": self.trials, "of": self.of, "hits": len(self.hits), "first": shown, "unit": "s"}


def hits_elsewhere(final: Fit, o: Observations, settings: ElsewhereSettings) -> HitsElsewhere | None:
    """Hits away from the surface, if there are more than tracking errors would explain; else None."""
    if o.space.is_plane or not o.arcs or not len(o):
        return None
    hits: list[tuple[int, float]] = []
    if (away := o.found.away) is not None and len(away.before):
        dynamics, out = final.on(o).dynamics, o.found.left_out
        seen = away.after.velocity - away.before.velocity
        pushed = np.linalg.norm(seen - _bent(dynamics, away), axis=0)
        # hits were left out by the assumed geometry and camera, which may be wrong
        far = np.abs(dynamics.gap(dynamics.to_true(away.before))) > OFF_SURFACE * o.rig.shape.extent
        least = np.maximum(LEAST, settings.push * away.std)
        far &= pushed > np.maximum(PUSHED * np.linalg.norm(seen, axis=0), least)
        last = dict(zip(o.trial.tolist(), o.impact.tolist()))  # rows are sorted by trial and time
        number = out["impact"][out["reason"] == ELSEWHERE].to_numpy()
        far &= number < [last.get(trial, -1) for trial in away.before.trial.tolist()]
        hits += zip(away.before.trial[far].tolist(), away.before.t[far].tolist())
    single, left = o.single, misfits(final, o)
    touch, meet = TOUCH.in_sigmas(left), MEET.in_sigmas(left)
    if touch is not None and meet is not None:
        z = np.concatenate([touch, meet[o.span == 0.0]], axis=1)
        z = z - np.median(z, axis=0)
        far = (np.abs(z) > settings.sigmas * np.maximum(robust_std(z), 1.0)).any(axis=1)
        far &= ~_may_hop(final.on(single).dynamics, single, o.found.guard)
        hits += zip(single.trial[far].tolist(), single.t[far].tolist())
    trials, of = len({trial for trial, _ in hits}), len(np.unique(o.trial))
    few = trials < max(settings.trials, settings.share * of)
    return None if few else HitsElsewhere(trials, of, sorted(hits))


def _may_hop(dynamics: Dynamics, single: Observations, guard: float) -> np.ndarray:
    """Mask (n,) of hits that may be several, of a body that hops unseen within `guard` (s) on both sides of a hit."""
    before, after = (dynamics.to_true(single.lines(side)) for side in (0, 1))
    speeds = np.abs([contact_velocity(state, single.rig)[2] for state in (before, after)])
    lasts = -dynamics.gap(before) * (1.0 / np.maximum(speeds, 1e-3)).sum(axis=0)
    return (lasts > 0.0) & (lasts < 2.0 * guard)


def _bent(dynamics: Dynamics, away: Away) -> np.ndarray:
    """Change of velocity (3, n) in m/s during the flight in the model, beyond the change by assumed gravity alone."""
    before, after = (
        dynamics.later(tau, away.before).velocity - dynamics.rig.fall(away.before)[:3] * tau for tau in away.middle.T
    )
    return after - before
