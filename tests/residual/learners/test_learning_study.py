"""The learning study: splits by trial, nested training sets, convergence numbers, named physics on known effects."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from impacts_for_tests import K_G, made_impacts, saved_model

from thesis_lib.learners.bases import AugmentedBase
from thesis_lib.learners.gaussian_process import GaussianProcessSettings
from thesis_lib.thesis.residual import learning_study as study
from thesis_lib.thesis.residual.settings import LearningStudySettings

SETTINGS = LearningStudySettings(
    laws=("anitescu_potra_newton", "wang_mason"),
    sizes=(10, 40),
    splits=2,
    density_size=40,
    gaussian_process=GaussianProcessSettings(restarts=1, iterations=20, device="cpu"),
)


@pytest.fixture(scope="module")
def impacts():
    """Two impacts a trial, so that a split by impact would leak."""
    one = made_impacts(160, law="wang_mason", couple=0.5, noise=0.02)
    return replace(one, trial=one.trial // 2, impact=one.trial % 2)


@pytest.fixture(scope="module")
def curves(impacts):
    return study.learning_curves(impacts, SETTINGS, np.random.default_rng(0))


def test_splits_are_by_trial_and_training_sets_are_nested(impacts):
    train, held_out = study._split(impacts, 0.25, np.random.default_rng(0))
    assert not set(train.trial) & set(held_out.trial)
    assert len(train) + len(held_out) == len(impacts)
    assert len(np.unique(held_out.trial)) == 20
    # trials stay together, so that a training set ends within one trial at most
    assert np.sum(train.trial[1:] != train.trial[:-1]) == len(np.unique(train.trial)) - 1


def test_curves_have_every_model_size_and_split(curves):
    table, errors = curves
    models = {*SETTINGS.laws, *study.BOUNDS, *study.learners("mirtich")}
    counts = table.groupby(["model", "n"]).size()
    assert (counts == 2).all() and len(counts) == 2 * len(models)
    assert set(errors["model"]) == models and set(errors["n"]) == {40}
    first = table[(table["n"] == 40) & (table["split"] == 0)].set_index("model")["mean"]
    pd.testing.assert_series_equal(
        errors.groupby("model")["error"].mean(), first.sort_index(), check_names=False, rtol=1e-12
    )


def test_bounds_bound(curves):
    wide = curves[0].pivot(index=["n", "split"], columns="model", values="mean")
    rigid = [*SETTINGS.laws, "rigid_x1", "rigid_x2", "residual_rigid", "law_parameters", "feasible_rigid"]
    assert (wide[rigid].min(axis=1) >= wide["irb_bound"]).all()
    assert (wide["best_post_hoc"] <= wide[list(SETTINGS.laws)].min(axis=1)).all()
    # a couple is there: the wrench goes below
    assert (wide.loc[40, "wrench_x1"] < wide.loc[40, "irb_bound"]).all()
    feasible = curves[0][curves[0]["model"].isin(["feasible_rigid", "feasible_wrench", *SETTINGS.laws])]
    assert (feasible["infeasible"] == 0.0).all()


def test_equal_seeds_give_equal_curves(impacts, curves):
    few = SETTINGS.model_copy(update={"sizes": (10,), "splits": 2})
    again, _ = study.learning_curves(impacts, few, np.random.default_rng(0))
    first = curves[0][curves[0]["n"] == 10].reset_index(drop=True)
    pd.testing.assert_frame_equal(again, first)


def _made_curves(values):
    sizes = (10, 100, 1000)
    rows = [("m", n, s, v + 0.001 * s) for s in range(4) for n, v in zip(sizes, values)]
    return pd.DataFrame(rows, columns=["model", "n", "split", "mean"])


@pytest.mark.parametrize(
    ("values", "converged", "learned"),
    [
        ((1.0, 0.52, 0.5), 100, 100),
        ((1.0, 0.7, 0.5), 1000, 1000),
        ((0.51, 0.505, 0.5), 10, 1000),
        ((0.5, 0.7, 0.5), 1000, 1000),
    ],
)
def test_convergence_is_where_the_error_stays(values, converged, learned):
    row = study.convergence(_made_curves(values), 0.05, np.random.default_rng(0)).iloc[0]
    assert (row["n_converged"], row["n_learned"]) == (converged, learned)
    assert row["n_converged_low"] <= converged <= row["n_converged_high"]


def test_ratios_are_paired_by_split(curves):
    ratios = study.claim_ratios(curves[0], "wang_mason", 40).set_index("statement")
    wide = curves[0][curves[0]["n"] == 40].pivot(index="split", columns="model", values="mean")
    expected = (wide["wang_mason"] / wide["wrench_x1"]).mean()
    assert ratios.loc["law_over_wrench", "value"] == pytest.approx(expected)
    # class I over class II with the fewest impacts
    fewest = curves[0]["n"].min()
    wide = curves[0][curves[0]["n"] == fewest].pivot(index="split", columns="model", values="mean")
    row = ratios.loc["wrench_over_residual_few"]
    assert row["n"] == fewest < 40
    assert row["value"] == pytest.approx((wide["wrench_x1"] / wide["residual_wrench"]).mean())
    # over the bound at whatever number of impacts is the worst
    means = curves[0].pivot(index="n", columns=["split", "model"], values="mean").stack("split", future_stack=True)
    most = (means["wrench_x1"] / means["irb_bound"]).groupby("n").mean()
    row = ratios.loc["wrench_over_irb_most"]
    assert (row["n"], row["value"]) == (most.idxmax(), pytest.approx(most.max()))


def test_what_ten_inputs_cost_is_told_at_few_impacts():
    mean = {("rigid_full", 10): 4.0, ("rigid_full", 100): 3.0, ("rigid_full", 400): 1.0}
    mean |= {(model, n): 1.0 for model, *_ in (*study.CLAIMS.values(), ("law",)) for n in (10, 100, 400)} | mean
    mean |= {(below, n): mean.get((below, n), 1.0) for _, below in study.CLAIMS.values() for n in (10, 100, 400)}
    rows = [(model, n, split, value) for (model, n), value in mean.items() for split in (0, 1)]
    table = pd.DataFrame(rows, columns=["model", "n", "split", "mean"])
    ratios = study.claim_ratios(table, "law", 450).set_index("statement")
    assert ratios.loc["full_over_x1_few", ["n", "value"]].tolist() == [100, 3.0]
    assert ratios.loc["full_over_x1", ["n", "value"]].tolist() == [400, 1.0]


def test_named_physics_leaves_nothing_to_learn_where_it_is_the_whole_truth():
    """Impacts with a mirrored rotation: the law with the effect is at the noise, the law alone far off."""
    model = saved_model({"mirrored_rotation.mirrored": 1.0})
    one = made_impacts(160)
    noise = 0.02 * np.random.default_rng(1).normal(size=one.v_pre.shape) / [1.0, 1.0, K_G]
    one = replace(one, v_post=AugmentedBase(model).predict(one) + noise)
    held_out = one.trial % 4 == 0
    few = SETTINGS.model_copy(update={"sizes": (80,)})
    curves, rungs = study.named_physics(one, held_out, "anitescu_potra_newton", model, few, np.random.default_rng(0))
    mean = rungs.set_index("model")["mean"]
    assert mean["effects"] == pytest.approx(0.02 * np.sqrt(8.0 / np.pi), rel=0.15)  # of three normal components
    assert mean["law"] > 5.0 * mean["effects"]
    assert mean["irb_bound"] > 5.0 * mean["irb_bound_effects"]
    # a residual has nothing to add, and must not spoil it
    assert mean["effects_rigid"] < 1.15 * mean["effects"] and mean["effects_wrench"] < 1.15 * mean["effects"]
    assert (rungs["low"] <= rungs["mean"]).all() and (rungs["mean"] <= rungs["high"]).all()
    assert set(curves["model"]) == set(study.NAMED)


def test_named_physics_needs_both_sides(impacts):
    with pytest.raises(ValueError, match="some but not all"):
        study.named_physics(impacts, np.ones(len(impacts), bool), "mirtich", None, SETTINGS, np.random.default_rng(0))


def test_sizes_beyond_the_data_are_left_out():
    assert study._sizes((10, 450, 30), 100) == [10, 30]
    with pytest.raises(ValueError, match="smallest size"):
        study._sizes((450,), 100)
