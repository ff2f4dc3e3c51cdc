"""Hits of a box in space by our laws, and by MuJoCo and Drake on the same hits.

    python -m benchmarks.contacts_in_space [-n HITS] [--rounds R] [--quick] [-o FILE.csv]

A box of 100 × 80 × 60 mm comes down on a corner, turns, and hits with contacts of 1 to 2 ms.  All start from the state
at first touch and end with the state when the body is off:

- impulse laws: contact space, impulse at the corner that touches, velocity after; Mirtich's law follows the path of the
  slip through the contact, the others have no such path;
- contacts that take time: all eight corners press at once, integrated by compiled code, with the force that stands for
  the engine;
- MuJoCo: `Batch.rollout` in C, 30 steps in a contact time, balls at the eight corners; Drake: continuous time with
  error control, from Python.

CPU time on one core, timed in turn, medians over the rounds.
"""

import numpy as np

from benchmarks.results import Results, alternately, at_least, benchmark_parser, ratio
from thesis_lib.bodies.solids import Box
from thesis_lib.contact import LAWS_IN_SPACE
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.engine_contact import IN_SPACE, STAND_INS, engine_law
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State

HALF = np.array([0.05, 0.04, 0.03])  # m
VALUES = {"mu": 0.3, "epsilon": 0.5, "tau": 6e-4, "damping_ratio": 10.0, "impedance": 0.9}
FEWER = 50  # times fewer hits for Drake


def hits(n: int, rng: np.random.Generator) -> tuple[Rig, State]:
    """The box with its lowest corner on the surface, n times."""
    tensor = np.diag((HALF**2).sum() - HALF**2) / 3.0
    rig = Rig(Box(half_extents=tuple(HALF)), float(np.sqrt(np.trace(tensor) / 3.0)), 9.81, 0.0, tensor=tensor)
    velocity = np.concatenate([rng.uniform(-0.7, 0.7, (2, n)), rng.uniform(-2.5, -1.5, (1, n))])
    pose = np.concatenate([np.zeros((3, n)), of_rotation_vector(2.0 * rng.standard_normal((3, n)))])
    motion = np.concatenate([velocity, 8.0 * rng.standard_normal((3, n))])
    state = State(pose, motion, np.arange(n), np.zeros(n), None, SPACE)
    down = np.array([[0.0], [0.0], [1.0]]) * rig.gap(state)
    return rig, state.changed(position=state.position - down)


def measure(n: int, rounds: int, results: Results) -> None:
    """Add microseconds a hit of each, and how many times as long the engines take."""
    rig, state = hits(n, np.random.default_rng(0))
    few = state.select(np.arange(max(n // FEWER, 1)))
    calls, counts = {}, {}

    def add(name, law, takes_time, start) -> None:
        dynamics = bind(Model(law, (), takes_time, space=SPACE), VALUES, rig)
        calls[name] = (lambda: dynamics.press(start)) if takes_time else (lambda: dynamics.collide(start))
        counts[name] = len(start)

    for name in LAWS_IN_SPACE:
        add(name, BASES[name], False, state)
    for engine in IN_SPACE:
        add(STAND_INS[engine][0], BASES[STAND_INS[engine][0]], True, state)
        add(engine, engine_law(engine), True, few if engine == "drake" else state)
    times = {name: spent / counts[name] for name, spent in alternately(calls, rounds).items()}
    for name, spent in times.items():
        results.add(name, 1e6 * float(np.median(spent)), "µs a hit", f"{counts[name]:,} hits in one call")
    slowest = max(LAWS_IN_SPACE, key=lambda name: np.median(times[name]))
    results.add(f"MuJoCo / {slowest}, the slowest impulse law", ratio(times, "mujoco", slowest), note="asked for: 10")
    for engine in IN_SPACE:
        near = STAND_INS[engine][0]
        results.add(f"{engine} / {near}", ratio(times, engine, near), note="all corners; asked for: 1")
    for row in results.rows:
        print(f"{row['measure']:60s}{row['value']:>12,g} {row['unit'].removeprefix('1')}")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("contacts_in_space", "Hits of a box in space: our laws beside MuJoCo and Drake.")
    parser.add_argument("-n", type=at_least(1), default=2000, metavar="HITS", help="hits (2000)")
    parser.add_argument("--rounds", type=at_least(1), default=5, help="rounds (5)")
    options = parser.parse_args(arguments)
    if options.quick:
        options.n, options.rounds = 20, 1
    results = Results("contacts_in_space")
    measure(options.n, options.rounds, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
