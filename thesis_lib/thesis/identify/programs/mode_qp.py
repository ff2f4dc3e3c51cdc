"""The identification programs as convex programs, since contact modes are data (thesis eqs. 2.12 to 2.14).

In eq. 2.12, gaps φ and sliding velocities v_rel are data, and hence also the mode of every contact.  From
0 ≤ c_± ⟂ λ ± v_rel ≥ 0 follows λ ≥ |v_rel|; every cost and constraint with λ grows with it, so λ = |v_rel|.
A contact force is then a non-negative combination of the two edges of its friction cone,

    (c_n, c_t) = Σ_e a_e (1, s_e μ),   s_e = ±1,   a_e ≥ 0,   price π_e = w_n φ + w_t μ (|v_rel| + s_e v_rel),

where π_e a_e is the sum of the edge's complementarity products.  With B the edges' generalised forces, the programs

    2.12       min ‖Y Θ − B a − f‖²              over edges of price 0: closed gap, force against the sliding
    2.13       min ‖Y Θ − B a − f‖² + w_n φ'c_n   over edges that obey friction
    2.14       min π'a   subject to Y Θ − B a = f over all edges
    2.14 soft  min ‖Y Θ − B a − f‖² + π'a         over all edges

are convex, with a global minimum.  (Both friction products of 2.14 have weight w_t; both weights are 1.)

If the least-squares solution over edges of price 0 has a ≥ 0, it is optimal; eliminating the forces step by step
takes time linear in the window length.  Otherwise Clarabel solves the program, and least squares on the active edges
refines the solution.

Sources: thesis section 2.3.2; P. Goulart, Y. Chen, Clarabel, arXiv 2405.12762.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from thesis_lib.thesis.identify.base_parameters.window import ContactWindow
from thesis_lib.thesis.identify.programs.result import RESIDUAL_TOLERANCE, ProgramResult, judged

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

Program = Literal["2.12", "2.13", "2.14", "2.14 soft"]
REACH = 0.05  # m: contacts with a larger gap have no force variables; a step of 5 ms closes this gap at 10 m/s
NEGATIVE = 1e-12  # share of the force scale: a negative amplitude of smaller size counts as rounding of zero
SUPPORT = 1e-7  # share of the force scale: amplitudes that Clarabel returns for zero are smaller


# by step: the edges that may act in it (e,), and the pseudo-inverse (e, nv) of their directions
Inverses = dict[int, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Edges:
    """Edges of the friction cones that may carry force."""

    step: np.ndarray  # step, pair: (E,) contact of each edge
    pair: np.ndarray
    sign: np.ndarray  # (E,) sign s_e of friction
    direction: np.ndarray  # (E, nv) B, J_n + s μ J_t
    price: np.ndarray  # (E,) π_e per unit of a_e over the force scale

    def __len__(self) -> int:
        return len(self.step)

    def __getitem__(self, chosen: np.ndarray) -> "Edges":
        return Edges(*(part[chosen] for part in (self.step, self.pair, self.sign, self.direction, self.price)))


def edges_of(window: ContactWindow, program: Program) -> Edges:
    """Edges that a program admits on a window, with prices; gap and slip are relative to the window's scales."""
    step, pair = np.nonzero(window.gap <= REACH)
    step, pair, sign = np.repeat(step, 2), np.repeat(pair, 2), np.tile([1.0, -1.0], len(step))
    gap, v = window.gap[step, pair], window.v_t[step, pair]
    direction = window.J_n[step, pair] + sign[:, None] * window.mu * window.J_t[step, pair]
    slip = np.abs(v) + sign * v
    price = gap / window.gap_scale + window.mu * slip / window.speed_scale
    edges = Edges(step, pair, sign, direction, price)
    if program == "2.12":
        return edges[(gap == 0.0) & (slip == 0.0)]
    if program == "2.13":
        return edges[slip == 0.0]
    return edges


