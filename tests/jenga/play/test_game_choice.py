"""Which games a study plays: every policy at its sizes, on the towers that it shares with those it is compared with."""

from pathlib import Path

import pytest

from thesis_lib.jenga.play.settings import GameChoice
from thesis_lib.thesis.config import read_config

ROOT = Path(__file__).resolve().parents[3]
SMALL = {"learners": ["hma", "network"], "sizes": [50, 100], "ablations": ["hma_one_shot"], "ppo_sizes": [1000]}


def test_every_policy_plays_as_many_towers_as_its_kind():
    choice = GameChoice(towers=2, learner_towers=4, paired_towers=6, fixed=["exploration", "rule", "oracle"], **SMALL)
    assert choice.played() == {
        **{("hma", 50): 4, ("network", 50): 4, ("hma_one_shot", 100): 4},
        **{("hma", 100): 6, ("network", 100): 6, ("exploration", 0): 6, ("rule", 0): 6},
        **{("ppo", 1000): 2, ("oracle", 0): 2},
    }


def test_no_policy_plays_fewer_towers_than_all():
    choice = GameChoice(towers=5, learner_towers=3, fixed=["rule"], **SMALL)
    assert set(choice.played().values()) == {5}


@pytest.mark.parametrize("path", sorted((ROOT / "config/chapter5_switches").iterdir()), ids=lambda path: path.stem)
def test_each_switch_of_the_set_up_changes_the_study_and_nothing_else(path):
    study = ROOT / "config/chapter5_study.yaml"
    with_it, without = (read_config(study, *more).model_dump() for more in ([path], []))
    assert with_it.pop("chapter5") != without.pop("chapter5") and with_it == without
