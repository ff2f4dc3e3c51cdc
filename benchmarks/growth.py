"""How the cost grows with the number of drops: exponents of CPU time for laws, comparison and critique.

    python -m benchmarks.growth [--largest 1000000] [--critique 50 100 200 400] [--quick] [-o FILE.csv]

- laws: one call of each of the six laws on n impacts (one a drop);
- comparison: (μ, ε) of two laws (the fastest and the slowest) identified on half of n impacts, errors on the other
  half, as chapter 3 does;
- critique: `criticise` on the trajectories of n drops.  It ends at 400 by default: a drop costs about a tenth of a CPU
  second, 10⁴ would take 20 minutes and 10⁶ a day and a half.

Cost = a nᵖ is fitted by least squares to the logarithms, once over all n and once over the larger ones (from
10⁴, critique from 50), where what a call costs by itself no longer counts; with 95 % intervals.  Near linear is p
between 0.9 and 1.1 there; the rows say where it is not.  CPU seconds on one core; peak memory is of the whole process.
"""

import resource
import time
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.impacts import BODY, PARAMETERS, falling_ellipses, simulated_impacts
from benchmarks.results import Results, at_least, benchmark_parser, exponent
from thesis_lib.coefficients.cost import target_of
from thesis_lib.coefficients.ensemble import fit_ensemble
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.space import velocity_error

COMPARED = ("anitescu_potra_newton", "mirtich")
LARGE = {"laws": 10_000, "comparison": 10_000, "critique": 50}  # from here on the exponent of large n
NEAR_LINEAR = (0.9, 1.1)
SECONDS = 0.2  # a size is repeated until it has taken so long, at least once


def sizes(largest: int) -> list[int]:
    """100, 316, 1,000, ... up to `largest`."""
    return [round(n) for n in 10.0 ** np.arange(2.0, np.log10(largest) + 1e-9, 0.5)]


def cpu_of(call: Callable[[], object], seconds: float) -> float:
    """Median CPU seconds of a call, repeated for `seconds` in all."""
    taken: list[float] = []
    while not taken or sum(taken) < seconds:
        start = time.process_time()
        call()
        taken.append(time.process_time() - start)
    return float(np.median(taken))


def law_calls(n: int) -> Callable[[], object]:
    """All six laws on n impacts."""
    _, v_pre, r = falling_ellipses(np.random.default_rng(0), n)

    def call() -> None:
        for name in SIX_LAWS:
            LAWS[name](v_pre, r, **BODY, **PARAMETERS)

    return call


def comparison(n: int) -> Callable[[], object]:
    """Two laws identified on one half of n impacts and judged on the other."""
    impacts = simulated_impacts(np.random.default_rng(0), n)
    training, held_out = impacts.select(np.arange(0, n, 2)), impacts.select(np.arange(1, n, 2))

    def call() -> None:
        target = target_of(training)
        for name in COMPARED:
            law = LAWS[name]
            found = fit_ensemble(law, target, "impulse")
            out = law(held_out.v_pre, held_out.r, **BODY, mu=found.mu, epsilon=found.epsilon)
            velocity_error(held_out.v_post - out.v_post, BODY["k_g"]).mean()

    return call


def critique(n: int) -> Callable[[], object]:
    """The critique of n drops with a displaced centre of mass."""
    from thesis_lib.critique import criticise
    from thesis_lib.studies.proof.cases import Case, make

    dataset, _ = make(Case("law", "com_offset", 0, n))
    return lambda: criticise(dataset)


def measure(
    name: str, make: Callable[[int], Callable[[], object]], n: Sequence[int], seconds: float, results: Results
) -> None:
    """Time `make(n)()` for every n; print and add the costs and exponents."""
    taken = []
    for size in n:
        taken.append(cpu_of(make(size), seconds))
        results.add(f"{name}, {size:,} drops", taken[-1], "CPU s")
        print(f"{name:12s}{size:12,d}{taken[-1]:12.4g} s{1e6 * taken[-1] / size:12.3g} µs a drop", flush=True)
    for which, least in (("all", 0), ("large", LARGE[name])):
        used = [(size, cost) for size, cost in zip(n, taken) if size >= least]
        if len(used) < 2:
            continue
        p, half = exponent(*zip(*used))
        said = "near linear" if NEAR_LINEAR[0] <= p <= NEAR_LINEAR[1] else "not linear"
        if which == "all":
            said = "with what a call costs by itself"
        note = f"± {half:.2f} (95 %), n = {used[0][0]:,} to {used[-1][0]:,}; {said}"
        results.add(f"{name}, exponent, {which} n", p, "1", note)
        print(f"{name:12s} cost ~ n^{p:.2f} {note}")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("growth", "Growth of the cost with the number of drops.")
    parser.add_argument("--largest", type=at_least(100), default=1_000_000, help="impacts (1000000)")
    parser.add_argument("--critique", type=at_least(30), nargs="+", default=[50, 100, 200, 400], metavar="DROPS")
    options = parser.parse_args(arguments)
    largest, seconds = (1_000, 0.0) if options.quick else (options.largest, SECONDS)
    results = Results("growth")
    for name, make in (("laws", law_calls), ("comparison", comparison)):
        measure(name, make, sizes(largest), seconds, results)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        results.add(f"{name}, peak memory", peak, "GB", f"of the process, up to {largest:,} impacts")
    if not options.quick:
        measure("critique", critique, options.critique, seconds, results)
        largest = max(options.critique)
        results.add("critique, largest n", largest, "drops", "more would take minutes (10⁴) to days (10⁶)")
    results.write(options.out)


if __name__ == "__main__":
    main()