def solve_mode_qp(
    window: ContactWindow, program: Program = "2.12", *, dynamics_tolerance: float = RESIDUAL_TOLERANCE
) -> ProgramResult:
    """Solve a program on a window to its global minimum; `dynamics_tolerance` as in `result.judged`."""
    edges = edges_of(window, program)
    free = edges[edges.price == 0.0]
    theta, amplitude, misfit = least_squares(window, free)
    keeps = admissible(window, theta, amplitude)
    # a solution without price and misfit is optimal; for 2.12, the unbounded least squares is the cost itself
    if keeps and (program == "2.12" or misfit <= NEGATIVE):
        claimed, solver, edges = True, "least squares", free
    else:
        claimed, theta, amplitude = _clarabel(window, edges, program)
        solver = "clarabel"
        theta, amplitude = _polish(window, edges, program, theta, amplitude)
    c_n, c_t = forces_of(window, edges, amplitude)
    F = window.force_scale
    cost = float(edges.price @ amplitude / F)
    if program != "2.14":
        cost += float(np.sum((window.residual(theta, c_n, c_t) / F) ** 2))
    return judged(window, solver, claimed, theta, c_n, c_t, cost, dynamics_tolerance=dynamics_tolerance)


def forces_of(window: ContactWindow, edges: Edges, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contact forces c_n, c_t (m, p) in N for amplitudes (E,) in N."""
    c_n, c_t = np.zeros(window.gap.shape), np.zeros(window.gap.shape)
    at = (edges.step, edges.pair)
    np.add.at(c_n, at, amplitude)
    np.add.at(c_t, at, edges.sign * window.mu * amplitude)
    return c_n, c_t


def least_squares(window: ContactWindow, edges: Edges) -> tuple[np.ndarray, np.ndarray, float]:
    """Minimise ‖Y Θ − B a − f‖² without bounds: Θ (n_Θ,), a (E,) in N, and the rms misfit over the force scale.

    The forces of a step appear only in its equations.  Projection on the complement of the step's edges leaves a small
    problem in Θ.  For dependent edges the shortest solution is returned.
    """
    Y, f, inverse = without_forces(window, edges)
    columns = Y.reshape(-1, Y.shape[2])
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0.0] = 1.0
    theta = np.linalg.lstsq(columns / scale, f.ravel(), rcond=None)[0] / scale
    amplitude = amplitudes(window, inverse, theta, len(edges))
    misfit = float(np.sqrt(np.mean((Y @ theta - f) ** 2)) / window.force_scale)
    return theta, amplitude, misfit


def without_forces(window: ContactWindow, edges: Edges) -> tuple[np.ndarray, np.ndarray, Inverses]:
    """Y (m, nv, n_Θ) and f (m, nv) outside the span of each step's edges, and the inverses that give the forces."""
    Y, f = window.Y.copy(), window.f.copy()
    order = np.argsort(edges.step, kind="stable")
    steps, first = np.unique(edges.step[order], return_index=True)
    inverse: Inverses = {}
    for k, members in zip(steps, np.split(order, first[1:])):
        B = edges.direction[members].T
        inverse[int(k)] = (members, np.linalg.pinv(B))
        project = np.eye(len(B)) - B @ inverse[int(k)][1]
        Y[k], f[k] = project @ Y[k], project @ f[k]
    return Y, f, inverse


def amplitudes(window: ContactWindow, inverse: Inverses, theta: np.ndarray, n: int) -> np.ndarray:
    """Amplitudes (n,) in N of the edges that best fit the residual of `theta`; the shortest if edges are dependent."""
    amplitude = np.zeros(n)
    for k, (members, B_inverse) in inverse.items():
        amplitude[members] = B_inverse @ (window.Y[k] @ theta - window.f[k])
    return amplitude


def admissible(window: ContactWindow, theta: np.ndarray, amplitude: np.ndarray) -> bool:
    """Whether all contacts push and all parameters are within their bounds."""
    slack = NEGATIVE * window.force_scale
    return bool((amplitude >= -slack).all() and (theta >= window.theta_min).all())


def parameter_scale(window: ContactWindow) -> np.ndarray:
    """Sizes (n_Θ,) of parameters whose effect equals the largest known force, to scale solver variables to 1."""
    largest = np.abs(window.Y).max(axis=(0, 1))
    return window.force_scale / np.where(largest > 0.0, largest, window.force_scale)


def _clarabel(window: ContactWindow, edges: Edges, program: Program) -> tuple[bool, np.ndarray, np.ndarray]:
    from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

    F, T = window.force_scale, parameter_scale(window)
    n_theta, hard = len(T), program == "2.14"
    prog = MathematicalProgram()
    theta = prog.NewContinuousVariables(n_theta, "theta")
    amplitude = prog.NewContinuousVariables(len(edges), "a")
    residual = np.zeros(0) if hard else prog.NewContinuousVariables(window.f.size, "r")
    A, b = dynamics_rows(window, edges.step, edges.direction, F, T)
    if not hard:
        from scipy.sparse import eye, hstack

        # A x − r = b
        A = hstack([A, -eye(window.f.size)], format="csc")
        nv = window.f.shape[1]
        for rows in residual.reshape(-1, nv):
            prog.AddQuadraticCost(2.0 * np.eye(nv), np.zeros(nv), rows, is_convex=True)
    prog.AddLinearEqualityConstraint(A, b, np.concatenate([theta, amplitude, residual]))
    if len(edges):
        prog.AddBoundingBoxConstraint(0.0, np.inf, amplitude)
        prog.AddLinearCost(edges.price, amplitude)
    prog.AddBoundingBoxConstraint(window.theta_min / T, np.full(n_theta, np.inf), theta)
    options = SolverOptions()
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(ClarabelSolver.id(), name, 1e-11)
    result = ClarabelSolver().Solve(prog, None, options)
    solution = F * result.GetSolution(amplitude) if len(edges) else np.zeros(0)
    return result.is_success(), T * result.GetSolution(theta), solution


def dynamics_rows(
    window: ContactWindow, step: np.ndarray, direction: np.ndarray, F: float, T: np.ndarray
) -> tuple["csc_matrix", np.ndarray]:
    """Dynamics Y Θ − B a = f as sparse rows A (m nv, n_Θ + E) and b (m nv,), in units F of force and T (n_Θ,) of Θ.

    `step` (E,) and `direction` (E, nv) of the forces a.
    """
    from scipy.sparse import csc_matrix, hstack

    m, nv, _ = window.Y.shape
    rows = (step[:, None] * nv + np.arange(nv)).ravel()
    columns = np.repeat(np.arange(len(step)), nv)
    B = csc_matrix((direction.ravel(), (rows, columns)), shape=(m * nv, len(step)))
    Y = csc_matrix(window.Y.reshape(m * nv, -1) * (T / F))
    return hstack([Y, -B], format="csc"), window.f.ravel() / F


def _polish(
    window: ContactWindow, edges: Edges, program: Program, theta: np.ndarray, amplitude: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Refine the solver's last digits by least squares on the active edges, if admissible and at no higher cost."""
    if not (np.isfinite(theta).all() and np.isfinite(amplitude).all()):
        return theta, amplitude
    amplitude = np.maximum(amplitude, 0.0)
    support = np.flatnonzero(amplitude > SUPPORT * window.force_scale)
    polished_theta, share, misfit = least_squares(window, edges[support])
    priced = bool((edges.price[support] > 0.0).any())
    if not admissible(window, polished_theta, share) or (priced and not (program == "2.14" and misfit <= NEGATIVE)):
        return theta, amplitude
    polished = np.zeros(len(edges))
    polished[support] = np.maximum(share, 0.0)
    return polished_theta, polished
