"""Switches change what they say and nothing else; their study goes on where it was and compares the same towers."""

import numpy as np
import pandas as pd
import pytest
import yaml

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.play.game import ALL_TRIED, REFUSED, Attempt, Game
from thesis_lib.jenga.play.players import policy_of
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.study import switches as switching
from thesis_lib.jenga.study.switches import FIXED, NONE, SWITCHES, Study, effects, main, read_switches

BASE = Chapter5()
IN_THESIS = {"exact_states", "three_quarters", "grasp_error", "exploration"}


def leaves(values: dict, place: tuple = ()) -> dict[tuple, object]:
    """Values by their place."""
    found = {}
    for key, value in values.items():
        found |= leaves(value, (*place, key)) if isinstance(value, dict) else {(*place, key): value}
    return found


def test_each_switch_changes_what_it_names_and_nothing_else():
    named = yaml.safe_load(SWITCHES.read_text(encoding="utf-8"))
    known = read_switches(SWITCHES, BASE)
    assert set(named) == IN_THESIS and list(known) == [NONE, *named] and known[NONE] == BASE
    before = leaves(BASE.model_dump())
    for name, overlay in named.items():
        after = leaves(known[name].model_dump())
        assert {place for place in after if after[place] != before[place]} == set(leaves(overlay)), name


def test_a_switch_of_what_does_not_exist_is_refused_by_name(tmp_path):
    path = tmp_path / "switches.yaml"
    for text in ("wrong: {setup: {robot: {goals: 1}}}", f"{NONE}: {{setup: {{}}}}", "- a"):
        path.write_text(text)
        with pytest.raises(UserError, match="wrong" if text.startswith("wrong") else "must hold"):
            read_switches(path, BASE)


def test_policies_that_need_no_samples_are_those():
    rng = np.random.default_rng(0)
    assert [policy_of(name, None, 0, BASE, rng).name for name in FIXED] == list(FIXED)


def made(policy: str, tower: int, out: int, end: str = ALL_TRIED) -> Game:
    attempts = [Attempt(block, 0, 1, pushed=1, extracted=1, placed=1) for block in range(out)]
    return Game(policy, tower, 0, 45, attempts, end)


@pytest.fixture
def study(tmp_path, monkeypatch) -> Study:
    """Games that bring out 4 blocks, 1 more where states are exact; `played` counts them."""
    played = []

    def play(tower, policy, setup, base_seed, *, blocks):
        played.append(tower)
        return made(policy.name, tower, 4 + setup.sensing.exact)

    monkeypatch.setattr(switching, "play", play)
    monkeypatch.setattr(Study, "played", played, raising=False)
    known = read_switches(SWITCHES, BASE)
    return Study(tmp_path, {name: known[name] for name in (NONE, "exact_states")}, 7, 45)


def test_a_study_goes_on_where_it_was(study):
    tasks = study.tasks(("rule", "exploration"), 100, towers=2)
    assert len(tasks) == 8 and {task.size for task in tasks} == {0}
    assert study.seconds(tasks) == pytest.approx(8 * switching.GAME)
    assert {task.tower for task in tasks} == {100, 101}
    assert [task.tower for task in study.tasks(("rule",), 100, 2, first=3)] == [3, 3, 4, 4]
    study.run(tasks[:3])
    lines = []
    study.run(tasks, lines.append)
    assert len(study.played) == 8 and len(lines) == 5 and lines[-1].startswith("game 4 of 5")
    study.path(tasks[5]).unlink()
    study.run(tasks)
    assert len(study.played) == 9 and not study.missing(tasks)
    found = effects(study.games_of(tasks)).set_index(["switch", "policy"])
    assert found.loc[("exact_states", "rule"), "difference"] == 1.0
    assert np.isnan(found.loc[(NONE, "rule"), "difference"])


def test_games_of_other_settings_are_not_mixed(study):
    tasks = study.tasks(("rule",), 100, towers=1)
    study.run(tasks)
    other = Study(study.folder, study.settings, study.seed, blocks=44)
    with pytest.raises(UserError, match="other settings"):
        other.run(tasks)


def test_samples_that_are_missing_cost_time_until_they_are_there(study):
    tasks = study.tasks(("hma", "rule"), 100, towers=2)
    learned = switching.SAMPLE * 100 * 2 * 2  # two sets, with and without the switch
    assert study.seconds(tasks) == pytest.approx(8 * switching.GAME + learned)
    path = study.folder / NONE / "samples" / "set_1_100.csv"
    path.parent.mkdir(parents=True)
    path.touch()
    assert study.seconds(tasks) == pytest.approx(8 * switching.GAME + 0.75 * learned)


def test_effects_are_differences_on_the_same_towers():
    plain = [(NONE, 100, made("hma", tower, out)) for tower, out in ((100, 3), (101, 9), (102, 5))]
    switched = [("s", 100, made("hma", tower, out)) for tower, out in ((100, 5), (101, 12), (103, 20))]
    refused = ("s", 100, made("hma", 102, 0, REFUSED))
    row = effects([*plain, *switched, refused]).set_index("switch").loc["s"]
    assert row["n"] == 3 and row["refused"] == 1 and row["mean"] == pytest.approx(37 / 3)
    assert row["n_paired"] == 2 and row["difference"] == 2.5 and row["difference_std"] == pytest.approx(0.5)
    assert row["difference_low"] < 0.0 < row["difference_high"]


def test_the_command_says_what_it_would_play(tmp_path, capsys):
    assert main(["--plan", "--towers", "6", "--folder", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert f"0 of {6 * 5 * len((NONE, *IN_THESIS))} games are there" in said and "min of CPU time" in said
    assert main(["--plan", "--switches", "wobble", "--folder", str(tmp_path)]) == 2
    assert "known are none, " in capsys.readouterr().err


@pytest.mark.slow
def test_a_tiny_study_from_the_command_line(tmp_path, capsys):
    """Two blocks of one tower, rule and network, with and without a switch that changes nothing."""
    overlays, config, folder = tmp_path / "switches.yaml", tmp_path / "config.yaml", tmp_path / "games"
    overlays.write_text("nothing: {setup: {robot: {grasp_error: 0.0}}}")
    config.write_text("{seed: 1, chapter5: {setup: {collect: {reduced: true}}}}")
    arguments = ["--towers", "1", "--blocks", "2", "--size", "20", "--policies", "rule", "network"]
    arguments += ["--overlays", str(overlays), "--config", str(config), "--folder", str(folder)]
    assert main(arguments) == 0
    assert "nothing" in capsys.readouterr().out
    found = pd.read_csv(folder / "switch_effects.csv").set_index(["switch", "policy"])
    assert found.loc["nothing", "difference"].tolist() == [0.0, 0.0]
    times = {path: path.stat().st_mtime_ns for path in folder.rglob("games/*.json")}
    assert len(times) == 4 and main(arguments) == 0
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("games/*.json")} == times
