"""Find, name and remove a hidden effect: the critique against PySINDy and Gaussian processes on the same data.

    python -m benchmarks.hidden_effects [--causes NAME ...] [--seeds 2] [--drops 100] [--quick] [-o FILE.csv]

Drops with compliant contact in continuous time in which one cause is hidden (`critique.proof`, source "mechanism";
seeds beside those of its table and of development), or nothing.  All methods see the same impacts and flights and are
judged on the same held-out trials:

- critique: `criticise` as the user calls it, from trajectories;
- SINDy, GP: outcome from state without any physics; SINDy + law, GP + law: the same on what the best law leaves.

Inputs of a baseline are the velocity of the contact point, the spin, the contact point, cosine and sine of the angle,
and the position (flights: the velocity).  Share removed: (base − method) / (base − floor) of the held-out mean error,
base the best law alone and floor that of a perfect model; in flight of the root mean square in units of noise.
"Finds": the held-out error falls by what the critique calls material, 5 % of base and a quarter of the floor
(critique: its verdict).  "Names": the critique's first group holds the effect; SINDy's only terms for v_x and v_y in
flight are −c v_x and −c v_y, which is the equation of drag.  No polynomial of the state is the equation of another
cause, and a Gaussian process has no terms.
CPU time: the critique's holds finding the impacts and all its tests, the baselines' only training.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from benchmarks.baselines import Trained, gaussian_process, sindy
from benchmarks.results import Results, benchmark_parser
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.foundation.randomness import generator
from thesis_lib.statistics.spread import robust_std
from thesis_lib.studies.proof.cases import Case, make
from thesis_lib.studies.proof.results import is_right
from thesis_lib.studies.proof.store import NOTHING

CAUSES = ("com_offset_x", "hunt_crossley", "friction_anisotropy", "linear_drag")
FLIGHT = ("linear_drag",)  # judged in flight
SEED = 5100  # not looked at while inputs and settings of the baselines were chosen
IMPACT_INPUTS = ("v_t", "v_n", "spin", "r_x", "r_y", "cos", "sin", "x")
FLIGHT_INPUTS = ("v_x", "v_y", "spin")
# what a method can name, by the start of its name
CAN_NAME = {"SINDy": "has an equation for drag only", "GP": "has no terms that could name a cause"}
Train = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple[str, ...]], Trained]


@dataclass(frozen=True)
class Problem:
    """Inputs X (n, d), outcome Y and what the law leaves of it R, both (n, 3) in m/s or m/s², noise std (n, 3)."""

    names: tuple[str, ...]
    X: np.ndarray
    Y: np.ndarray
    R: np.ndarray
    std: np.ndarray
    trial: np.ndarray


@dataclass(frozen=True)
class Found:
    """What one method says of one dataset; share of the removable error that it removes, NaN if nothing is hidden."""

    finds: bool
    names: bool
    share: float
    cpu_s: float


def impact_problem(base: Fit, o: Observations) -> Problem:
    """Velocity after impact from the state before it."""
    here = base.on(o)
    before, after = here.before, here.after
    r = o.rig.shape.contact_point(before.theta)
    k = o.rig.k_g
    v_t, v_n = before.vx - r[:, 1] * before.omega, before.vy + r[:, 0] * before.omega
    turn = np.cos(before.theta), np.sin(before.theta)
    X = np.stack([v_t, v_n, k * before.omega, *r.T, *turn, before.x], axis=1)
    Y = np.stack([after.vx, after.vy, k * after.omega], axis=1)
    R = base.on(o).R[:, :3] * [1.0, 1.0, k]
    return Problem(IMPACT_INPUTS, X, Y, R, np.ones_like(Y), o.trial)


def flight_problem(base: Fit, o: Observations) -> Problem:
    """Acceleration in flight from the velocity."""
    k, state, scale = o.rig.k_g, o.flights.state, np.array([1.0, 1.0, o.rig.k_g])
    X = np.stack([state.vx, state.vy, k * state.omega], axis=1)
    R = o.flights.residuals(base.on(o).dynamics) * scale
    std = np.sqrt(o.flights.variance) * scale
    return Problem(FLIGHT_INPUTS, X, o.flights.acceleration * scale, R, std, state.trial)


def error_of(misses: np.ndarray, std: np.ndarray, flight: bool) -> float:
    """Held-out error of (n, 3) misses as the critique tells it."""
    if flight:
        return float(np.max(robust_std(misses / std)))
    return float(velocity_error(misses, 1.0).mean())


def is_drag(terms: tuple[dict[str, float], ...]) -> bool:
    """Whether the only term of either channel of position is its own velocity, against it.

    The spin may be damped or not, so that its terms decide nothing.
    """
    return all(set(own) == {name} and own[name] < 0 for own, name in zip(terms[:2], FLIGHT_INPUTS))


def baseline(train: Train, with_law: bool, critique: DropsCritique, case: Case, floor: float) -> Found:
    """Train on the training trials, judge on the held-out ones."""
    base, flight = critique.ladder[0][1], case.truth in FLIGHT
    problem = flight_problem if flight else impact_problem
    begin = time.process_time()
    own = problem(base, critique.training)
    weight = 1.0 / own.std[:, 0]
    trained = train(own.X, own.R if with_law else own.Y, weight / weight.mean(), own.trial, own.names)
    cpu = time.process_time() - begin
    new = problem(base, critique.held_out)
    target = new.R if with_law else new.Y
    before = error_of(new.R, new.std, flight)
    after = error_of(target - trained.predict(new.X), new.std, flight)
    settings = CritiqueSettings()
    least = max(settings.material_share * before, settings.material_floor * floor)
    names = flight and bool(trained.terms) and is_drag(trained.terms)
    return Found(before - after >= least, names, (before - after) / (before - floor), cpu)


def compare(case: Case) -> dict[str, Found]:
    """What each method says of one dataset."""
    dataset, _ = make(case)
    begin = time.process_time()
    critique = criticise_drops(dataset, rng=generator(case.seed, "critique", dataset.digest()))
    cpu = time.process_time() - begin
    first, last = critique.ladder[0][2], critique.ladder[-1][2]
    if case.truth in FLIGHT:
        base, end, floor = np.sqrt(first.sigmas["flight"]), np.sqrt(last.sigmas["flight"]), 1.0
    else:
        base, end, floor = float(first.error.mean()), float(last.error.mean()), last.floor
    steps = [[s.effect.name, *s.alternatives] for s in critique.discovery.steps]
    found = {
        "critique": Found(
            critique.verdict != "adequate", is_right(case, critique.verdict, steps), (base - end) / (base - floor), cpu
        )
    }
    methods: dict[str, Train] = {"GP": gaussian_process}
    if find_spec("pysindy"):
        methods = {"SINDy": sindy} | methods
    for name, train in methods.items():
        found[name] = baseline(train, False, critique, case, floor)
        found[f"{name} + law"] = baseline(train, True, critique, case, floor)
    return found


def summarise(found: dict[str, dict[str, list[Found]]], results: Results) -> None:
    """Print and add a row for each method: counts over all datasets, the share for each cause in the note."""
    methods = list(next(iter(found.values())))
    print(f"{'':14s}{'finds':>8s}{'names':>8s}{'false':>8s}{'share':>8s}{'CPU s':>8s}  share of each cause")
    for method in methods:
        hidden = {truth: ways[method] for truth, ways in found.items() if truth != NOTHING}
        clean = found[NOTHING][method] if NOTHING in found else []
        every = [one for many in hidden.values() for one in many]
        shares = {truth: float(np.median([one.share for one in many])) for truth, many in hidden.items()}
        each = ", ".join(f"{truth} {share:.2f}" for truth, share in shares.items())
        finds, names = sum(one.finds for one in every), sum(one.names for one in every)
        false = sum(one.finds for one in clean)
        share = float(np.median([one.share for one in every]))
        cpu = float(np.median([one.cpu_s for one in [*every, *clean]]))
        results.add(f"{method}: finds the effect", finds, f"of {len(every)}")
        results.add(f"{method}: names it", names, f"of {len(every)}", CAN_NAME.get(method.split()[0], ""))
        results.add(f"{method}: finds one where nothing is hidden", false, f"of {len(clean)}")
        results.add(f"{method}: share of the removable error removed", share, "1", each)
        results.add(f"{method}: CPU time", cpu, "s")
        counts = (f"{finds}/{len(every)}", f"{names}/{len(every)}", f"{false}/{len(clean)}")
        print(f"{method:14s}" + "".join(f"{c:>8s}" for c in counts) + f"{share:8.2f}{cpu:8.2f}  {each}")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("hidden_effects", "Critique, PySINDy and Gaussian processes on the same hidden effects.")
    parser.add_argument("--causes", nargs="+", default=list(CAUSES), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=2, help="datasets of each cause, and of nothing (2)")
    parser.add_argument("--drops", type=int, default=100)
    options = parser.parse_args(arguments)
    if options.quick:
        options.causes, options.seeds, options.drops = ["linear_drag"], 1, 30
    results = Results("hidden_effects")
    if not find_spec("pysindy"):
        note = "not installed: pip install -r benchmarks/requirements.txt"
        results.add("SINDy", np.nan, "1", note)
        print(f"PySINDy is {note}")
    truths = options.causes if options.quick else [*options.causes, NOTHING]
    found: dict[str, dict[str, list[Found]]] = {}
    for truth in truths:
        for seed in range(SEED, SEED + options.seeds):
            for method, one in compare(Case("mechanism", truth, seed, options.drops)).items():
                found.setdefault(truth, {}).setdefault(method, []).append(one)
    summarise(found, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
