"""Errors of learned contact models as functions of the number of training impacts (thesis, figures 4-5 and 4-6).

Each random split holds out a share of the trials and orders the others at random.  Models train on the first n impacts
in that order, for every size n, so training sets are nested and all models of a split use the same impacts.  Errors are
√(δv_x² + δv_y² + (k δω)²) of held-out impacts.

The second study measures how much remains to be learned once the critique's physics is included.  The same learners are
added to the plain law and to the critique's law with its effects, and tested on trials that the critique did not use to
choose.  Splits then differ only in their training impacts, and intervals are from a bootstrap over held-out trials.

| in code       | unit | meaning                                                                                    |
|---------------|------|--------------------------------------------------------------------------------------------|
| `model`       |      | law, bound or learner, see `learners` and `NAMED`                                          |
| `mean`        | m/s  | mean error over the held-out impacts of one split                                          |
| `infeasible`  | 1    | share of predictions that penetrate or gain energy                                         |
| `n_converged` | 1    | least n from which the mean error stays within 5 % of its value at the largest n           |
| `n_learned`   | 1    | the same, within 5 % of the fall from the smallest to the largest n                        |
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from thesis_lib.contact.bounds import best_post_hoc, irb_bound
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.randomness import generator
from thesis_lib.learners.bases import AugmentedBase, LawBase
from thesis_lib.learners.learners import ImpactLearner, ImpactPrediction, ImpulseLearner, LawLearner, learners
from thesis_lib.statistics.bootstrap import CENTRAL_95, bootstrap_mean
from thesis_lib.statistics.intervals import student_mean
from thesis_lib.thesis.impact_study.study import split_trials
from thesis_lib.thesis.residual.settings import LearningStudySettings

BOOTSTRAP = 1000
BOUNDS = ("best_post_hoc", "irb_bound")
NAMED = ("law", "law_rigid", "law_wrench", "effects", "effects_rigid", "effects_wrench")


def learning_curves(
    impacts: Impacts, settings: LearningStudySettings, rng: np.random.Generator
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Compute errors of all laws, bounds and learners on random splits of the impacts (`study.select_impacts`).

    Returns curves, a row per model, n and split; and errors, a row per model and held-out impact of the first split, at
    the size nearest to figure 4-5.  Raises ValueError if the smallest size exceeds a split's training impacts.
    """
    models: dict[str, ImpactLearner] = {name: LawLearner(LawBase(name)) for name in settings.laws}
    models |= learners(settings.base_law, settings.gaussian_process)
    seed = int(rng.integers(2**63))
    curves, errors = [], []
    for split in range(settings.splits):
        print(f"split {split + 1} of {settings.splits}")
        train, held_out = _split(impacts, settings.held_out_share, generator(seed, "split", str(split)))
        sizes = _sizes(settings.sizes, len(train))
        shown = _nearest(sizes, settings.density_size)
        for n, found in _trained(models, train, held_out, sizes, seed, split):
            found |= _bounds({name: found[name][0] for name in settings.laws}, held_out)
            curves += [_row(name, n, split, *of_model) for name, of_model in found.items()]
            if split == 0 and n == shown:
                errors = [_errors(name, *of_model, held_out) for name, of_model in found.items()]
    return pd.DataFrame(curves), pd.concat(errors, ignore_index=True).assign(n=shown)


def named_physics_models(law: str, model: SavedModel, settings: LearningStudySettings) -> dict[str, ImpactLearner]:
    """Construct the models of `NAMED`: plain law and critique's law with effects, each alone and with residuals."""
    gp, plain, augmented = settings.gaussian_process, LawBase(law), AugmentedBase(model)
    models: dict[str, ImpactLearner] = {}
    for name, base in (("law", plain), ("effects", augmented)):
        models[name] = LawLearner(base)
        models[f"{name}_rigid"] = ImpulseLearner("X1", False, base, True, settings=gp)
        models[f"{name}_wrench"] = ImpulseLearner("X1", True, base, True, settings=gp)
    return models


