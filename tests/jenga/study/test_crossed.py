"""Every learner plays every tower from every set once; the interval of its lead is of a new set on a new tower."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.jenga.play.game import ALL_TRIED, REFUSED, Attempt, Game
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.study import crossed, switches
from thesis_lib.jenga.study.crossed import crossed_games, crossed_leads, lead, main, shifted
from thesis_lib.jenga.study.switches import Study
from thesis_lib.statistics.intervals import student_mean


def test_each_tower_meets_each_set_once():
    settings = shifted(Chapter5())
    assert len(settings) == 3 and next(iter(settings)) == switches.NONE
    for tower in range(100, 104):
        assert {chosen.samples.of_game(tower) for chosen in settings.values()} == {0, 1, 2}
    assert settings[switches.NONE] == Chapter5()


def test_intervals_hold_for_new_towers_and_sets(rng):
    """Luck of towers 3, of sets 2, and 2 of what is left, about a lead of 1: the interval covers it in 95 %."""
    T, S, n = 10, 3, 4000
    leads = 1.0 + 3.0 * rng.standard_normal((n, T, 1)) + 2.0 * rng.standard_normal((n, 1, S))
    leads += 2.0 * rng.standard_normal((n, T, S))
    found = np.array([lead(d) for d in leads])
    covered = (found[:, 2] <= 1.0) & (found[:, 3] >= 1.0)
    assert 0.93 < covered.mean() < 0.985
    # towers alone would miss the luck of the sets
    alone = np.array([student_mean(d.mean(axis=1)) for d in leads])
    assert ((alone[:, 1] <= 1.0) & (alone[:, 2] >= 1.0)).mean() < 0.9
    assert np.sqrt((found[:, 6] ** 2).mean()) == pytest.approx(3.0, rel=0.05)
    assert np.sqrt((found[:, 7] ** 2).mean()) == pytest.approx(2.0, rel=0.1)


def test_without_luck_of_sets_the_interval_is_that_of_the_towers(rng):
    d = 1.0 + np.repeat(rng.standard_normal((8, 1)), 3, axis=1)
    mean, low, high = student_mean(d[:, 0])
    np.testing.assert_allclose(lead(d)[:4], [mean, (high - low) / 2 / 2.364624, low, high], rtol=1e-6)


def made(policy: str, tower: int, out: int, end: str = ALL_TRIED) -> Game:
    return Game(policy, tower, 0, 45, [Attempt(b, 0, 1, pushed=1, extracted=1, placed=1) for b in range(out)], end)


def test_a_refused_tower_counts_for_nobody():
    settings = shifted(Chapter5())
    games = []
    for shift, key in enumerate(settings):
        for tower in (100, 101, 102, 103):
            end = REFUSED if tower == 102 else ALL_TRIED
            games += [(key, 100, made("hma", tower, 5 + shift, end)), (key, 100, made("mor", tower, 3, end))]
    table = crossed_games(games, settings)
    assert len(table) == 24 and table["extractions"].isna().sum() == 6
    assert set(table[["tower", "set"]].itertuples(index=False, name=None)) >= {(100, 0), (100, 1), (100, 2)}
    row = crossed_leads(table).iloc[0]
    assert (row["policy"], row["rival"], row["towers"], row["sets"]) == ("hma", "mor", 3, 3)
    assert row["difference"] == 3.0


def test_the_command_plays_what_is_missing_and_says_the_leads(tmp_path, monkeypatch, capsys):
    def play(study, task, policy=None):
        game = made(task.policy, task.tower, 6 if task.policy == "hma" else 2 + task.tower % 2)
        switches.write_game(game, study.path(task))
        return game

    monkeypatch.setattr(Study, "play", play)
    monkeypatch.setattr(Study, "policy", lambda study, task: None)
    arguments = ["--towers", "4", "--folder", str(tmp_path)]
    assert main([*arguments, "--plan"]) == 0
    assert f"0 of {4 * 3 * len(crossed.POLICIES)} games are there" in capsys.readouterr().out
    assert main(arguments) == 0
    assert ["hma", "100", "mor", "3.5"] in [line.split()[:4] for line in capsys.readouterr().out.splitlines()]
    leads = pd.read_csv(tmp_path / "crossed_leads.csv")
    assert list(leads["rival"]) == ["mor", "network"] and set(leads["sets"]) == {3}
    assert len(pd.read_csv(tmp_path / "crossed_games.csv")) == 36
