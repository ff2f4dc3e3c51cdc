"""Hypotheses about the impacts of one drop: their steps, vertices and modes, and whether there are one or two hits.

Hypotheses include steps up to `STEP_WINDOW` from the segmentation, vertices of nearly equal height, two hits within a
few steps instead of one and, under the contact law, all modes.  χ²_free bounds the χ² of a hypothesis from below, which
rules out most; the others are fitted together (`likelihood`).

Source: A. H. Land, A. G. Doig, Econometrica 28 (1960) 497, doi 10.2307/1910129 (ruling out by a bound).
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from thesis_lib.thesis.identify.mass_ratio.arc_fit import ArcFit, fit_arcs
from thesis_lib.thesis.identify.mass_ratio.likelihood import (
    SLIDE_BACK,
    SLIDE_FORWARD,
    STICK,
    ArcModel,
    BodyShape,
    corner_points,
)
from thesis_lib.thesis.identify.mass_ratio.sufficient_statistics import ArcStatistics, ArcSums
from thesis_lib.thesis.identify.segmentation import floored

STEP_WINDOW = 2  # steps tried on each side of an impact of the segmentation
# with more impacts, only one step on each side is tried, since 2 steps give 5^J hypotheses for J impacts
MANY_IMPACTS = 4
# χ² by which a hypothesis may exceed the best; beyond, weights are below e^-12
OPEN = 25.0
MAX_HYPOTHESES = 3000  # per number of impacts; the best by χ²_free are kept
DOUBLE_HIT_STEPS = 8  # largest distance of the two hits of a split impact
P_SPLIT = 0.02  # probability of a larger χ² below which a split is tried
SLIDE_COST = 8.0  # χ² that sliding must save, because it adds μ, which is then known to about 1 % of its range
# a sticking impact with |Δv_x| above this times μ Δv_y contradicts the μ of the sliding impacts
CONE_SLACK = 1.2
SPLIT_GAIN = 20.0  # χ² that a split must save, because it adds three unknowns and is tried at about a hundred places


@dataclass
class FittedHypotheses:
    """Fits of B hypotheses with equal numbers of impacts; `modes` is None if impulses are free.

    `any`: whether a fit converged; `row`: index of the best, whose χ² is `chi2_min` and whose misfit has `p_value`;
    `weight` (B,): exp(-χ²/2) relative to the best, 0 if not converged.
    """

    statistics: ArcStatistics
    vertices: np.ndarray  # (B, J) vertices that touch, numbered as in the shape
    modes: np.ndarray | None  # (B, J) 0 stick, ±1 slide with that sign of c_t
    fit: ArcFit

    def __post_init__(self):
        usable = self.fit.converged & np.isfinite(self.fit.chi2)
        score = self.fit.chi2.copy()
        if self.modes is not None:
            slides = self.modes != STICK
            u, mu = self.fit.u, self.fit.eta[:, 2]
            held = np.abs(u[:, 0, 2:]) <= CONE_SLACK * mu[:, None] * u[:, 1, 2:]
            # a negative μ means sliding in the other direction, which is a separate hypothesis
            usable &= ~slides.any(axis=1) | ((mu >= 0) & (held | slides).all(axis=1))
            score += SLIDE_COST * slides.any(axis=1)
        score[~usable] = np.inf
        self.any = bool(usable.any())
        self.row = int(np.argmin(score))
        self.chi2_min = float(score[self.row])
        self.weight = np.exp(-0.5 * (score - self.chi2_min)) if self.any else np.zeros(len(score))
        dof = int(self.fit.dof[self.row])
        # a drop with as many unknowns as rows is fitted exactly, so there is nothing to test
        self.p_value = float(chi2.sf(self.fit.misfit[self.row], dof)) if dof > 0 else 1.0


class DropHypotheses:
    """Hypotheses about one drop, with time step `h` in s and noise `sigma` (2, 3).

    `use_gap`: whether the gaps at the impacts are part of the likelihood.
    """

    def __init__(self, sums: ArcSums, h: float, shape: BodyShape, gravity: float, use_gap: bool, sigma: np.ndarray):
        self.sums, self.h, self.shape, self.gravity, self.use_gap = sums, h, shape, gravity, use_gap
        self.sigma = sigma

    def estimate_noise(self, steps: np.ndarray) -> None:
        """Set the noise from the residuals of the best free arcs near `steps` (J,)."""
        near = self._near(steps)
        best = near.take(np.argmin(near.chi2_free)[None])
        spread = self.sums.residual_spread(best.steps[0], best.u[0])
        self.sigma = floored(spread, self.sums.q, self.sums.v)

    def fit_best(self, steps: np.ndarray) -> FittedHypotheses:
        """Fit every plausible hypothesis with as many impacts as `steps` (J,), with free impulses.

        One impact is split into two hits if the samples clearly prefer it.
        """
        unsplit = best = self._fit_all(self._near(steps))
        if corner_points(self.shape) is not None:
            for j in range(len(steps)):
                split = self.fit_split(steps, j, unsplit)
                if split is not None and split.chi2_min < min(best.chi2_min, unsplit.chi2_min - SPLIT_GAIN):
                    best = split
        return best

    def fit_split(self, steps: np.ndarray, j: int, unsplit: FittedHypotheses) -> FittedHypotheses | None:
        """Fit as in `fit_best`, with impact j split into two; None if that cannot improve on `unsplit`."""
        k = steps[j]
        pairs = [
            (a, b)
            for a in range(k - DOUBLE_HIT_STEPS, k + DOUBLE_HIT_STEPS)
            for b in range(a + 1, min(a + DOUBLE_HIT_STEPS, k + DOUBLE_HIT_STEPS) + 1)
            if a <= k <= b
        ]
        candidates = [np.concatenate([steps[:j], pair, steps[j + 1 :]]) for pair in pairs]
        candidates = self._valid(np.array(candidates))
        if not len(candidates):
            return None
        statistics = self.sums.statistics(candidates, self.sigma)
        gain = unsplit.statistics.chi2_free[unsplit.row] - statistics.chi2_free.min()
        return self._fit_all(statistics) if gain > SPLIT_GAIN or unsplit.p_value < P_SPLIT else None

    def fit_law(self, free: FittedHypotheses) -> FittedHypotheses:
        """Fit the plausible hypotheses of `free` under the contact law, with every combination of modes."""
        open_ = np.flatnonzero(free.fit.chi2 < free.chi2_min + OPEN)
        J = free.statistics.steps.shape[1]
        modes = np.array(list(itertools.product((STICK, SLIDE_FORWARD, SLIDE_BACK), repeat=J)))
        limit = max(1, MAX_HYPOTHESES // len(modes))
        open_ = open_[np.argsort(free.fit.chi2[open_], kind="stable")][:limit]
        rows, modes = np.repeat(open_, len(modes)), np.tile(modes, (len(open_), 1))
        statistics, vertices = free.statistics.take(rows), free.vertices[rows]
        model = self._model(statistics, vertices, modes)
        return FittedHypotheses(statistics, vertices, modes, fit_arcs(model, free.fit.u[rows]))

    def bias(self, best: FittedHypotheses) -> float:
        """Second-order bias of m/I, 1/m²: half the curvature of the estimate along each direction of the noise.

        E[f(û)] - f(u) = ½ Σ_i L_i' f'' L_i with L L' = N⁻¹ the covariance of the arcs; f'' by refitting at u ± L_i.
        """
        u, root = best.fit.u[best.row], best.statistics.root[best.row]
        n = u.shape[1]
        columns = np.swapaxes(np.linalg.inv(root), 1, 2)  # (3, n, n): rows are the columns of R⁻¹
        moves = np.zeros((3 * n, 3, n))
        for c in range(3):
            moves[c * n : (c + 1) * n, c] = columns[c]
        moved = np.concatenate([u[None], u + moves, u - moves])
        rows = np.full(len(moved), best.row)
        statistics = replace(best.statistics.take(rows), u=moved)
        modes = None if best.modes is None else best.modes[rows]
        fit = fit_arcs(self._model(statistics, best.vertices[rows], modes), moved, best.fit.eta[rows])
        if not fit.converged.all():
            return 0.0
        return float(0.5 * (fit.ratio[1:] - fit.ratio[0]).sum())

    def _near(self, steps: np.ndarray) -> ArcStatistics:
        window = STEP_WINDOW if len(steps) <= MANY_IMPACTS else 1
        offsets = np.array(list(itertools.product(range(-window, window + 1), repeat=len(steps))))
        return self.sums.statistics(self._valid(steps + offsets), self.sigma)

    def _valid(self, steps: np.ndarray) -> np.ndarray:
        inside = (steps[:, 0] >= 1) & (steps[:, -1] < self.sums.m) & (np.diff(steps, axis=1) > 0).all(axis=1)
        return np.unique(steps[inside], axis=0)

    def _model(self, statistics: ArcStatistics, vertices: np.ndarray, modes: np.ndarray | None) -> ArcModel:
        return ArcModel(statistics, vertices, self.h, self.shape, self.gravity, modes, self.use_gap)

    def _fit_all(self, statistics: ArcStatistics) -> FittedHypotheses:
        # χ²_free bounds χ² from below, so hypotheses far above the least value cannot become the best
        order = np.argsort(statistics.chi2_free, kind="stable")
        order = order[statistics.chi2_free[order] < statistics.chi2_free[order[0]] + 2.0 * OPEN]
        rows, vertices = self._vertices(statistics.take(order))
        rows, vertices = rows[:MAX_HYPOTHESES], vertices[:MAX_HYPOTHESES]
        statistics = statistics.take(order[rows])
        return FittedHypotheses(statistics, vertices, None, fit_arcs(self._model(statistics, vertices, None)))

    def _vertices(self, s: ArcStatistics) -> tuple[np.ndarray, np.ndarray]:
        """Rows (H,) of `s` and vertices (H, J) for each combination of vertices that could be the lowest."""
        B, J = s.steps.shape
        corners = corner_points(self.shape)
        if corners is None:
            return np.arange(B), np.zeros((B, J), dtype=int)
        model = self._model(s, np.zeros((B, J), dtype=int), None)
        theta = model.angles(s.u)
        theta_std = np.sqrt(
            np.einsum("bji,bij->bj", model.position, np.linalg.solve(s.N[:, 2], np.swapaxes(model.position, 1, 2)))
        )
        x, y = corners.T
        sin, cos = np.sin(theta)[..., None], np.cos(theta)[..., None]
        r_x, r_y = cos * x - sin * y, sin * x + cos * y
        low = np.argmin(r_y, axis=2)[..., None]
        above = r_y - np.take_along_axis(r_y, low, 2)
        turn = np.abs(r_x - np.take_along_axis(r_x, low, 2))
        # a higher vertex can hit if the angle is uncertain, or a few steps later (two hits in succession)
        travel = 2.0 * self.h * np.abs(s.u[:, 1, 2:])
        able = above <= 4.0 * theta_std[..., None] * turn + travel[..., None]
        found = [(b, pick) for b in range(B) for pick in itertools.product(*map(np.flatnonzero, able[b]))]
        rows, chosen = map(np.array, zip(*found))
        return rows, chosen
