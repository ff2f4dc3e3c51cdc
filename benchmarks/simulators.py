"""Speed of the simulation of chapter 2: time steps per second and core for each mechanism.

    python -m benchmarks.simulators [-n STEPS] [--repeat R] [--quick] [-o FILE.csv]

- `drop`: a release as in chapter 2, flight and contact as they come, 300 steps (wheel and arm: their own start);
- `one contact`, `two contacts`: steps in which that many pairs are active, from a body that rolls or rests;
- `drake sap`: the same start in Drake's compliant contact.
CPU time, best of several repetitions.
"""

import time
from collections.abc import Callable

import numpy as np

from benchmarks.results import Results, at_least, benchmark_parser
from thesis_lib.simulate.mechanisms import motions as chapter2
from thesis_lib.simulate.stepping.multibody import Mechanism
from thesis_lib.simulate.stepping.stepping import SimulatedMotion, simulate

KINDS = ("block", "ellipse", "disk", "rod", "wheel")
SETTINGS = chapter2.DEFAULT


def rate(run: Callable[[], SimulatedMotion], repeat: int) -> float:
    """Steps per CPU second of the fastest of `repeat` calls."""
    best = np.inf
    for _ in range(repeat):
        start = time.process_time()
        steps = run().steps
        best = min(best, (time.process_time() - start) / steps)
    return 1.0 / best


def in_contact(kind: str) -> tuple[Mechanism, np.ndarray, np.ndarray]:
    """Mechanism and start of a motion that never leaves the ground, on one pair if it can."""
    mechanism = getattr(chapter2, kind)(SETTINGS)
    q, v = np.zeros(3), np.zeros(3)
    q[1] = -mechanism.contacts(q).phi.min()
    if kind in ("disk", "ellipse"):
        v[[0, 2]] = 0.5 * q[1], -0.5  # rolls
    return mechanism, q, v


def measure(kind: str, steps: int, repeat: int) -> dict[str, float]:
    """Rates of one mechanism by each way that applies, in steps per second."""
    from benchmarks.sap import simulate_sap

    h, rng = SETTINGS.h, np.random.default_rng(0)
    if kind == "arm_disk":
        arm, made = chapter2.arm_disk(), chapter2.arm_trajectories(1, rng).records[0]
        a, start = SETTINGS.arm, (made.q[0], made.v[0], made.f_ext)
        return {
            "drop": rate(lambda: simulate(arm, *start, h, a.steps, a.mu, a.epsilon), repeat),
            "drake_sap": rate(lambda: simulate_sap(arm, *start, h, a.steps, a.mu), repeat),
        }
    mechanism = getattr(chapter2, kind)(SETTINGS)
    (q,), (v,) = chapter2.releases(kind, 1, rng, SETTINGS)
    epsilon = SETTINGS.wheel.epsilon if kind == "wheel" else SETTINGS.epsilon
    mu = SETTINGS.mu
    rates = {"drop": rate(lambda: simulate(mechanism, q, v, None, h, SETTINGS.steps, mu, epsilon), repeat)}
    if kind != "wheel":
        _, q_c, v_c = in_contact(kind)
        record = simulate(mechanism, q_c, v_c, None, h, steps, mu, 0.0)
        pairs = np.median((record.c_n > 0).sum(axis=1))
        name = "one_contact" if pairs == 1 else "two_contacts"
        rates[name] = rate(lambda: simulate(mechanism, q_c, v_c, None, h, steps, mu, 0.0), repeat)
    rates["drake_sap"] = rate(lambda: simulate_sap(mechanism, q, v, None, h, SETTINGS.steps, mu), repeat)
    return rates


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser("simulators", "Time steps per second and core of chapter 2's simulators.")
    parser.add_argument("-n", type=at_least(1), default=2000, metavar="STEPS", help="steps in contact (2000)")
    parser.add_argument("--repeat", type=at_least(1), default=5, help="rounds, the best counts (5)")
    options = parser.parse_args(arguments)
    if options.quick:
        options.n, options.repeat = 20, 1

    columns = ("drop", "one_contact", "two_contacts", "drake_sap")
    print("thousand steps per CPU second, one core")
    print(f"{'mechanism':12s}" + "".join(f"{name.replace('_', ' '):>14s}" for name in columns))
    results = Results("simulators")
    for kind in (*KINDS, "arm_disk"):
        rates = measure(kind, options.n, options.repeat)
        for name, value in rates.items():
            results.add(f"{kind}, {name.replace('_', ' ')}", value / 1e3, "thousand steps a second")
        shown = (f"{rates[name] / 1e3:.1f}" if name in rates else "-" for name in columns)
        print(f"{kind:12s}" + "".join(f"{text:>14s}" for text in shown))
    results.write(options.out)


if __name__ == "__main__":
    main()
