"""The thesis's identification programs (eqs. 2.12, 2.13, 2.14) as nonlinear programs, solved with SNOPT or IPOPT.

The unknowns are the base parameters Θ and, for every contact within reach, c_n, c_+, c_- and λ ≥ 0; c_t = c_+ − c_-.
With the complementarity products

    gap       φ c_n,            cone   λ (μ c_n − c_+ − c_-),            slip   c_+ (λ + v_rel) + c_- (λ − v_rel),

whose factors are all non-negative (every program has the linear constraints c, λ, μ c_n − c_+ − c_-, λ ± v_rel ≥ 0),

    2.12       min ‖Y Θ − J' c − f‖²                         gap, cone, slip = 0
    2.13       min ‖Y Θ − J' c − f‖² + w_n Σ gap              cone, slip = 0         (treatment 1: softened distance)
    2.14       min w_n Σ gap + w_t Σ (cone + slip)           Y Θ − J' c = f         (treatment 2: products as cost)
    2.14 soft  min ‖Y Θ − J' c − f‖² + w_n Σ gap + w_t Σ (cone + slip)              (the same with dynamics as cost)

Eq. 2.14 as printed repeats the products as constraints; the text, followed here, moves them to the cost.  Products as
constraints are kept below a bound that falls to zero over a sequence of programs, each started from the last solution
(Scholtes); `products="strict"` starts with a bound of zero.  Treatment 3, projection of poses to the contact manifold,
changes the data: see `projection.py`.  Starts are random points; the weights w_n and w_t are 1.

Sources: thesis section 2.3.2; S. Scholtes, SIAM J. Optim. 11 (2001), doi 10.1137/S1052623499361233; P. Gill, W. Murray,
M. Saunders, SIAM Review 47 (2005), doi 10.1137/S0036144504446096 (SNOPT); A. Wächter, L. Biegler, Math. Program. 106
(2006), doi 10.1007/s10107-004-0559-y (IPOPT).
"""

from typing import TYPE_CHECKING, Literal

import numpy as np

from thesis_lib.thesis.identify.base_parameters.window import ContactWindow
from thesis_lib.thesis.identify.programs.mode_qp import REACH, Program, dynamics_rows, parameter_scale
from thesis_lib.thesis.identify.programs.result import ProgramResult, judged

if TYPE_CHECKING:
    from pydrake.solvers import MathematicalProgram, SolverOptions

Products = Literal["relaxed", "strict"]
# successive bounds of the products in scaled units; the last is zero for the solvers
RELAXATION = (1e-1, 1e-3, 1e-5, 1e-7, 1e-10)
START_RANGE = np.log(10.0)  # a random start of Θ is within a factor of ten of the typical size
VANISHING = 1e-12  # share of the force scale: equations with smaller coefficients carry no information
# SNOPT's "Scale option" to try in turn, with products (False) or with dynamics (True) as constraints.  Option 1 reports
# infeasible constraints (exit 14) for two contacts from a quarter of the random starts; option 2 does so for contacts
# that are far away, and products as constraints then need ten times as many iterations
SCALINGS = {False: (1,), True: (2, 0)}
MAX_ITERATIONS = 500  # limit of a solver; starts that succeed need fewer than a hundred
SOLVER_TOLERANCE = 1e-10  # tolerance of feasibility and optimality, for variables of about 1


