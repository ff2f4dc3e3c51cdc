"""Success and CPU time of the identification programs on noise-free windows, from random starts.

    python -m benchmarks.programs [--mechanisms NAME ...] [--lengths 10 30 100 300] [--programs 2.14 ...]
                                  [--windows 5] [--starts 2] [--seed 0] [--quick] [-o FILE.csv]

Prints a row per program, mechanism and window length: how many starts end with m/I (base parameters) and forces
within 1e-6 of the truth, what the solvers claim without it, median errors, CPU seconds; and the exponent of CPU time
over window length.  See thesis_lib/thesis/identify/programs/study.py.
"""

import time

import numpy as np

from benchmarks.results import Results, benchmark_parser, exponent
from thesis_lib.thesis.identify.programs.study import STUDIES, cases, study

HEADER = (
    f"{'mechanism':10s}{'steps':>6s} {'program':12s}{'success':>9s}{'false':>6s}"
    f"{'Θ median':>10s}{'Θ worst':>10s}{'c median':>10s}{'c worst':>10s}{'CPU s':>9s}{'worst':>9s}"
)


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser("programs", "Success and CPU time of the identification programs.")
    parser.add_argument("--mechanisms", nargs="+", default=["block", "ellipse", "wheel", "arm_disk"])
    parser.add_argument("--lengths", nargs="+", type=int, default=[10, 30, 100, 300])
    parser.add_argument("--programs", nargs="+", default=["qp", "2.14"], choices=list(STUDIES))
    parser.add_argument("--windows", type=int, default=5)
    parser.add_argument("--starts", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    if options.quick:
        options.mechanisms, options.lengths, options.windows, options.starts = ["block"], [10, 20], 1, 1

    results, rows = Results("programs"), []
    # Drake takes a tenth of a second to load its solvers, which is not the first program's time
    study(STUDIES["2.14"], "block", cases("block", 10, 1, np.random.default_rng(0)), 1, np.random.default_rng(0))
    print(HEADER)
    for kind in options.mechanisms:
        for length in options.lengths:
            windows = cases(kind, length, options.windows, np.random.default_rng([options.seed, length]))
            for name in options.programs:
                begin = time.process_time()
                row = study(STUDIES[name], kind, windows, options.starts, np.random.default_rng(options.seed))
                row["name"], row["cpu_s_total"] = name, time.process_time() - begin
                rows.append(row)
                print(
                    f"{kind:10s}{length:6d} {name:12s}{row['n_success']:5d}/{row['n_starts']:<3d}"
                    f"{row['n_false_claims']:6d}{row['theta_error_median']:10.1e}{row['theta_error_max']:10.1e}"
                    f"{row['force_error_median']:10.1e}{row['force_error_max']:10.1e}"
                    f"{row['cpu_s_median']:9.4f}{row['cpu_s_max']:9.4f}",
                    flush=True,
                )
    for kind in options.mechanisms:
        for name in options.programs:
            mine = [row for row in rows if row["mechanism"] == kind and row["name"] == name]
            if len(mine) > 1:
                slope, _ = exponent([row["n_steps"] for row in mine], [row["cpu_s_median"] for row in mine])
                print(f"{kind}, {name}: CPU time grows as the window length to the power {slope:.2f}")
                success, starts = (sum(row[key] for row in mine) for key in ("n_success", "n_starts"))
                longest = mine[-1]
                note = f"windows of {longest['n_steps']} steps"
                results.add(f"{kind}, {name}: success", success, f"of {starts}", "start ends within 1e-6 of the truth")
                results.add(f"{kind}, {name}: CPU time of a start", longest["cpu_s_median"], "s", note)
                results.add(f"{kind}, {name}: exponent over the window length", slope)
    results.write(options.out)


if __name__ == "__main__":
    main()
