"""What it costs to fit a physics engine to measured impacts, beside the compliant law that stands near it.

    python -m benchmarks.engine_fits [-n IMPACTS] [--quick] [-o FILE.csv]

Drops of the chapter's ellipse, made by the engine itself (by MuJoCo for Bullet, if that is installed) with contacts of
1 ms and recorded with a rig's noise: impacts and episodes as they come.  The fit of the engine includes that of the law
that it starts from.  CPU time on one core.
"""

import time
from importlib.util import find_spec

import numpy as np

from benchmarks.results import Results, at_least, benchmark_parser
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.engine_contact import STAND_INS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.engines.fit import fit_engine
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.studies.proof.engines import ENGINES, MU, SEEDS, EngineCase, make
from thesis_lib.studies.proof.store import NOTHING


def measure(n: int, results: Results) -> None:
    """Add CPU seconds of each engine's fit to `n` impacts, and how far its friction is off."""
    for engine in [*ENGINES, *["bullet"] * bool(find_spec("pybullet"))]:
        maker = engine if engine in ENGINES else "mujoco"
        observations = observe(make(EngineCase(maker, "ellipse", NOTHING, SEEDS), drops=2 + n // 2))
        trials = observations.trial[np.argsort(observations.trial, kind="stable")][:n]
        some = observations.select(np.unique(trials))
        begin = time.process_time()
        near = fit(Model(BASES[STAND_INS[engine][0]], takes_time=True), some)
        law = time.process_time()
        found = fit_engine(engine, near, some)
        end = time.process_time()
        size = f"{len(some)} impacts"
        results.add(f"{engine}: fit", end - begin, "CPU s", f"{size}; asked for: at most 60 s for 300")
        results.add(f"{engine}: of that the law near it", law - begin, "CPU s", size)
        off = found.values["mu"] / MU - 1.0
        results.add(f"{engine}: friction off by", 100.0 * off, "%", f"± {100.0 * found.std['mu'] / MU:.2g} (one sigma)")
        spent = f"{end - begin:10.1f} CPU s, of that the law {law - begin:.1f}"
        print(f"{engine:8s}{size:>14s}{spent}; μ {100.0 * off:+.2f} %")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("engine_fits", "Fit MuJoCo, Drake and Bullet to impacts.")
    parser.add_argument("-n", type=at_least(10), default=300, metavar="IMPACTS", help="impacts (300)")
    options = parser.parse_args(arguments)
    results = Results("engine_fits")
    measure(30 if options.quick else options.n, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
