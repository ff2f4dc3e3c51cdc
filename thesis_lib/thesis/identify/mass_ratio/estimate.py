"""Estimation of the mass-to-inertia ratio m/I of a body from the noisy states of one drop.

In contrast to `plain_program`, which is biased by noise, the true states are unknowns as well:

1. noise from differences, flights by dynamic programming (`segmentation`);
2. improved noise from the residuals of the arcs;
3. every hypothesis about steps, vertices and modes that the samples do not rule out (`hypotheses`) is fitted by maximum
   likelihood (`likelihood`);
4. the estimate is the mean over hypotheses with weights exp(-χ²/2); its variance is within plus between hypotheses;
5. a χ² test of the links between arcs, and a test of the arcs' noise against that of differences, accept or reject the
   drop; a rejected drop is first fitted with one more impact, because two vertices may hit within a few steps.

With `law=True`, all impacts of a drop share unknown ε and μ, and the fit starts from the free impulses; if the
samples reject the law, the estimate with free impulses is returned.  The remaining bias is of second order in the noise
and is removed by refitting around the estimate (`hypotheses`).

Sources: thesis section 2.4, table 2.1; A. Gelman et al., Bayesian Data Analysis, 3rd ed., section 7.4 (averaging over
discrete hypotheses).
"""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from thesis_lib.thesis.identify.mass_ratio.hypotheses import DropHypotheses, FittedHypotheses
from thesis_lib.thesis.identify.mass_ratio.likelihood import STICK, BodyShape
from thesis_lib.thesis.identify.mass_ratio.sufficient_statistics import ArcSums
from thesis_lib.thesis.identify.segmentation import (
    check_states,
    floored,
    impact_steps,
    noise_from_differences,
    without_gravity,
)

P_MISFIT = 1e-4  # probability of a larger χ² below which a drop is rejected
NOISE_SIGMAS = 5.0  # standard deviations by which noise of arcs may exceed noise from differences
MAX_IMPACTS = 6  # in one window; more would give too many hypotheses, so the window must be cut


class EstimateStatus(IntEnum):
    """Outcome of the estimate from one drop."""

    OK = 0
    NO_IMPACT = 1  # no impact in the window, so no information on m/I
    NOT_DETERMINED = 2  # impacts, but their levers r_x Δv_y - r_y Δv_x are below the noise
    MISFIT = 3  # the impacts contradict each other at any m/I
    NOISE = 4  # the arcs' residuals exceed the noise from differences: not free flight
    NOT_CONVERGED = 5
    TOO_MANY_IMPACTS = 6


@dataclass(frozen=True)
class Estimate:
    """Estimate of m/I from one drop."""

    # m/I = 1/k² in 1/m², k radius of gyration; NaN if not computable; rejected drops may also have a value
    value: float
    std: float  # standard deviation of the value, 1/m²
    status: EstimateStatus  # use only `OK`
    chi2: float  # of the links between arcs
    # impact steps k of the best hypothesis: the impulse changes the velocity from v_k to v_{k+1}
    impacts: tuple[int, ...]
    law: bool = False  # whether the contact law was used
    epsilon: float = np.nan  # epsilon, mu: under the contact law, else NaN; mu is also NaN if no impact slides
    mu: float = np.nan


class DropEstimates:
    """Estimator of m/I from one drop on the level surface y = 0 under several assumptions; shared results are cached.

    `h` in s, `gravity` in m/s²; `q`, `v` (m+1, 3) are noisy positions (m, m, rad; θ continuous) and velocities.

    Raises:
        UserError: states have a wrong shape, contain NaN or infinity, or are too few.
    """

    def __init__(self, h: float, q: np.ndarray, v: np.ndarray, shape: BodyShape, gravity: float = 9.81) -> None:
        check_states(h, q, v)
        self._h, self._shape, self._gravity = h, shape, gravity
        self._q, self._v = without_gravity(h, np.asarray(q), np.asarray(v), gravity)
        self._noise = noise_from_differences(self._q, self._v)
        self._steps = impact_steps(h, self._q, self._v, self._noise)
        self._sums = ArcSums(h, self._q, self._v)
        self._found: dict[bool, tuple[DropHypotheses, FittedHypotheses]] = {}  # by `use_gap`

    def estimate(self, *, law: bool = False, use_gap: bool = True) -> Estimate:
        """Return the estimate, with or without contact law and gap.

        `law` assumes Newton's restitution and Coulomb's friction, with unknown coefficients shared by the drop;
        `use_gap` assumes that an impulse acts in the first step that would end below the surface.
        """
        steps, noise, n = self._steps, self._noise, len(self._q)
        if not 0 < len(steps) <= MAX_IMPACTS:
            status = EstimateStatus.TOO_MANY_IMPACTS if len(steps) else EstimateStatus.NO_IMPACT
            return Estimate(np.nan, np.nan, status, np.nan, tuple(steps.tolist()))
        drop, best = self._free(use_gap)
        estimate = _estimate(best, noise, drop.sigma, n)
        if law and best.any:
            lawful = drop.fit_law(best)
            if lawful.any and lawful.p_value >= P_MISFIT:
                best, estimate = lawful, _estimate(lawful, noise, drop.sigma, n)
        if estimate.status == EstimateStatus.OK:
            bias = drop.bias(best)
            if abs(bias) < estimate.std:
                estimate = replace(estimate, value=estimate.value - bias)
        return estimate

    def _free(self, use_gap: bool) -> tuple[DropHypotheses, FittedHypotheses]:
        """Hypotheses with free impulses, fitted at the first call."""
        if use_gap not in self._found:
            q, v, noise = self._q, self._v, self._noise
            drop = DropHypotheses(self._sums, self._h, self._shape, self._gravity, use_gap, floored(noise, q, v))
            drop.estimate_noise(self._steps)
            self._found[use_gap] = drop, drop.fit_best(self._steps)
        return self._found[use_gap]


def _estimate(best: FittedHypotheses, noise: np.ndarray, sigma: np.ndarray, n: int) -> Estimate:
    f, row = best.fit, best.row
    weight = best.weight / max(best.weight.sum(), np.finfo(float).tiny)
    used = weight > 1e-6
    value = float(weight[used] @ f.ratio[used])
    std = float(np.sqrt(weight[used] @ (f.std[used, 0] ** 2 + (f.ratio[used] - value) ** 2)))
    # relative standard error of the median deviation of n samples: 1.17 / √n, of the residual spread: 0.7 / √n
    excess = (sigma / noise - 1.0) / (1.4 / np.sqrt(n))
    if not best.any:
        status = EstimateStatus.NOT_CONVERGED
    elif (excess > NOISE_SIGMAS).any():
        status = EstimateStatus.NOISE
    elif best.p_value < P_MISFIT:
        status = EstimateStatus.MISFIT
    elif not std < value:
        status = EstimateStatus.NOT_DETERMINED
    else:
        status = EstimateStatus.OK
    lawful = best.modes is not None
    return Estimate(
        value=value if best.any else np.nan,
        std=std if best.any else np.nan,
        status=status,
        chi2=float(f.misfit[row]),
        impacts=tuple(int(k) for k in best.statistics.steps[row]),
        law=lawful,
        epsilon=float(f.eta[row, 1]) if lawful else np.nan,
        mu=float(f.eta[row, 2]) if lawful and (best.modes[row] != STICK).any() else np.nan,
    )
