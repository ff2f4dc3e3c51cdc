"""Numbers of experts are judged on pushes that were not learned from, with errors that count whole pushes."""

from dataclasses import replace

import numpy as np
import pytest
from pushes_for_tests import make_samples

from thesis_lib.jenga.learners.learner import push_groups
from thesis_lib.jenga.learners.settings import ExpertSettings, LearnerSettings
from thesis_lib.jenga.play.settings import ExpertChoice
from thesis_lib.jenga.robot.samples import PushSamples
from thesis_lib.jenga.study.expert_study import FEW, MANY, clustered, expert_tables

SETTINGS = LearnerSettings(experts=ExpertSettings(iterations=15))
CHOICE = ExpertChoice(most=3)


@pytest.fixture(scope="module")
def tables():
    sets = [make_samples(200, np.random.default_rng(seed))[0] for seed in (0, 1)]
    held, _ = make_samples(300, np.random.default_rng(2))
    return expert_tables(sets, held, (60, 200), CHOICE, SETTINGS, np.random.default_rng(3))


def test_each_set_and_size_has_a_curve_that_starts_at_one_expert(tables):
    curves = tables["experts"]
    assert sorted(curves["experts"].unique()) == [1, 2, 3, MANY]
    assert len(curves) == 2 * 2 * 4 and (curves.groupby(["size", "set"])["chosen"].sum() == 1).all()
    one = curves[curves["experts"] == 1]
    assert (one[["cv", "cv_std", "held_out", "held_out_std"]] == 0.0).all(axis=None)
    best = curves.loc[curves.groupby(["size", "set"])["cv"].idxmax()]
    assert (best["chosen"] == 1).all()


def test_the_summary_is_that_of_the_curves(tables):
    curves, found = tables["experts"], tables["experts_summary"].set_index(["quantity", "size"])
    chosen = curves[curves["chosen"] == 1]
    assert found.loc[("fewest", 0), "value"] == chosen["experts"].min()
    assert found.loc[("most", 200), "value"] == chosen.loc[chosen["size"] == 200, "experts"].max()
    gain = chosen.groupby("size")["held_out"].mean()
    wide = curves.pivot(index=["size", "set"], columns="experts", values="held_out")
    apart = (wide[MANY] - wide[FEW]).groupby("size").mean()
    for size in (60, 200):
        assert found.loc[("chosen_gain", size), "value"] == pytest.approx(gain[size])
        row = found.loc[("many_minus_few", size)]
        assert row["value"] == pytest.approx(apart[size]) and row["n"] == 2
        assert row["low"] < row["value"] < row["high"] and row["std"] > 0.0


def test_pushes_of_several_kinds_take_more_than_one_regression_and_a_line_does_not():
    gains = {}
    for name in ("kinds", "line"):
        train, held = (_line(samples) if name == "line" else samples for samples in map(_made, (4, 6)))
        found = expert_tables([train], held, (600,), ExpertChoice(most=2), SETTINGS, np.random.default_rng(7))
        gains[name] = found["experts"].set_index("experts").loc[FEW, ["cv", "held_out"]].to_numpy()
    assert gains["kinds"].min() > 0.3  # stuck and free blocks
    assert gains["line"].max() < 0.0


def _made(seed: int) -> PushSamples:
    return make_samples(600, np.random.default_rng(seed))[0]


def _line(samples: PushSamples) -> PushSamples:
    """Changes that are linear in the action, with normal noise."""
    change = 0.02 * samples.action[:, :1] + 0.05 * np.random.default_rng(len(samples)).normal(size=samples.state.shape)
    return replace(samples, next_state=samples.state + change)


def test_the_error_of_a_mean_counts_pushes_and_not_samples():
    samples, _ = make_samples(400, np.random.default_rng(8))
    number = np.repeat(np.arange(len(push_groups(samples))), [len(rows) for rows in push_groups(samples)])
    of_push = np.random.default_rng(9).normal(size=number.max() + 1)[number]  # the same for all samples of a push
    mean, std = clustered(of_push, samples)
    assert mean == pytest.approx(of_push.mean())
    assert std > 2.0 * of_push.std() / np.sqrt(len(samples))
    single = samples.select(np.arange(len(samples)))
    object.__setattr__(single, "push", np.arange(len(samples)))
    assert clustered(of_push, single)[1] == pytest.approx(of_push.std() / np.sqrt(len(samples)))
