"""Fits of arcs by maximum likelihood: Newton steps for problem (2) of `likelihood`, for many hypotheses at once.

With e = û - u, the linearised rows G du + G_η dη + g = 0 and P = N⁻¹, a step is

    S = G P G' + var,    λ = S⁻¹ (g + G e + G_η dη),    du = e - P G' λ,    dη = -(G_η' S⁻¹ G_η)⁻¹ G_η' S⁻¹ (g + G e)

shortened if the exact-penalty merit requires it.  A hypothesis that has converged takes no more steps, so the few
hypotheses that need many steps do not slow down the others.

Source: J. Nocedal, S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, chapter 18,
doi 10.1007/978-0-387-40065-5.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.thesis.identify.mass_ratio.likelihood import ArcModel
from thesis_lib.thesis.identify.mass_ratio.sufficient_statistics import ArcStatistics

MAX_ITERATIONS = 30
CONVERGED = 1e-6  # Newton step in standard deviations of the arcs
_BACKTRACK = (1.0, 0.5, 0.2, 0.05)  # fractions of a Newton step to try
# information added to η, so that an unknown in no row (μ if all impacts stick) keeps its starting value
_SOFT_PRIOR = 1e-12


@dataclass(frozen=True)
class ArcFit:
    """Results of fits to B hypotheses."""

    u: np.ndarray  # (B, 3, 2+J) arcs
    eta: np.ndarray  # (B, 3) m/I in 1/m², ε, μ; without a law, ε and μ are the starting values
    chi2: np.ndarray  # (B,) -2 log likelihood, up to a constant
    # (B,) χ² of the links between arcs: (2) without χ²_free, and (3) without its logarithm
    misfit: np.ndarray
    dof: np.ndarray  # (B,) degrees of freedom of `misfit`
    std: np.ndarray  # (B, 3) standard deviations of η; infinite if the drop does not determine it
    converged: np.ndarray  # (B,) bool

    @property
    def ratio(self) -> np.ndarray:
        """Estimates (B,) of m/I in 1/m²."""
        return self.eta[:, 0]


def fit_arcs(model: ArcModel, u: np.ndarray | None = None, eta: np.ndarray | None = None) -> ArcFit:
    """Solve (2) for every hypothesis, starting from the free arcs or from `u` (B, 3, 2+J) and `eta` (B, 3).

    Fits that do not converge within `MAX_ITERATIONS` have `converged` false.
    """
    s = model.s
    u = s.u.copy() if u is None else u.copy()
    eta = model.start() if eta is None else eta.copy()
    P = np.linalg.inv(s.N)
    # hypotheses that have converged take no more steps
    going, part = np.arange(model.B), model
    for _ in range(MAX_ITERATIONS):
        u[going], eta[going], size = _newton_step(part, P[going], u[going], eta[going])
        goes_on = ~(size < CONVERGED)
        if goes_on.all():
            continue
        going = going[goes_on]
        if not len(going):
            break
        part = part.take(goes_on)
    converged = np.ones(model.B, dtype=bool)
    converged[going] = False
    travel, g, _, G_eta, S, _ = _linearised(model, P, u, eta)
    information = _information(G_eta, np.linalg.solve(S, G_eta))
    known = np.einsum("bee->be", information) > 2.0 * _SOFT_PRIOR
    std = np.where(known, np.sqrt(np.abs(np.einsum("bee->be", np.linalg.inv(information)))), np.inf)
    soft = model.variance > 0
    misfit = _chi2(s, u - s.u) + (g[:, soft] ** 2).sum(axis=1)
    dof = g.shape[1] - known.sum(axis=1)
    return ArcFit(u, eta, misfit + s.chi2_free + 2.0 * np.log(travel).sum(axis=1), misfit, dof, std, converged)


def _newton_step(
    model: ArcModel, P: np.ndarray, u: np.ndarray, eta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return u and η after a step from `u` (B, 3, 2+J) and `eta` (B, 3), and its size (B,) in standard deviations.

    `P` (B, 3, 2+J, 2+J) is N⁻¹.
    """
    s = model.s
    travel, g, G, G_eta, S, PG = _linearised(model, P, u, eta)
    # minimise (du - e)'N(du - e) on the linearised rows: λ = S⁻¹ (g + G e + G_η dη), du = e - P G' λ
    e = s.u - u
    w = g + np.einsum("bgci,bci->bg", G, e)
    solved = np.linalg.solve(S, np.concatenate([w[:, :, None], G_eta], axis=2))
    by_w, by_eta = solved[:, :, 0], solved[:, :, 1:]
    slope = np.einsum("bge,bg->be", G_eta, by_w)
    d_eta = -np.linalg.solve(_information(G_eta, by_eta), slope[..., None])[..., 0]
    multiplier = by_w + np.einsum("bge,be->bg", by_eta, d_eta)
    du = e - np.einsum("bcig,bg->bci", PG, multiplier)
    size = np.sqrt(np.einsum("bcij,bcj->bci", s.root, du) ** 2).max(axis=(1, 2))
    # the fraction of the step with the least exact-penalty merit ½ χ² + Σ 2 |λ g| (½ g² for soft rows)
    soft, merits = model.variance > 0, []
    for part in _BACKTRACK:
        trial = u + part * du
        g = model.rows(trial, model.motion(trial), eta + part * d_eta, travel)
        penalty = np.where(soft, 0.5 * g**2, 2.0 * np.abs(multiplier * g)).sum(axis=1)
        merits.append(0.5 * _chi2(s, trial - s.u) + penalty)
    best = np.argmin(np.where(np.isfinite(merits), merits, np.inf), axis=0)
    fraction = np.array(_BACKTRACK)[best]
    return u + fraction[:, None, None] * du, eta + fraction[:, None] * d_eta, size


def _linearised(model: ArcModel, P: np.ndarray, u: np.ndarray, eta: np.ndarray) -> tuple[np.ndarray, ...]:
    """Linearisation at arcs u and η: travel, g, G, G_η, S (B, n_g, n_g) and N⁻¹ G' (B, 3, 2+J, n_g)."""
    motion = model.motion(u)
    travel = model.travel(motion)
    g = model.rows(u, motion, eta, travel)
    G, G_eta = model.derivatives(motion, eta, travel)
    PG = np.einsum("bcij,bgcj->bcig", P, G)
    S = np.einsum("bgci,bcih->bgh", G, PG)
    n = np.arange(S.shape[1])
    S[:, n, n] += model.variance + 1e-13 * S[:, n, n]
    return travel, g, G, G_eta, S, PG


def _information(G_eta: np.ndarray, solved: np.ndarray) -> np.ndarray:
    information = np.einsum("bge,bgf->bef", G_eta, solved)
    n = np.arange(information.shape[1])
    information[:, n, n] += _SOFT_PRIOR
    return information


def _chi2(statistics: ArcStatistics, du: np.ndarray) -> np.ndarray:
    """Quadratic form du' N du (B,) of changes du (B, 3, 2+J)."""
    return (np.einsum("bcij,bcj->bci", statistics.root, du) ** 2).sum(axis=(1, 2))