def named_physics(
    impacts: Impacts,
    held_out: np.ndarray,
    law: str,
    model: SavedModel,
    settings: LearningStudySettings,
    rng: np.random.Generator,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Named physics, then residual: errors on approaching impacts of trials that the critique held out.

    `held_out` (n,) marks impacts whose trials the critique did not use for choices; `law` is its base law, `model` its
    model.json.  The splits of `settings` are here draws of the training impacts.

    Returns curves, a row per model, n and draw; and rungs, a row per model at the size of figure 4-5 with mean error
    over draws, its 95 % interval by the bootstrap over held-out trials, and the IRB bound of the data as published and
    under the effects.  Raises ValueError without training or held-out impacts.
    """
    if held_out.all() or not held_out.any():
        raise ValueError("the critique's held-out trials must contain some but not all of the impacts")
    test, pool = impacts.select(held_out), impacts.select(~held_out)
    models = named_physics_models(law, model, settings)
    sizes = _sizes(settings.sizes, len(pool))
    shown = _nearest(sizes, settings.density_size)
    seed = int(rng.integers(2**63))
    curves, sums = [], dict.fromkeys(models, 0.0)
    for split in range(settings.splits):
        print(f"draw {split + 1} of {settings.splits}")
        train = _in_random_order(pool, generator(seed, "draw", str(split)))
        for n, found in _trained(models, train, test, sizes, seed, split):
            curves += [_row(name, n, split, *of_model) for name, of_model in found.items()]
            if n == shown:
                sums = {name: total + found[name][0] for name, total in sums.items()}
    means = {name: total / settings.splits for name, total in sums.items()}
    for name, seen in (("irb_bound", test), ("irb_bound_effects", AugmentedBase(model).seen(test))):
        means[name] = irb_bound(seen.v_pre, seen.v_post, seen.r, mass=seen.mass, k_g=seen.k_g).error
    bootstrap = generator(seed, "bootstrap")
    rungs = [
        {"model": name, "n": shown, **_interval(error, test.trial, bootstrap), "n_held_out": len(test)}
        for name, error in means.items()
    ]
    return pd.DataFrame(curves), pd.DataFrame(rungs)


def held_out_by(critique: pd.DataFrame, impacts: Impacts) -> np.ndarray:
    """Mask (n,) of impacts whose trials the critique (its impacts.csv: trial, held_out) held out or did not use."""
    held = critique.groupby("trial")["held_out"].max()
    return held.reindex(impacts.trial).fillna(1).to_numpy() == 1


def curve_summary(curves: pd.DataFrame) -> pd.DataFrame:
    """Table per model and n: mean over splits, its 95 % interval (Student's t), and mean rates."""
    rows = []
    for (model, n), group in curves.groupby(["model", "n"], sort=False):
        mean, low, high = student_mean(group["mean"].to_numpy())
        rates = group[["infeasible"]].mean()
        rows.append({"model": model, "n": n, "mean": mean, "low": low, "high": high, **rates})
    return pd.DataFrame(rows)


def convergence(curves: pd.DataFrame, within: float, rng: np.random.Generator) -> pd.DataFrame:
    """Number of impacts after which the mean over splits stays within a share of its final value, or of its fall.

    Returns model, n_converged and n_learned (module's table), each with the ends _low and _high of its 95 % interval by
    the bootstrap over splits.
    """
    rows = []
    for model, group in curves.groupby("model", sort=False):
        wide = group.pivot(index="split", columns="n", values="mean").dropna(axis=1)
        sizes, values = wide.columns.to_numpy(), wide.to_numpy()
        drawn = values[rng.integers(len(values), size=(BOOTSTRAP, len(values)))].mean(axis=1)
        row = {"model": model}
        for name, by_fall in (("n_converged", False), ("n_learned", True)):
            at = [_settled(sizes, curve, within, by_fall) for curve in (values.mean(axis=0), *drawn)]
            low, high = np.quantile(at[1:], CENTRAL_95, method="nearest")
            row |= {name: int(at[0]), f"{name}_low": int(low), f"{name}_high": int(high)}
        rows.append(row)
    return pd.DataFrame(rows)


# numerator and denominator of the ratios of mean errors that the thesis claims
CLAIMS = {
    "rigid_over_irb": ("rigid_x1", "irb_bound"),
    "residual_rigid_over_irb": ("residual_rigid", "irb_bound"),
    "wrench_over_irb": ("wrench_x1", "irb_bound"),
    "residual_wrench_over_irb": ("residual_wrench", "irb_bound"),
    "best_post_hoc_over_rigid": ("best_post_hoc", "rigid_x1"),
    "x2_over_x1": ("rigid_x2", "rigid_x1"),
    "full_over_x1": ("rigid_full", "rigid_x1"),
    "parameters_over_residual": ("law_parameters", "residual_rigid"),
    "residual_rigid_over_rigid": ("residual_rigid", "rigid_x1"),  # class II over class I
    "residual_wrench_over_wrench": ("residual_wrench", "wrench_x1"),
}
# with the fewest training impacts: purely data-driven models over models with a law
OF_FEWEST = {
    "rigid_over_residual_few": ("rigid_x1", "residual_rigid"),
    "wrench_over_residual_few": ("wrench_x1", "residual_wrench"),
}
# cost of ten inputs, in samples
OF_FEW = {"full_over_x1_few": CLAIMS["full_over_x1"]}
OF_ALL = {
    "wrench_over_irb_most": CLAIMS["wrench_over_irb"],
    "residual_wrench_over_irb_most": CLAIMS["residual_wrench_over_irb"],
}
FEW = 100  # number of training impacts after which rigid learners have converged (section 4.4)


def claim_ratios(curves: pd.DataFrame, base_law: str, density_size: int) -> pd.DataFrame:
    """Ratios of mean errors at the size of figure 4-5; of `OF_FEW` near `FEW`; of `OF_FEWEST` at the smallest size.

    For `OF_ALL`, the largest ratio over all sizes.  Columns: statement, n, value, std (standard error, paired by
    split).
    """
    pairs = CLAIMS | {"law_over_wrench": (base_law, "wrench_x1")}
    sizes = np.sort(curves["n"].unique())

    def row(statement: str, n: int, pair: tuple[str, str]) -> tuple[str, int, float, float]:
        wide = curves[curves["n"] == n].pivot(index="split", columns="model", values="mean")
        ratio = wide[pair[0]] / wide[pair[1]]
        return statement, n, ratio.mean(), ratio.std(ddof=1) / np.sqrt(len(ratio))

    rows = []
    for wanted, chosen in ((density_size, pairs), (FEW, OF_FEW), (sizes[0], OF_FEWEST)):
        n = _nearest(sizes, wanted)
        rows += [row(statement, n, pair) for statement, pair in chosen.items()]
    for statement, pair in OF_ALL.items():
        rows.append(max((row(statement, n, pair) for n in sizes), key=lambda found: found[2]))
    return pd.DataFrame(rows, columns=["statement", "n", "value", "std"])


def _settled(sizes: np.ndarray, mean: np.ndarray, within: float, by_fall: bool) -> int:
    near = np.abs(mean - mean[-1]) <= within * (abs(mean[0] - mean[-1]) if by_fall else mean[-1])
    last_off = np.flatnonzero(~near)
    return sizes[0] if not len(last_off) else sizes[last_off[-1] + 1]


def _split(impacts: Impacts, share: float, rng: np.random.Generator) -> tuple[Impacts, Impacts]:
    """Split into training impacts, with trials in random order, and held-out impacts."""
    held = split_trials(impacts.trial, share, rng)
    return _in_random_order(impacts.select(~held), rng), impacts.select(held)


def _in_random_order(impacts: Impacts, rng: np.random.Generator) -> Impacts:
    trials, unit = np.unique(impacts.trial, return_inverse=True)
    return impacts.select(np.argsort(rng.permutation(len(trials))[unit], kind="stable"))


def _sizes(sizes: Sequence[int], available: int) -> list[int]:
    usable = [n for n in sorted(set(sizes)) if n <= available]
    if not usable:
        raise ValueError(f"the smallest size is {min(sizes)}, but there are only {available} training impacts")
    return usable


def _nearest(sizes: Sequence[int], wanted: int) -> int:
    return min(sizes, key=lambda n: abs(n - wanted))


def _trained(
    models: Mapping[str, ImpactLearner], train: Impacts, test: Impacts, sizes: Sequence[int], seed: int, split: int
) -> Iterator[tuple[int, dict[str, tuple[np.ndarray, ImpactPrediction]]]]:
    """Yield errors (n,) and predictions of all models for each size; searches start from the previous size's result."""
    previous = dict.fromkeys(models)
    for n in sizes:
        subset, found = train.select(np.arange(n)), {}
        for name, learner in models.items():
            # one random stream per name, so that adding a model does not change the others
            trained = learner.fit(subset, generator(seed, name, str(split), str(n)), previous[name])
            out = trained.predict(test)
            previous[name], found[name] = trained, (velocity_error(test.v_post - out.v_post, test.k_g), out)
        yield n, found


def _row(name: str, n: int, split: int, error: np.ndarray, p: ImpactPrediction | None) -> dict:
    averages = {"mean": float(np.nanmean(error)), "median": float(np.nanmedian(error))}
    counts = {"n_held_out": len(error), "n_failed": int(np.isnan(error).sum())}
    rates = {} if p is None else {"infeasible": float(np.mean(~p.feasible))}
    return {"model": name, "n": n, "split": split, **averages, **counts, **rates}


def _bounds(of_laws: Mapping[str, np.ndarray], held_out: Impacts) -> dict[str, tuple[np.ndarray, None]]:
    """Errors (n,) of `BOUNDS`, without predictions."""
    body = {"mass": held_out.mass, "k_g": held_out.k_g}
    best_of_laws = best_post_hoc(np.stack(list(of_laws.values()), axis=1))[1]
    irb = irb_bound(held_out.v_pre, held_out.v_post, held_out.r, **body).error
    return {name: (error, None) for name, error in zip(BOUNDS, (best_of_laws, irb))}


def _errors(name: str, error: np.ndarray, p: ImpactPrediction | None, held_out: Impacts) -> pd.DataFrame:
    table = pd.DataFrame({"model": name, "trial": held_out.trial, "impact": held_out.impact, "error": error})
    return table.assign(feasible=1 if p is None else p.feasible.astype(int))


def _interval(error: np.ndarray, trial: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """Mean error and its 95 % interval by the bootstrap over trials; failed solves (NaN) are excluded and counted."""
    known = np.isfinite(error)
    low, high = bootstrap_mean(error[known], trial[known], BOOTSTRAP, rng)
    return {"mean": float(error[known].mean()), "low": low, "high": high, "n_failed": int((~known).sum())}
