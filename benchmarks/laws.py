"""Speed of the impact laws: impacts per second and core, and the ratio to loops over the impacts in Python.

    python -m benchmarks.laws [-n BATCH] [--repeat R] [-o FILE.json]

Three ways to resolve the same impacts, timed in the same run, best of several repetitions each:
- `batched`: `LAWS[name](v_pre, r, ...)` on a batch, the public call with its checks and status;
- `formulas`: `Law.impulse` on a contact space that is already there, as in the identification of parameters;
- `plain loop`: the same formulas one impact at a time in plain Python floats (`benchmarks/plain_laws.py`);
- `array loop`: the library's own call on one row at a time, what calling it impact by impact costs.
"""

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path

# before numpy is imported: one core, whatever the number of threads it would take
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402

from benchmarks.plain_laws import PLAIN_LAWS, resolve_all  # noqa: E402
from thesis_lib.contact import LAWS, SIX_LAWS  # noqa: E402
from thesis_lib.contact.space import contact_space  # noqa: E402
from thesis_lib.files import write_json  # noqa: E402

BODY = {"mass": 0.0364, "k_g": 0.0192}  # the ellipse of the planar impact experiment
PARAMETERS = {"mu": 0.15, "epsilon": 0.55}
ARRAY_LOOP_SHARE = 0.05  # of the batch: one-row calls are slow, their time per impact does not depend on n
SECONDS = 0.2  # at least, per timing


def falling_ellipses(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocities (n, 3) and contact points (n, 2) like the experiment's: about 2.5 m/s down, all directions of slip."""
    theta = rng.uniform(0.0, 2.0 * np.pi, n)
    a, b = 0.035, 0.025
    h = np.hypot(a * np.sin(theta), b * np.cos(theta))
    r = np.stack([(a * a - b * b) * np.sin(theta) * np.cos(theta) / h, -h], axis=-1)
    v_pre = rng.normal([0.0, -2.5, 0.0], [0.6, 0.2, 12.0], (n, 3))
    approaching = v_pre[:, 1] + r[:, 0] * v_pre[:, 2] < 0.0
    v_pre[~approaching, 2] = 0.0
    return v_pre, r


def seconds_per_call(call: Callable[[], object], repeat: int) -> float:
    """Least time of one call over `repeat` rounds, each of at least SECONDS / repeat."""
    call()
    best = np.inf
    for _ in range(repeat):
        calls, start = 0, time.perf_counter()
        while (elapsed := time.perf_counter() - start) < SECONDS / repeat or calls == 0:
            call()
            calls += 1
        best = min(best, elapsed / calls)
    return best


def measure(name: str, v_pre: np.ndarray, r: np.ndarray, repeat: int) -> dict[str, float]:
    """Impacts per second of one law by each way, and the ratios (the loops only for the six laws as defined)."""
    law, n = LAWS[name], len(v_pre)
    space = contact_space(v_pre, r, **BODY)
    mu, epsilon = np.asarray(PARAMETERS["mu"]), np.asarray(PARAMETERS["epsilon"])

    def formulas() -> None:
        with np.errstate(all="ignore"):
            law.impulse(space, mu, epsilon)

    rates = {
        "batched": n / seconds_per_call(lambda: law(v_pre, r, **BODY, **PARAMETERS), repeat),
        "formulas": n / seconds_per_call(formulas, repeat),
    }
    few = max(1, int(ARRAY_LOOP_SHARE * n))
    singles = [(v_pre[i : i + 1], r[i : i + 1]) for i in range(few)]

    def array_loop() -> None:
        for v_one, r_one in singles:
            law(v_one, r_one, **BODY, **PARAMETERS)

    rates["array_loop"] = few / seconds_per_call(array_loop, 1)
    if name in PLAIN_LAWS:
        rows = v_pre.tolist(), r.tolist()
        plain = PLAIN_LAWS[name]
        rates["plain_loop"] = n / seconds_per_call(
            lambda: resolve_all(plain, *rows, **BODY, **PARAMETERS), repeat
        )
        rates["ratio_plain"] = rates["batched"] / rates["plain_loop"]
    rates["ratio_array"] = rates["batched"] / rates["array_loop"]
    return rates


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.laws",
        description="Impacts per second of each impact law on one core, and the ratio to loops in Python.",
    )
    parser.add_argument("-n", type=int, default=10_000, metavar="BATCH", help="impacts per batch (10000)")
    parser.add_argument("--repeat", type=int, default=5, help="rounds, the best counts (5)")
    parser.add_argument("--all", action="store_true", help="the variants as published, too")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="write the figures as JSON")
    options = parser.parse_args(arguments)
    if options.n < 1 or options.repeat < 1:
        parser.error("BATCH and --repeat must be at least 1")

    v_pre, r = falling_ellipses(np.random.default_rng(0), options.n)
    print(f"one core, batches of {options.n}; million impacts per second")
    print(
        f"{'law':38s}{'batched':>9s}{'formulas':>10s}{'plain loop':>12s}{'ratio':>7s}{'array loop':>12s}{'ratio':>7s}"
    )
    results = {}
    for name in LAWS if options.all else SIX_LAWS:
        rates = measure(name, v_pre, r, options.repeat)
        results[name] = {key: float(f"{value:.4g}") for key, value in rates.items()}
        million = {key: f"{value / 1e6:.3f}" for key, value in rates.items()}
        plain_ratio = f"{rates['ratio_plain']:.0f}" if "ratio_plain" in rates else "-"
        print(
            f"{name:38s}{million['batched']:>9s}{million['formulas']:>10s}{million.get('plain_loop', '-'):>12s}"
            f"{plain_ratio:>7s}{million['array_loop']:>12s}{rates['ratio_array']:>7.0f}"
        )
    if options.output:
        write_json({"batch": options.n, "unit": "impacts per second", "laws": results}, options.output)


if __name__ == "__main__":
    main()