class ContactProgram:
    """One program on one window, in scaled variables.

    A point (n_Θ + 4 K,) contains Θ, and c_n, c_+, c_- and λ of the K contacts, in units of T, F and V, about 1.
    `products` selects how 2.12 and 2.13 constrain the products to zero.
    """

    def __init__(self, window: ContactWindow, program: Program, *, products: Products = "relaxed") -> None:
        self.window, self.program, self.products = window, program, products
        self.step, self.pair = np.nonzero(window.gap <= REACH)
        self.F, self.T = window.force_scale, parameter_scale(window)
        self.gap = window.gap[self.step, self.pair] / window.gap_scale
        self.v = window.v_t[self.step, self.pair] / window.speed_scale

    def random_point(self, rng: np.random.Generator) -> np.ndarray:
        """Random start: parameters within a factor of ten, forces of about the largest known force, λ = |v_rel|.

        λ is known and therefore not random.  At a contact without force, a random λ would not change while c_n = 0, and
        force there would appear to cost λ μ c_n, which is a false minimum of eq. 2.14.
        """
        theta = np.exp(rng.uniform(-START_RANGE, START_RANGE, len(self.T)))
        return np.concatenate([theta, rng.exponential(1.0, 3 * len(self.step)), np.abs(self.v)])

    def unscaled(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return Θ (n_Θ,), c_n and c_t (m, p) in N of a point."""
        c_n, c_t = np.zeros(self.window.gap.shape), np.zeros(self.window.gap.shape)
        theta, (normal, plus, minus, _) = point[: len(self.T)], point[len(self.T) :].reshape(4, -1)
        c_n[self.step, self.pair] = self.F * normal
        c_t[self.step, self.pair] = self.F * (plus - minus)
        return self.T * theta, c_n, c_t

    def answer(self, point: np.ndarray, solver: str) -> ProgramResult:
        """Solve the program from a point by "snopt" or "ipopt"; the status of the result is judged by its residuals."""
        constrained = self.program in ("2.12", "2.13")
        bounds = RELAXATION if constrained and self.products == "relaxed" else (0.0,)
        for bound in bounds:
            claimed, cost, point = self._solve_once(point, solver, bound)
            if not np.isfinite(point).all():
                break
        return judged(self.window, solver, claimed, *self.unscaled(point), cost)

    def _solve_once(self, point: np.ndarray, solver: str, bound: float) -> tuple[bool, float, np.ndarray]:
        """Solve once; return whether the solver claims success, the cost, and the solution."""
        from pydrake.solvers import IpoptSolver, MathematicalProgram, SnoptSolver

        prog = MathematicalProgram()
        K = len(self.step)
        theta = prog.NewContinuousVariables(len(self.T), "theta")
        groups = [prog.NewContinuousVariables(K, name) if K else np.zeros(0) for name in ("n", "p", "m", "l")]
        self._add_dynamics(prog, theta, *groups[:3])
        if K:
            self._add_cones(prog, *groups)
            self._add_products(prog, np.stack(groups, axis=1), bound)
        prog.AddBoundingBoxConstraint(self.window.theta_min / self.T, np.full(len(theta), np.inf), theta)
        n_equations = sum(c.evaluator().num_constraints() for c in prog.linear_equality_constraints())
        if solver == "ipopt" and n_equations >= prog.num_vars():
            # IPOPT needs more unknowns than equations; otherwise it may end the process
            return False, np.nan, np.full(len(point), np.nan)
        engine = SnoptSolver() if solver == "snopt" else IpoptSolver()
        for scale in SCALINGS[self.program == "2.14"] if solver == "snopt" else (0,):
            result = engine.Solve(prog, point, solver_options(solver, scale))
            if result.is_success():
                break
        values = [result.GetSolution(group) if len(group) else group for group in (theta, *groups)]
        return result.is_success(), float(result.get_optimal_cost()), np.concatenate(values)

    def _add_dynamics(self, prog: "MathematicalProgram", theta, c_n, c_plus, c_minus) -> None:
        """Add Y Θ − J' c − f in units of F, as a cost for each step or as a constraint."""
        window, hard = self.window, self.program == "2.14"
        Y, f = window.Y * (self.T / self.F), window.f / self.F
        J_n, J_t = window.J_n[self.step, self.pair], window.J_t[self.step, self.pair]
        blocks = np.stack([-J_n, -J_t, J_t], axis=2)  # (K, nv, 3) for c_n, c_+, c_-
        idle = np.ones(len(f), dtype=bool)
        idle[self.step] = False
        # steps out of reach of any contact involve Θ only: a triangle of n_Θ + 1 rows is equivalent to all of them; for
        # exact data in flight it is zero, so that IPOPT does not get more equations than unknowns
        triangle = np.linalg.qr(np.column_stack([Y[idle].reshape(-1, len(self.T)), f[idle].ravel()]), mode="r")
        triangle = triangle[np.abs(triangle).max(axis=1, initial=0.0) > VANISHING]
        if hard:
            directions = np.concatenate([J_n, J_t, -J_t])
            A, b = dynamics_rows(window, np.tile(self.step, 3), directions, self.F, self.T)
            busy = np.repeat(~idle, f.shape[1])
            if busy.any():
                prog.AddLinearEqualityConstraint(A[busy], b[busy], np.concatenate([theta, c_n, c_plus, c_minus]))
            if len(triangle):
                prog.AddLinearEqualityConstraint(triangle[:, :-1], triangle[:, -1], theta)
            return
        if len(triangle):
            prog.Add2NormSquaredCost(triangle[:, :-1], triangle[:, -1], theta)
        for k in np.unique(self.step):
            at = np.flatnonzero(self.step == k)
            A = np.hstack([Y[k], *blocks[at]])
            forces = np.stack([c_n[at], c_plus[at], c_minus[at]], axis=1).ravel()
            prog.Add2NormSquaredCost(A, f[k], np.concatenate([theta, forces]))

    def _add_cones(self, prog: "MathematicalProgram", c_n, c_plus, c_minus, lam) -> None:
        """Add 0 ≤ c, λ;  μ c_n − c_+ − c_- ≥ 0;  λ ± v ≥ 0."""
        from scipy.sparse import eye, hstack

        K = len(c_n)
        prog.AddBoundingBoxConstraint(0.0, np.inf, np.concatenate([c_n, c_plus, c_minus]))
        prog.AddBoundingBoxConstraint(np.abs(self.v), np.full(K, np.inf), lam)
        identity = eye(K, format="csc")
        cone = hstack([self.window.mu * identity, -identity, -identity], format="csc")
        prog.AddLinearConstraint(cone, np.zeros(K), np.full(K, np.inf), np.concatenate([c_n, c_plus, c_minus]))

    def _add_products(self, prog: "MathematicalProgram", variables: np.ndarray, bound: float) -> None:
        """Add the products of each contact with variables (c_n, c_+, c_-, λ), as constraints or as a cost."""
        mu = self.window.mu
        # λ (μ c_n − c_+ − c_-) as x' Q x / 2
        Q_cone = np.zeros((4, 4))
        Q_cone[3, :3] = Q_cone[:3, 3] = [mu, -1.0, -1.0]
        # c_+ λ + c_- λ; the linear term v (c_+ − c_-) is added separately
        Q_slip = np.zeros((4, 4))
        Q_slip[3, 1:3] = Q_slip[1:3, 3] = 1.0
        for x, gap, v in zip(variables, self.gap, self.v):
            slip = np.array([0.0, v, -v, 0.0])
            if self.program in ("2.12", "2.13"):
                if self.program == "2.12":
                    # φ c_n <= t is a bound on c_n
                    prog.AddBoundingBoxConstraint(0.0, bound / gap if gap > 0.0 else np.inf, x[0])
                else:
                    prog.AddLinearCost([gap], x[:1])
                prog.AddQuadraticConstraint(Q_cone, np.zeros(4), -np.inf, bound, x)
                prog.AddQuadraticConstraint(Q_slip, slip, -np.inf, bound, x)
            else:
                prog.AddQuadraticCost(Q_cone + Q_slip, np.array([gap, v, -v, 0.0]), x, is_convex=False)


def solver_options(solver: str, scale: int = 0) -> "SolverOptions":
    """Solver options with tolerance `SOLVER_TOLERANCE`, limited iterations and no output."""
    from pydrake.solvers import IpoptSolver, SnoptSolver, SolverOptions

    if solver == "snopt":
        names = ("Major feasibility tolerance", "Major optimality tolerance", "Minor feasibility tolerance")
        values = {"Scale option": scale, "Major iterations limit": MAX_ITERATIONS}
        values["Iterations limit"] = 10 * MAX_ITERATIONS
    else:
        names = ("tol", "constr_viol_tol", "compl_inf_tol")
        # by default IPOPT widens bounds by 1e-8, which would allow negative forces
        values = {"bound_relax_factor": 0.0, "max_iter": MAX_ITERATIONS, "print_level": 0}
    options = SolverOptions()
    for name, value in {**dict.fromkeys(names, SOLVER_TOLERANCE), **values}.items():
        options.SetOption((SnoptSolver if solver == "snopt" else IpoptSolver).id(), name, value)
    return options
