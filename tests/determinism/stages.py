"""Small runs of stages, each writing its CSV and JSON as the pipeline does: `python stages.py OUT [STAGE ...]`.

Run in processes of their own, because the seed of Python's hashes and the kernels of BLAS are chosen at the start.
"""

import sys
from collections.abc import Callable
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), *(str(TESTS / name) for name in ("critique", "jenga", "residual", "figures"))]
SEED = 20190906


def simulated(out: Path) -> None:
    """Drops of our simulator, written and read back, and the impacts that are found in them."""
    from small_critique import drops

    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.datasets.impacts.detect import find_impacts
    from thesis_lib.foundation.files import write_result

    dataset = drops()
    write_dataset(dataset, out / "drops")
    write_result(find_impacts(dataset).impacts.to_table(), out / "impacts.csv")


def critique(out: Path) -> None:
    """The whole critique, pictures apart (the bytes of those are compared in tests/workflow)."""
    from hidden_effects import injected_impacts

    import thesis_lib.figures.critique.pictures
    import thesis_lib.report.critique.page
    from thesis_lib.critique import criticise
    from thesis_lib.critique.drops.settings import CritiqueSettings

    thesis_lib.figures.critique.pictures.pictures = lambda *args: {}
    thesis_lib.report.critique.page.report_html = lambda *args: ""
    dataset = injected_impacts("made", 60, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.4})
    settings = CritiqueSettings(folds=2, finalists=2, rivals=1, max_effects=1)
    criticise(dataset, settings=settings, seed=SEED).save(out)
    (out / "report.html").unlink()


def identification(out: Path) -> None:
    """Chapter 3: ensemble and individual parameters."""
    from small_critique import drops

    from thesis_lib.foundation.files import write_result
    from thesis_lib.foundation.randomness import generator
    from thesis_lib.thesis.impact_study import study

    impacts = drops(trajectories=False).stated_impacts()
    laws = ("mirtich", "wang_mason", "whittaker")
    rng = generator(SEED, "identification")
    write_result(study.ensemble_table(impacts, laws, ("kinetic",), 20, rng), out / "ensemble.csv")
    write_result(study.individual_table(impacts, laws, ("kinetic",)), out / "individual.csv")


def dice(out: Path) -> None:
    """Chapter 4: a dice model fitted to contacts, a Gaussian process, and throws to rest."""
    import numpy as np
    from throws_for_tests import BELIEVED, BODY, TRUTH, made_contacts, throws

    from thesis_lib.foundation.files import write_json
    from thesis_lib.foundation.randomness import generator
    from thesis_lib.learners.gaussian_process import GaussianProcessSettings, fit_gaussian_process
    from thesis_lib.thesis.residual.dice.fit import fit_dice
    from thesis_lib.thesis.residual.dice.settings import DiceFitSettings
    from thesis_lib.thesis.residual.throwing.settings import ThrowSettings
    from thesis_lib.thesis.residual.throwing.throw import simulate_throws

    rng = generator(SEED, "dice")
    fitted, misfit = fit_dice(BELIEVED, made_contacts(TRUTH, 60), rng, DiceFitSettings(evaluations=80, contacts=50))
    X = rng.normal(size=(60, 3))
    Y = np.stack([np.sin(X[:, 0]), X[:, 1] * X[:, 2]], axis=1) + 0.05 * rng.normal(size=(60, 2))
    process = fit_gaussian_process(X, Y, rng, GaussianProcessSettings())
    mean, variance = process.predict(rng.normal(size=(20, 3)))[:2]
    q, v = throws(50)
    rest = simulate_throws(BODY, q, v, TRUTH.impact, TRUTH.mu, ThrowSettings(), rng).q
    numbers = {"misfit": misfit, "mu": fitted.mu, "mean": mean, "variance": variance, "rest": rest}
    write_json({name: _rounded(value) for name, value in numbers.items()}, out / "dice.json")


def jenga(out: Path) -> None:
    """Chapter 5: abstractions and networks learned from few samples."""
    import numpy as np
    from pushes_for_tests import make_samples

    from thesis_lib.foundation.files import write_json
    from thesis_lib.foundation.randomness import generator
    from thesis_lib.jenga.learners.hma import Hma
    from thesis_lib.jenga.learners.settings import LearnerSettings, NetworkSettings

    samples, _ = make_samples(150, generator(SEED, "samples"))
    learner = Hma(LearnerSettings(network=NetworkSettings(iterations=40))).fit(samples, generator(SEED, "fit"))
    test, _ = make_samples(40, np.random.default_rng(1))
    belief = learner.initial_belief(test.context)
    mean, variance = learner.predict(test.state, test.action, test.context, belief).moments()
    after = learner.update(belief, test.state, test.action, test.context, test.next_state)
    numbers = {"mean": mean, "variance": variance, "belief": after}
    write_json({name: _rounded(value) for name, value in numbers.items()}, out / "jenga.json")


def _rounded(value: object) -> list:
    """Nine digits, as tables have."""
    import numpy as np

    return [float(f"{x:.9g}") if np.isfinite(x) else None for x in np.ravel(np.asarray(value, float))]


STAGES: dict[str, Callable[[Path], None]] = {
    stage.__name__: stage for stage in (simulated, critique, identification, dice, jenga)
}


if __name__ == "__main__":
    for name in sys.argv[2:] or STAGES:
        folder = Path(sys.argv[1]) / name
        folder.mkdir(parents=True)
        STAGES[name](folder)
