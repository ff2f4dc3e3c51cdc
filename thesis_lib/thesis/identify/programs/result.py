"""Result of an identification program; its status is judged by the residuals, not by the solver's claim.

The dynamics residual is rms(Y Θ − J' c − f) over the largest known generalised force F.  Complementarity is the natural
residual of eq. 2.12 at λ = |v_rel|, which is known because v_rel is data,

    max of |min(φ/L, c_n/F)|, |min(λ/V, (μ c_n − |c_t|)/F)|, |min((λ ± v_rel)/V, c_±/F)|,

with c_± = max(±c_t, 0), L the largest gap and V the largest sliding speed of the window (1 where zero).

Source: F. Facchinei, J.-S. Pang, Finite-Dimensional Variational Inequalities and Complementarity Problems, 2003,
doi 10.1007/b97543 (natural residual).
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from thesis_lib.thesis.identify.base_parameters.window import ContactWindow

# for exact data; SNOPT and IPOPT run with 1e-10, which they reach for scaled variables up to sums over a window
RESIDUAL_TOLERANCE = 1e-8


class SolveStatus(StrEnum):
    """Outcome of a program; only SOLVED counts as success."""

    SOLVED = "solved"
    SOLVER_FAILED = "solver failed"  # the solver reports failure, or its results are not finite
    DYNAMICS_VIOLATED = "dynamics violated"  # the forces do not explain the motion
    NOT_COMPLEMENTARY = "not complementary"  # forces at a distance, or against Coulomb's law


@dataclass(frozen=True)
class ProgramResult:
    """Result of one program."""

    solver: str
    status: SolveStatus
    claimed: bool  # whether the solver reports success; `status` is judged by the residuals
    theta: np.ndarray  # (n_Θ,) identified parameters
    c_n: np.ndarray  # c_n, c_t: (m, p) contact forces, N
    c_t: np.ndarray
    dynamics: float  # dynamics, complementarity: residuals, 1
    complementarity: float
    cost: float  # value of the program's cost, dimensionless

    @property
    def solved(self) -> bool:
        """Whether the residuals confirm the result."""
        return self.status is SolveStatus.SOLVED


def complementarity_residual(window: ContactWindow, c_n: np.ndarray, c_t: np.ndarray) -> float:
    """Natural residual of all complementarity conditions of a window, dimensionless (see the module)."""
    if not c_n.size:
        return 0.0
    F, L, V = window.force_scale, window.gap_scale, window.speed_scale
    speed = np.abs(window.v_t)
    pairs = (
        (window.gap / L, c_n / F),
        (speed / V, (window.mu * c_n - np.abs(c_t)) / F),
        ((speed + window.v_t) / V, np.maximum(c_t, 0.0) / F),
        ((speed - window.v_t) / V, np.maximum(-c_t, 0.0) / F),
    )
    return float(max(np.abs(np.minimum(a, b)).max() for a, b in pairs))


def judged(
    window: ContactWindow,
    solver: str,
    claimed: bool,
    theta: np.ndarray,
    c_n: np.ndarray,
    c_t: np.ndarray,
    cost: float,
    *,
    dynamics_tolerance: float = RESIDUAL_TOLERANCE,
) -> ProgramResult:
    """Make a result from a solver's numbers, with the status that their residuals imply.

    With noisy data, the dynamics hold only within the noise; set `dynamics_tolerance` to its size.
    """
    if not all(np.isfinite(array).all() for array in (theta, c_n, c_t)):
        status, dynamics, complementarity = SolveStatus.SOLVER_FAILED, float("nan"), float("nan")
    else:
        dynamics = float(np.sqrt(np.mean(window.residual(theta, c_n, c_t) ** 2)) / window.force_scale)
        complementarity = complementarity_residual(window, c_n, c_t)
        if not complementarity <= RESIDUAL_TOLERANCE:
            status = SolveStatus.NOT_COMPLEMENTARY
        elif not dynamics <= dynamics_tolerance:
            status = SolveStatus.DYNAMICS_VIOLATED
        elif not claimed and not dynamics <= RESIDUAL_TOLERANCE:
            # with exact dynamics and complementarity, the cost is at its lower bound, whatever the solver reports
            status = SolveStatus.SOLVER_FAILED
        else:
            status = SolveStatus.SOLVED
    return ProgramResult(solver, status, claimed, theta, c_n, c_t, dynamics, complementarity, cost)
