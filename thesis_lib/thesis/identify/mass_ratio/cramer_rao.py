"""Cramér-Rao bound on m/I from the noisy states of one drop.

No unbiased estimator has a smaller variance than the inverse of the Fisher information at the truth.  For known impact
steps and vertices, the arcs are linear in their numbers u (information N) and linked by the rows g(u, η) = 0 of
`likelihood`.  If u is estimated as well, the information on η is

    I_η = G_η' (G N⁻¹ G')⁻¹ G_η,     std(m/I) >= √(I_η⁻¹)_{00}.

Without a contact law (free impulses, η = m/I) this bounds every estimator that does not use friction and restitution;
with the law, η = (m/I, ε, μ).  An estimator that uses the impact steps, which are not differentiable, may fall below
the bound; where noise makes the steps uncertain, the true limit lies above it.

Sources: C. R. Rao, Bulletin of the Calcutta Mathematical Society 37 (1945) 81; P. Stoica, B. C. Ng,
IEEE Signal Processing Letters 5 (1998) 177, doi 10.1109/97.700921 (the bound under constraints).
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.stepping import SimulatedMotion
from thesis_lib.thesis.identify.mass_ratio.arc_fit import fit_arcs
from thesis_lib.thesis.identify.mass_ratio.likelihood import STICK, ArcModel, BodyShape
from thesis_lib.thesis.identify.mass_ratio.sufficient_statistics import ArcSums
from thesis_lib.thesis.identify.segmentation import check_states, without_gravity

# share of μ c_n that |c_t| reaches in a sliding impact; sticking impacts are far below it
SLIDE_SHARE = 1.0 - 1e-6


@dataclass(frozen=True)
class TrueImpacts:
    """Impacts of a simulated drop of one free body."""

    steps: np.ndarray  # (J,) steps k_j with a contact force
    vertices: np.ndarray  # (J,) contact pairs with the largest force
    modes: np.ndarray  # (J,) 0 stick, ±1 slide with that sign of c_t
    alone: np.ndarray  # (J,) bool, whether no second pair has a force in that step


def true_impacts(record: SimulatedMotion, mu: float) -> TrueImpacts:
    """Find the impacts of `record`, the steps with contact forces; `mu` is the friction coefficient."""
    steps = np.flatnonzero((record.c_n > 0).any(axis=1))
    c_n, c_t = record.c_n[steps], record.c_t[steps]
    vertices = c_n.argmax(axis=1)
    largest_n, largest_t = (np.take_along_axis(c, vertices[:, None], axis=1)[:, 0] for c in (c_n, c_t))
    slides = (np.abs(largest_t) >= SLIDE_SHARE * mu * largest_n) & (largest_t != 0.0)
    modes = np.where(slides, np.sign(largest_t), STICK).astype(int)
    return TrueImpacts(steps, vertices, modes, (c_n > 0).sum(axis=1) == 1)


def ratio_bound(
    record: SimulatedMotion, sigma: np.ndarray, impacts: TrueImpacts, shape: BodyShape, gravity: float, law: bool
) -> float:
    """Cramér-Rao bound on the standard deviation of m/I in 1/m²; infinite if the drop does not determine m/I.

    `record` is the true motion, `sigma` (2, 3) the noise of its states, `gravity` in m/s².  With `law`, Newton's
    restitution and Coulomb's friction are known to hold, with unknown coefficients.

    Raises:
        UserError: the states cannot be a drop, or the noise is not positive.
    """
    h, q, v = record.h, record.q, record.v
    check_states(h, q, v)
    if not (np.asarray(sigma) > 0).all():
        raise UserError("The Cramér-Rao bound needs noise above zero in every channel; without noise it is zero.")
    if not len(impacts.steps):
        return np.inf
    sums = ArcSums(h, *without_gravity(h, q, v, gravity))
    statistics = sums.statistics(impacts.steps[None], np.asarray(sigma, dtype=float))
    modes = impacts.modes[None] if law else None
    # at the truth the rows already hold, so the fit does not move, and its std is the bound
    fit = fit_arcs(ArcModel(statistics, impacts.vertices[None], h, shape, gravity, modes))
    return float(fit.std[0, 0])
