"""The impact laws against the memory bandwidth of the machine, which no code that reads its data once can beat.

    python -m benchmarks.bandwidth [-n IMPACTS] [--quick] [-o FILE.csv]

The bandwidth is that of a triad a = b + s c on arrays far larger than the caches, as numpy does it: s c into a, then b
added, 5 values of 8 bytes a number moved (McCalpin's STREAM, which fuses the two, moves 3).  A law must read v_pre and
r and write v_post, impulse and status, `BYTES` an impact; those over the bandwidth are the floor.  Triad and laws are
timed in turn on one core; "in cache" are batches of 10,000, whose arrays stay in the caches.

Source: J. McCalpin, Memory bandwidth and machine balance, IEEE TCCA Newsletter (1995) 19.
"""

import numpy as np

from benchmarks.impacts import BODY, PARAMETERS, falling_ellipses
from benchmarks.results import Results, alternately, at_least, benchmark_parser
from thesis_lib.contact import LAWS, SIX_LAWS

BYTES = 8 * (3 + 2 + 3 + 2) + 1  # v_pre, r, v_post, impulse; status is one byte
IN_CACHE = 10_000
TRIAD = 1 << 23  # numbers: 64 MiB an array


def measure(n: int, triad: int, rounds: int, results: Results) -> None:
    """Add bandwidth, floor and the laws' multiples of it to the results."""
    a, b, c = np.zeros(triad), np.ones(triad), np.full(triad, 2.0)

    def stream() -> None:
        np.multiply(c, 3.0, out=a)
        np.add(a, b, out=a)

    calls = {"triad": stream}
    sizes = {"large": n, "in cache": min(n, IN_CACHE)}
    for where, size in sizes.items():
        _, v_pre, r = falling_ellipses(np.random.default_rng(0), size)
        for name in SIX_LAWS:
            calls[f"{name} {where}"] = lambda law=LAWS[name], v_pre=v_pre, r=r: law(v_pre, r, **BODY, **PARAMETERS)
    times = alternately(calls, rounds, 0.05)
    rate = 5 * 8 * triad / times["triad"]
    floor = BYTES / rate
    results.add("memory bandwidth (numpy triad)", float(np.median(rate)) / 1e9, "GB/s", f"{triad} numbers")
    results.add("floor of a law", float(np.median(floor)) * 1e9, "ns an impact", f"{BYTES} bytes moved")
    print(f"{np.median(rate) / 1e9:.1f} GB/s; floor {np.median(floor) * 1e9:.1f} ns an impact; times the floor")
    print(f"{'law':26s}" + "".join(f"{f'{size:,}':>12s}" for size in sizes.values()))
    for name in SIX_LAWS:
        shown = ""
        for where, size in sizes.items():
            over = float(np.median(times[f"{name} {where}"] / size / floor))
            note = f"batch of {size:,}" + (", whose arrays stay in the caches" if where == "in cache" else "")
            results.add(f"{name} over the floor, {where}", over, "1", note)
            shown += f"{over:12.1f}"
        print(f"{name:26s}{shown}")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("bandwidth", "The impact laws against the machine's memory bandwidth.")
    parser.add_argument("-n", type=at_least(1), default=1_000_000, metavar="IMPACTS")
    parser.add_argument("--rounds", type=at_least(1), default=7)
    options = parser.parse_args(arguments)
    n, triad, rounds = (20_000, 1 << 20, 2) if options.quick else (options.n, TRIAD, options.rounds)
    results = Results("bandwidth")
    measure(n, triad, rounds, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
