"""One (μ, ε) for many impacts: ours against the generic optimisers of scipy and the grid search of scikit-learn.

    python -m benchmarks.ensemble [--data DIR] [-n N] [--laws NAME ...] [--rounds R] [--quick] [-o FILE.csv]

All minimise the same mean misfit over the same impacts, through the same batched law, in the box 0 ≤ μ ≤ 1, 0 ≤ ε ≤ 1:

- ours: `fit_ensemble`, a grid that zooms in until μ and ε are known to 1e-6;
- scipy: bounded Nelder-Mead from (0.1, 0.55), to 1e-6 too; and `differential_evolution` with its defaults, which looks
  everywhere;
- scikit-learn: `GridSearchCV` over `GRID` x `GRID` points, which stops at the grid.

CPU time over ours, and by how much the misfit reached lies above the lowest of all (excess, in thousandths of it).
"""

import time
from collections.abc import Callable

import numpy as np

from benchmarks.identification import START
from benchmarks.impacts import add_impact_options, chosen_impacts
from benchmarks.results import Results, benchmark_parser
from thesis_lib.coefficients.cost import MeasuredImpulses, misfit, target_of
from thesis_lib.coefficients.ensemble import MU_MAX, fit_ensemble
from thesis_lib.contact import LAWS
from thesis_lib.contact.law import Law

BOX = [(0.0, MU_MAX), (0.0, 1.0)]
GRID = 31
COMPARED = ("anitescu_potra_newton", "mirtich", "wang_mason")
Solver = Callable[[Law, MeasuredImpulses], np.ndarray]


def mean_misfit(law: Law, target: MeasuredImpulses, p: np.ndarray) -> float:
    """What all of them minimise: mean misfit in N s at p = (μ, ε)."""
    return float(np.nan_to_num(misfit(law, target, p[0], p[1], "impulse"), nan=1e3).mean())


def ours(law: Law, target: MeasuredImpulses) -> np.ndarray:
    """(μ, ε) by the zooming grid."""
    found = fit_ensemble(law, target, "impulse")
    return np.array([found.mu, found.epsilon])


def nelder_mead(law: Law, target: MeasuredImpulses) -> np.ndarray:
    """(μ, ε) by scipy, from one start."""
    from scipy.optimize import minimize

    options = {"xatol": 1e-6, "fatol": 1e-12}
    found = minimize(lambda p: mean_misfit(law, target, p), START, method="Nelder-Mead", bounds=BOX, options=options)
    return found.x


def differential_evolution(law: Law, target: MeasuredImpulses) -> np.ndarray:
    """(μ, ε) by scipy, from everywhere."""
    from scipy.optimize import differential_evolution as evolve

    return evolve(lambda p: mean_misfit(law, target, p), BOX, rng=0).x


def grid_search(law: Law, target: MeasuredImpulses) -> np.ndarray:
    """(μ, ε) by scikit-learn: the law as an estimator without training, scored by its misfit."""
    from sklearn.base import BaseEstimator
    from sklearn.model_selection import GridSearchCV

    class Predictor(BaseEstimator):
        def __init__(self, mu: float = 0.1, epsilon: float = 0.5) -> None:
            self.mu, self.epsilon = mu, epsilon

        def fit(self, X: np.ndarray, y: np.ndarray) -> "Predictor":
            return self

        def score(self, X: np.ndarray, y: np.ndarray) -> float:
            return -mean_misfit(law, target, np.array([self.mu, self.epsilon]))

    rows = np.arange(len(target))
    axes = {"mu": np.linspace(*BOX[0], GRID), "epsilon": np.linspace(*BOX[1], GRID)}
    search = GridSearchCV(Predictor(), axes, cv=[(rows, rows)], refit=False)
    search.fit(rows[:, None], rows)
    return np.array([search.best_params_["mu"], search.best_params_["epsilon"]])


SOLVERS: dict[str, Solver] = {
    "ours": ours,
    "scipy Nelder-Mead": nelder_mead,
    "scipy differential evolution": differential_evolution,
    "scikit-learn grid search": grid_search,
}


def measure(name: str, target: MeasuredImpulses, rounds: int, results: Results) -> None:
    """Print and add time and misfit of every solver for one law; each round runs all of them in turn."""
    law = LAWS[name]
    cpu, reached = np.empty((len(SOLVERS), rounds)), np.empty(len(SOLVERS))
    for solver in SOLVERS.values():
        solver(law, target[:20])  # imports
    for k in range(rounds):
        for i, solver in enumerate(SOLVERS.values()):
            start = time.process_time()
            found = solver(law, target)
            cpu[i, k] = time.process_time() - start
            reached[i] = mean_misfit(law, target, found)
    for i, solver in enumerate(SOLVERS):
        times = float(np.median(cpu[i] / cpu[0]))
        excess = 1e3 * (reached[i] / reached.min() - 1.0)
        if solver == "ours":
            results.add(f"{name}, ours: CPU time", float(np.median(cpu[0])), "s", f"{len(target)} impacts")
        else:
            results.add(f"{name}, {solver}: CPU time over ours", times)
        results.add(f"{name}, {solver}: misfit above the lowest", excess, "‰")
        print(f"{name:26s}{solver:30s}{np.median(cpu[i]):9.3f}{times:9.1f}{excess:12.4f}")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("ensemble", "One (μ, ε) for many impacts: ours, scipy, scikit-learn.")
    add_impact_options(parser, 1718)
    parser.add_argument("--laws", nargs="+", default=list(COMPARED), choices=list(LAWS), metavar="NAME")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args(arguments)
    if options.quick:
        options.n, options.simulated, options.laws, options.rounds = 50, True, options.laws[:1], 1
    impacts, source = chosen_impacts(parser, options, np.random.default_rng(0))
    target = target_of(impacts.select(np.arange(len(impacts))[: options.n]))
    print(f"{len(target)} {source} impacts, one core")
    print(f"{'':56s}{'CPU s':>9s}{'/ ours':>9s}{'excess ‰':>12s}")
    results = Results("ensemble")
    for name in options.laws:
        measure(name, target, options.rounds, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
