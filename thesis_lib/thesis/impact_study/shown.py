"""The two impacts of figure 3-11, which explain unusual parameters.

(a) μ = 0.  Among impacts whose individual μ is below `MU_ZERO`, the quarter with the contact point nearest to below
    the centre of mass; of these the one with the largest misfit.  Without such impacts: the one with the least μ.
(b) Spin reversal.  Among impacts whose measured impulse lies beyond the line of sticking, the one at the median
    distance beyond it.  Without such impacts: the one nearest to it.
"Beyond" is relative to the impulse without friction, c_t = 0 at the same c_n: friction has then reversed the slip
v_t + K_tn c_n that it opposed.  A change of sign of v_t is not enough: in a skewed contact the normal impulse alone can
cause it, and every law predicts that.  Ties go to the first impact, so that equal data give equal figures.
"""

import numpy as np

from thesis_lib.coefficients.cost import MeasuredImpulses
from thesis_lib.contact.space import beyond_sticking
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.impact_study.tables import MU_ZERO


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
