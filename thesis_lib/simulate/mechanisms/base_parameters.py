"""Base inertial parameters: the parameter combinations that determine an observed motion (thesis 2.3.2, step 1).

Inertial parameters act on the motion only through Y π.  With the columns of the stacked Y scaled to unit norm, a QR
factorisation with column pivoting

    Y P = Q [R_1 R_2; 0 0],        Θ = π_b + R_1⁻¹ R_2 π_d,        Y π = Y_b Θ

separates the r = rank Y independent columns b from the dependent columns d.  Each base parameter in Θ is an independent
parameter plus multiples of dependent parameters.  null(Y) contains the changes of π that affect no force.

Sources: M. Gautier, J. Robotic Systems 8 (1991), doi 10.1002/rob.4620080405; W. Khalil, F. Bennis, Int. J. Robotics
Research 14 (1995), doi 10.1177/027836499501400105.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular

from thesis_lib.foundation.errors import UserError

# relative to the largest diagonal element of R: rounding errors are at 1e-15, combinations too weakly excited to be
# useful at 1e-6
RANK_TOLERANCE = 1e-9
COEFFICIENT_TOLERANCE = 1e-7  # smaller coefficients of a combination are rounding errors
# norm of a column, relative to the largest one, below which a parameter has no effect
NEGLIGIBLE_COLUMN = 1e-12


@dataclass(frozen=True)
class BaseParameters:
    """Base parameter set of a window of the motion."""

    names: tuple[str, ...]  # (n,) names of all parameters
    columns: np.ndarray  # (r,) indices of the independent columns, ascending
    combination: np.ndarray  # (r, n) [1 R_1⁻¹R_2]: Θ = combination π
    # (n, n − r) changes of the parameters that have no effect, one per column, largest entry 1
    null_space: np.ndarray

    @property
    def rank(self) -> int:
        """Number of base parameters."""
        return len(self.columns)

    @property
    def base_names(self) -> tuple[str, ...]:
        """(r,) each base parameter as a sum, such as "link1.I + 0.25 link2.m"."""
        return tuple(linear_combination(row, self.names) for row in self.combination)

    def theta(self, parameters: np.ndarray) -> np.ndarray:
        """Base parameters (r,) of inertial parameters (n,)."""
        return self.combination @ np.asarray(parameters, dtype=float)

    def reduce(self, Y: np.ndarray) -> np.ndarray:
        """Columns Y_b (..., r) of a regressor (..., n)."""
        return Y[..., self.columns]


def base_parameters(Y: np.ndarray, names: Sequence[str]) -> BaseParameters:
    """Base parameter set of a regressor Y (m, nv, n) of parameters `names`, stacked over a window of m steps.

    Raises:
        UserError: Y is zero (nothing moves) or not finite.
        ValueError: the number of names differs from n.
    """
    A = np.asarray(Y, dtype=float).reshape(-1, np.shape(Y)[-1])
    n = A.shape[1]
    if len(names) != n:
        raise ValueError(f"{n} columns need as many names, got {len(names)}")
    if not np.isfinite(A).all():
        raise UserError(
            "the regressor is not finite: the window's data contain NaN or infinite values; repair or remove them"
        )
    norms = np.linalg.norm(A, axis=0)
    if not norms.max(initial=0.0) > 0.0:
        raise UserError(
            "no inertial parameter has an effect in this window (no acceleration relative to gravity, no excitation): "
            "choose a window with contact or with external forces"
        )
    acts = norms > NEGLIGIBLE_COLUMN * norms.max()
    # a column of rounding errors must not be scaled up to unit norm
    scale = np.where(acts, norms, 1.0)
    A = np.where(acts, A / scale, 0.0)
    R, pivots = qr(A, mode="economic", pivoting=True)[1:]  # pyright: ignore[reportAssignmentType]
    diagonal = np.abs(np.diag(R))
    r = int((diagonal > RANK_TOLERANCE * diagonal[0]).sum())
    coefficients = solve_triangular(R[:r, :r], R[:r, r:])
    order = np.argsort(pivots[:r])
    columns, dependent = pivots[:r][order], pivots[r:]
    # undo the scaling: (A/s) has coefficients K, A has s_b⁻¹ K s_d
    coefficients = coefficients[order] * np.where(acts, norms, 0.0)[dependent] / scale[columns][:, None]
    coefficients[np.abs(coefficients) < COEFFICIENT_TOLERANCE] = 0.0
    combination = np.zeros((r, n))
    combination[np.arange(r), columns] = 1.0
    combination[:, dependent] = coefficients
    null_space = np.zeros((n, n - r))
    null_space[columns] = -coefficients
    null_space[dependent, np.arange(n - r)] = 1.0
    null_space /= np.abs(null_space).max(axis=0, initial=1.0)
    return BaseParameters(tuple(names), columns, combination, null_space)


def linear_combination(coefficients: np.ndarray, names: Sequence[str]) -> str:
    """Readable sum of named parameters; the parameter with coefficient 1 comes first."""
    used = [i for i in range(len(names)) if abs(coefficients[i]) > COEFFICIENT_TOLERANCE]
    used.sort(key=lambda i: (abs(coefficients[i] - 1.0) > COEFFICIENT_TOLERANCE, i))
    text = ""
    for i in used:
        value = coefficients[i]
        size = "" if abs(abs(value) - 1.0) <= COEFFICIENT_TOLERANCE else f"{abs(value):.4g} "
        sign = ("-" if value < 0 else "") if not text else (" - " if value < 0 else " + ")
        text += f"{sign}{size}{names[i]}"
    return text or "0"
