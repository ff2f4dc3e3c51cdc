"""The study: who plays, what games say, and intervals that hold what they promise."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from pushes_for_tests import make_samples

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.settings import ExpertSettings, LearnerSettings, NetworkSettings
from thesis_lib.jenga.play.controller import Learned
from thesis_lib.jenga.play.game import Attempt, Game
from thesis_lib.jenga.play.players import policy_of
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.study.study import (
    games_table,
    needed_samples,
    paired,
    statements_table,
    study_tables,
    success_table,
)
from thesis_lib.statistics.intervals import student_mean


def game(policy: str, tower: int, out: int, tried: int = 10, end: str = "all tried") -> Game:
    attempts = [
        Attempt(b, 3, b % 2, pushed=int(b < out), extracted=1 if b < out else -1, placed=1 if b < out else -1)
        for b in range(tried)
    ]
    return Game(policy, tower, 0, 45, attempts, end)


def games(better: int = 2) -> list[tuple[int, Game]]:
    """HMA extracts `better` more than the rule on each of six towers that differ more than that."""
    found = []
    for i, tower in enumerate(range(100, 106)):
        out = 2 + i % 4
        more = [(100, game("hma", tower, out + better)), (1000, game("mor", tower, out + better))]
        same = [(size, game(name, tower, out)) for size, name in ((100, "network"), (100, "mor"), (0, "rule"))]
        found += [*more, *same, (0, game("exploration", tower, 1))]
    return found


def test_pairs_see_a_difference_that_means_do_not():
    table = games_table(games())
    means = {name: part["extractions"] for name, part in table[table["size"] != 1000].groupby("policy")}
    low_of_hma, high_of_rule = student_mean(means["hma"])[1], student_mean(means["rule"])[2]
    assert low_of_hma < high_of_rule  # unpaired intervals overlap
    row = paired(table).set_index("rival").loc["rule"]
    assert (row["difference"], row["low"], row["high"], row["n"]) == (2.0, 2.0, 2.0, 6)


def test_rivals_are_compared_at_the_same_size_and_mor_at_ten_times_that():
    rows = paired(games_table(games()))
    others = {("network", 100), ("mor", 100), ("mor", 1000), ("rule", 0), ("exploration", 0)}
    assert set(zip(rows["rival"], rows["rival_size"])) == others


def test_needed_samples_are_those_at_which_the_difference_is_gone():
    row = needed_samples(games_table(games()), 100).iloc[0]
    assert row["needed"] == 1000 and row["needed_high"] == 1000
    never = [pair for pair in games() if not (pair[0] == 1000 and pair[1].policy == "mor")]
    assert np.isnan(needed_samples(games_table(never), 100).iloc[0]["needed"])


def test_a_refused_game_is_counted_and_no_score():
    refused = Game("hma", 100, 0, 45, [], "refused", error="drift")
    table = games_table([*games()[1:], (100, refused)])
    assert table["refused"].sum() == 1
    curve = study_tables([*games()[1:], (100, refused)], 100)["curve"].set_index(["policy", "size"])
    assert curve.loc[("hma", 100), "n"] == 5 and curve.loc[("hma", 100), "refused"] == 1
    assert paired(table).set_index("rival").loc["rule", "n"] == 5


def test_successes_count_attempts_of_each_action_and_hold_the_published_ones():
    attempts = study_tables(games(), 100)["attempts"]
    assert len(attempts) == 36 * 10 and {"policy", "size", "tower", "block"} <= set(attempts)
    table = success_table(attempts, 100).set_index(["phase", "position", "action"])
    tried = table.loc[("learned", "all", "push")]
    assert tried["attempts"] == 60 and tried["successes"] == sum(4 + i % 4 for i in range(6))
    assert table.loc[("learned", "all", "extract"), "share"] == 1.0
    assert table.loc[("exploration", "all", "extract"), "published"] == pytest.approx(0.564, abs=1e-3)
    assert table.loc[("learned", "side", "extract"), "published"] == pytest.approx(0.783, abs=1e-3)
    both = table.xs("push", level="action").loc["learned", "attempts"]
    assert both["side"] + both["middle"] == both["all"]


def test_the_course_of_a_game_counts_pushes_by_ten_blocks():
    played = [(100, game("hma", tower, 12, tried=25)) for tower in (100, 101)]
    course = study_tables([*played, (0, game("exploration", 100, 4, tried=3))], 100)["course"]
    course = course.set_index(["phase", "position", "first"]).sort_index()
    learned = course.loc[("learned", "all")]
    assert learned["attempts"].tolist() == [20, 20, 10] and learned["successes"].tolist() == [20, 4, 0]
    assert course.loc[("learned", "side", 11), "attempts"] == 10  # every other block
    assert course.loc[("exploration", "all", 1), ["attempts", "successes", "share"]].tolist() == [3, 3, 1.0]


def test_statements_compare_shares_ends_and_the_network_tower_by_tower():
    ends = {
        "hma": ("all tried", "tower toppled", "block dropped", "fell from the top", "all tried", "all tried"),
        "hma_without_cost": ("tower toppled",) * 4 + ("all tried",) * 2,
        "network": ("all tried",) * 2 + ("tower toppled",) * 4,
    }
    blocks = {"hma": (8, 4, 4, 4, 6, 6), "hma_without_cost": (1,) * 6, "network": (5, 4, 2, 2, 2, 2)}
    played = [
        (100, game(name, 100 + i, out, end=end))
        for name, all_ends in ends.items()
        for i, (out, end) in enumerate(zip(blocks[name], all_ends))
    ]
    tables = study_tables(
        [*played, (0, game("exploration", 100, 4)), (100, Game("hma", 106, 0, 45, [], "refused"))], 100
    )
    tables["success"].loc[lambda t: (t["phase"] == "exploration") & (t["action"] == "extract"), "share"] = 0.5
    movable = pd.Series({"mean": 0.6, "low": 0.5, "high": 0.7, "n": 10})
    rows = statements_table(tables["games"], tables["success"], movable, 100).set_index("quantity")
    assert rows.loc["side_extraction_gain", "value"] == 2.0
    assert rows.loc["push_less_movable", "value"] == pytest.approx(0.4 - 0.6)
    assert rows.loc["push_less_movable", "std"] > 0.1 / 2.3  # half the interval over Student's t of 9
    assert rows.loc["lost_in_two_ways", ["value", "n"]].tolist() == [pytest.approx(2 / 3), 3]
    assert rows.loc["toppled_without_cost", ["value", "n"]].tolist() == [pytest.approx(4 / 6 - 1 / 6), 6]
    assert rows.loc["network_loses_more", ["value", "n"]].tolist() == [pytest.approx(4 / 6 - 3 / 6), 6]
    assert rows.loc["network_brings_less", ["value", "n"]].tolist() == [3.0, 1]  # tower 100 alone is lost by neither
    alone = games_table([pair for pair in played if pair[1].policy == "hma"])
    kept = statements_table(alone, tables["success"], movable, 100)["quantity"]
    assert kept.tolist() == ["side_extraction_gain", "push_less_movable", "lost_in_two_ways"]


def test_policies_by_name():
    samples, _ = make_samples(120, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    for name in ("rule", "always_push", "exploration", "oracle"):
        assert policy_of(name, None, 0, Chapter5(), rng).name == name
    quick = Chapter5(learner=LearnerSettings(network=NetworkSettings(iterations=50), experts=ExpertSettings(most=2)))
    changed = replace(samples, next_state=samples.next_state + (np.arange(120) >= 100)[:, None])  # not learned from
    names = ["mor", "network", "hma_without_cost", "mor_with_cost", "network_with_cost"]
    for i, name in enumerate(names):
        one, two = (policy_of(name, each, 100, quick, np.random.default_rng(2)) for each in (samples, changed))
        assert isinstance(one, Learned) and one.name == name and bool(one.settings.no_move) == (i > 2)
        state = (samples.state[:5], samples.action[:5], samples.context[:5])
        predicted = [each.learner.predict(*state, each.learner.initial_belief(state[2])).mean for each in (one, two)]
        np.testing.assert_array_equal(*predicted)
    with pytest.raises(UserError, match="100000 training samples"):
        policy_of("hma", samples, 100_000, quick, rng)
    with pytest.raises(UserError, match="no learner oracles"):
        policy_of("oracles", samples, 50, quick, rng)
