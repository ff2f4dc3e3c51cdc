"""What figures of chapter 3 show as examples: a trial with its velocities and energies, and two single impacts.

Of the trial of figures 3-5 and 3-6, velocities come from the samples, because fitted arcs conserve their energy by
construction and would make the figure trivial.  Each is the slope of a straight line through x, θ and y + g t²/2 over a
few neighbours between the same two impacts.  The trial shown is the first whose leading impacts (at most three) are all
measured.

The two impacts of figure 3-11 explain unusual parameters.

(a) μ = 0.  Among impacts whose individual μ is below `MU_ZERO`, the quarter with the contact point nearest to below
    the centre of mass; of these the one with the largest misfit.  Without such impacts: the one with the least μ.
(b) Spin reversal.  Among impacts whose measured impulse lies beyond the line of sticking, the one at the median
    distance beyond it.  Without such impacts: the one nearest to it.
"Beyond" is relative to the impulse without friction, c_t = 0 at the same c_n: friction has then reversed the slip
v_t + K_tn c_n that it opposed.  A change of sign of v_t is not enough: in a skewed contact the normal impulse alone can
cause it, and every law predicts that.  Ties go to the first impact, so that equal data give equal figures.
"""

import numpy as np
import pandas as pd

from thesis_lib.contact.space import beyond_sticking
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.errors import UserError
from thesis_lib.impact_study.cost import MeasuredImpulses
from thesis_lib.impact_study.energy import rest_height
from thesis_lib.impact_study.statements import MU_ZERO

LEADING = 3  # impacts from the start that should be measured
HALF_WINDOW = 5  # samples on either side; at 250 Hz and 0.3 mm this gives velocities to 7 mm/s


def pick_trial(arcs: pd.DataFrame) -> int:
    """Number of the trial to show; `arcs` has columns trial, impact, used (measurable); UserError if none is used."""
    if not arcs["used"].astype(bool).any():
        why = "left_out.csv gives the reasons."
        raise UserError(f"No impact of this dataset could be measured, so there is no trajectory to show; {why}")
    ordered = arcs.sort_values(["trial", "impact"], kind="stable")
    measured = ordered.assign(used=ordered["used"].astype(int)).groupby("trial")["used"]
    leading = measured.cumprod().groupby(ordered["trial"]).sum().clip(upper=LEADING)
    if leading.max() == 0:  # no trial measures its first impact: the one with the most impacts measured
        leading = measured.sum()
    return int(leading.index[np.argmax(leading.to_numpy())])


def sample_velocities(t: np.ndarray, pose: np.ndarray, hits: np.ndarray, gravity: float) -> np.ndarray:
    """Velocities (n, 3) at a trial's samples; NaN with fewer than three neighbours between the same two impacts.

    `t` (n,) in s increases, `pose` (n, 3) is x, y, θ; `hits` are the instants of all impacts in s, measurable or not.
    """
    stretch = np.searchsorted(np.sort(hits), t)
    first, last = np.searchsorted(stretch, stretch), np.searchsorted(stretch, stretch, side="right")
    row = np.arange(len(t))
    low, high = np.maximum(first, row - HALF_WINDOW), np.minimum(last, row + HALF_WINDOW + 1)
    straight = pose.copy()
    straight[:, 1] += 0.5 * gravity * t**2  # free flight becomes a line
    start = straight.mean(axis=0), t.mean()
    q, s = straight - start[0], t - start[1]  # keeps the running sums small

    def windowed(values: np.ndarray) -> np.ndarray:
        total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        return total[high] - total[low]

    n = (high - low)[:, None].astype(float)
    sum_s, sum_ss = windowed(s[:, None]), windowed(s[:, None] ** 2)
    slope = n * windowed(s[:, None] * q) - sum_s * windowed(q)
    spread = n * sum_ss - sum_s**2
    velocity = np.divide(slope, spread, out=np.full_like(slope, np.nan), where=n >= 4)
    velocity[:, 1] -= gravity * t
    return velocity


def energies(pose: np.ndarray, velocity: np.ndarray, dataset: Dataset) -> np.ndarray:
    """m g (y − y_rest), m (v_x² + v_y² + k² ω²)/2 and their sum (n, 3) in J, or J/kg where the dataset has no mass."""
    rest = rest_height(dataset.shape, dataset.height)
    mass = 1.0 if dataset.mass is None else dataset.mass
    potential = mass * dataset.gravity * (pose[:, 1] - rest)
    kinetic = 0.5 * mass * np.sum((velocity * [1.0, 1.0, dataset.k_g]) ** 2, axis=1)
    return np.stack([potential, kinetic, potential + kinetic], axis=1)


def zero_friction_case(impacts: Impacts, mu: np.ndarray, misfit: np.ndarray) -> int:
    """Row of case (a) among impacts with individual `mu` (n,) and `misfit` (n,) in N s; UserError if all are NaN."""
    usable = np.flatnonzero(np.isfinite(mu) & np.isfinite(misfit))
    if not len(usable):
        raise UserError("No impact has individual parameters, so there is no case with μ = 0 to show.")
    zero = usable[mu[usable] < MU_ZERO]
    if not len(zero):
        return int(usable[np.argmin(mu[usable])])
    offset = np.abs(impacts.r[zero, 0])
    central = zero[offset <= np.quantile(offset, 0.25)]
    return int(central[np.argmax(misfit[central])])


def spin_reversal_case(target: MeasuredImpulses) -> int:
    """Row of case (b) among n measured impulses; UserError if none is finite."""
    beyond = beyond_sticking(target.space, target.c_t, target.c_n)
    usable = np.flatnonzero(np.isfinite(beyond))
    if not len(usable):
        raise UserError("No measured impulse is finite, so there is no case of spin reversal to show.")
    order = usable[np.argsort(beyond[usable], kind="stable")]
    reversed_ = order[beyond[order] > 0.0]
    return int(order[-1] if not len(reversed_) else reversed_[(len(reversed_) - 1) // 2])
