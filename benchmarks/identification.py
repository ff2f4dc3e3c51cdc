"""Speed of the individual identification: CPU seconds of each law for all impacts, and the ratio to scipy.optimize.

    python -m benchmarks.identification [--data DIR] [-n N] [--sample S] [--all] [--quick] [-o FILE.csv]

For every law the individual (μ_i, ε_i) of N impacts, as chapter 3 needs them (impulse metric, kinetic weighting), on
the measured planar impacts if they are here, else on simulated ones with noise.  Beside it, in the same run, bounded
Nelder-Mead of scipy.optimize on a random sample of the same impacts, one at a time from one start each, the plain
way to do it; its time for all impacts is extrapolated from the sample.  `ours worse` and `theirs worse` count the
impacts of the sample in which one ends with an error above the other's by more than 1e-6 N s.
"""

import time

import numpy as np
from scipy.optimize import minimize

from benchmarks.impacts import add_impact_options, chosen_impacts
from benchmarks.results import Results, at_least, benchmark_parser
from thesis_lib.coefficients.cost import MeasuredImpulses, misfit, target_of
from thesis_lib.coefficients.individual import MU_MAX, fit_individual
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.law import Law

ROUNDS = 3
START = (0.1, 0.55)  # near the ensemble's parameters
DIFFERENCE = 1e-6  # N s: a hundredth of the tolerance of table 3.2


def one_by_one(law: Law, target: MeasuredImpulses, rows: np.ndarray) -> np.ndarray:
    """Errors (len(rows),) in N s that bounded Nelder-Mead reaches."""
    errors = np.empty(len(rows))
    for k, row in enumerate(rows):
        single = target[row : row + 1]

        def error(p: np.ndarray, single: MeasuredImpulses = single) -> float:
            return float(np.nan_to_num(misfit(law, single, p[0], p[1], "impulse"), nan=1e3)[0])

        options = {"xatol": 1e-6, "fatol": 1e-9, "maxiter": 400}
        found = minimize(error, START, method="Nelder-Mead", bounds=[(0, MU_MAX), (0, 1)], options=options)
        errors[k] = found.fun
    return errors


def measure(name: str, target: MeasuredImpulses, rows: np.ndarray) -> dict[str, float]:
    """CPU seconds of both ways for all impacts, their ratio, and who is worse where."""
    law = LAWS[name]
    ours, one, excess = [], [], []
    for part in np.array_split(rows, min(ROUNDS, len(rows))):  # in turn, so that both see the same machine
        start = time.process_time()
        fit = fit_individual(law, target, "impulse")
        ours.append(time.process_time() - start)
        start = time.process_time()
        theirs = one_by_one(law, target, part)
        one.append((time.process_time() - start) / len(part))
        excess.append(theirs - fit.error[part])
    excess = np.concatenate(excess)
    return {
        "seconds": float(np.median(ours)),
        "seconds_scipy": float(np.median(one)) * len(target),
        "ratio": float(np.median(np.divide(one, ours))) * len(target),
        "ours_worse": int(np.sum(excess < -DIFFERENCE)),
        "scipy_worse": int(np.sum(excess > DIFFERENCE)),
        "largest_excess_scipy": float(excess.max()),
        "largest_excess_ours": float(max(-excess.min(), 0.0)),
    }


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser(
        "identification", "CPU seconds of the individual identification of each law, and the ratio to scipy.optimize."
    )
    add_impact_options(parser, 1718)
    parser.add_argument("--sample", type=at_least(1), default=60, metavar="S", help="impacts for scipy.optimize (60)")
    parser.add_argument("--all", action="store_true", help="the variants as published, too")
    options = parser.parse_args(arguments)
    if options.quick:
        options.n, options.sample, options.simulated = 40, 3, True

    rng = np.random.default_rng(0)
    impacts, source = chosen_impacts(parser, options, rng)
    target = target_of(impacts.select(np.arange(len(impacts))[: options.n]))
    rows = rng.choice(len(target), size=min(options.sample, len(target)), replace=False)

    print(f"{len(target)} {source} impacts, one core, CPU seconds; scipy.optimize from a sample of {len(rows)}")
    print(f"{'law':38s}{'ours':>8s}{'scipy':>9s}{'ratio':>7s}{'ours worse':>12s}{'scipy worse':>13s}")
    results, found_by = Results("identification"), {}
    for name in LAWS if options.all else SIX_LAWS:
        found = found_by[name] = measure(name, target, rows)
        print(
            f"{name:38s}{found['seconds']:8.2f}{found['seconds_scipy']:9.1f}{found['ratio']:7.0f}"
            f"{found['ours_worse']:12d}{found['scipy_worse']:13d}"
        )
    six, six_scipy = (sum(found_by[name][key] for name in SIX_LAWS) for key in ("seconds", "seconds_scipy"))
    worse = {key: sum(found_by[name][key] for name in SIX_LAWS) for key in ("scipy_worse", "ours_worse")}
    print(f"{'the six laws':38s}{six:8.2f}{six_scipy:9.1f}{six_scipy / six:7.0f}")
    results.add("six laws: CPU time", six, "s", f"{len(target)} {source} impacts")
    results.add("six laws: scipy (Nelder-Mead, one by one) over ours", six_scipy / six)
    results.add("six laws: scipy ends worse", worse["scipy_worse"], f"of {6 * len(rows)}", "by more than 1e-6 N s")
    results.add("six laws: ours ends worse", worse["ours_worse"], f"of {6 * len(rows)}", "by more than 1e-6 N s")
    results.write(options.out)


if __name__ == "__main__":
    main()
