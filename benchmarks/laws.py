"""Speed of the impact laws: impacts per second and core, and the ratio to loops over the impacts in Python.

    python -m benchmarks.laws [-n BATCH] [--rounds R] [--quick] [-o FILE.csv]

Three ways to resolve the same impacts, timed in turn in the same run, medians over the rounds:
- `batched`: `LAWS[name](v_pre, r, ...)` on a batch, the public call with its checks and status;
- `formulas`: `Law.impulse` on a contact space that is already there, as in the identification of parameters;
- `plain loop`: the same formulas one impact at a time in plain Python floats (`benchmarks/plain_laws.py`);
- `array loop`: the library's own call on one row at a time, what calling it impact by impact costs.
"""

import numpy as np

from benchmarks.impacts import BODY, PARAMETERS, falling_ellipses
from benchmarks.plain_laws import PLAIN_LAWS, resolve_all
from benchmarks.results import Results, alternately, at_least, benchmark_parser, ratio
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.space import contact_space

ARRAY_LOOP_SHARE = 0.05  # of the batch: one-row calls are slow, their time per impact does not depend on n
SECONDS = 0.2  # at least, of each way over all rounds
WAYS = ("batched", "formulas", "plain loop", "array loop")


def measure(name: str, v_pre: np.ndarray, r: np.ndarray, rounds: int, seconds: float, results: Results) -> None:
    """Print and add impacts per second of one law by each way, and the ratios (a plain loop only for the six laws)."""
    law, n = LAWS[name], len(v_pre)
    space = contact_space(v_pre, r, **BODY)
    mu, epsilon = np.asarray(PARAMETERS["mu"]), np.asarray(PARAMETERS["epsilon"])
    few = max(1, int(ARRAY_LOOP_SHARE * n))
    singles = [(v_pre[i : i + 1], r[i : i + 1]) for i in range(few)]

    def formulas() -> None:
        with np.errstate(all="ignore"):
            law.impulse(space, mu, epsilon)

    def array_loop() -> None:
        for v_one, r_one in singles:
            law(v_one, r_one, **BODY, **PARAMETERS)

    calls = {"batched": lambda: law(v_pre, r, **BODY, **PARAMETERS), "formulas": formulas}
    if name in PLAIN_LAWS:
        rows, plain = (v_pre.tolist(), r.tolist()), PLAIN_LAWS[name]
        calls["plain loop"] = lambda: resolve_all(plain, *rows, **BODY, **PARAMETERS)
    calls["array loop"] = array_loop
    counts = {"array loop": few}
    times = {way: one / counts.get(way, n) for way, one in alternately(calls, rounds, seconds / rounds).items()}
    shown = f"{name:38s}"
    for way in WAYS:
        if way not in times:
            shown += f"{'-':>12s}{'-':>7s}"
            continue
        rate = 1e-6 / float(np.median(times[way]))
        results.add(f"{name}, {way}", rate, "million a second")
        shown += f"{rate:12.3f}"
        if way.endswith("loop"):
            times_faster = ratio(times, way, "batched")
            results.add(f"{name}, batched over {way}", times_faster)
            shown += f"{times_faster:7.0f}"
    print(shown)


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser("laws", "Impacts per second of each impact law on one core, and the ratio to loops.")
    parser.add_argument("-n", type=at_least(1), default=10_000, metavar="BATCH", help="impacts per batch (10000)")
    parser.add_argument("--rounds", type=at_least(1), default=5)
    parser.add_argument("--all", action="store_true", help="the variants as published, too")
    options = parser.parse_args(arguments)
    n, rounds, seconds = (200, 1, 0.0) if options.quick else (options.n, options.rounds, SECONDS)

    _, v_pre, r = falling_ellipses(np.random.default_rng(0), n)
    print(f"one core, batches of {n}; million impacts per CPU second")
    print(
        f"{'law':38s}{'batched':>12s}{'formulas':>12s}{'plain loop':>12s}{'ratio':>7s}{'array loop':>12s}{'ratio':>7s}"
    )
    results = Results("laws")
    for name in LAWS if options.all else SIX_LAWS:
        measure(name, v_pre, r, rounds, seconds, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
