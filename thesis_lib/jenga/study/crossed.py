"""Leads of a learner over others, with every training set on every tower.

In the study game i uses training set i modulo their number, so that a lead and the luck of a set are not told apart.
Here each learner plays each tower once from each set.  Of the leads d_ts (extractions of one policy minus those of
another on tower t, both from set s) both kinds of luck are estimated, by the analysis of variance of T towers, S sets:

    Var(mean d) = (MS_T + MS_S − MS_E) / (T S),   at least MS_T / (T S) and MS_S / (T S)

with Student's t of Satterthwaite's degrees of freedom.  So the interval is of a new set on a new tower, not of these.

    python -m thesis_lib.jenga.study.crossed --plan         # how many games are missing, about how long they take
    python -m thesis_lib.jenga.study.crossed --towers 11    # plays them, then the table

Each game is a file of its own, so an interrupted run goes on where it was.

Source: Searle, Casella and McCulloch, Variance Components (1992), chapter 4, doi:10.1002/9780470316856.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.foundation.command_line import command
from thesis_lib.jenga.play.game import Game
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.study.study import games_table
from thesis_lib.jenga.study.switches import NONE, Study, configured, overlaid, study_parser

FOLDER = Path("results/chapter5/crossed")
POLICIES = ("hma", "mor", "network")  # the first is compared with the others
LEADS = ["policy", "size", "rival", "difference", "std", "low", "high", "towers", "sets", "std_tower", "std_set"]


def shifted(base: Chapter5) -> dict[str, Chapter5]:
    """Settings with which tower i uses training set i, i + 1, ... modulo their number: once each."""
    shifts = range(base.samples.sets)
    return {_name(shift): overlaid(base, {"samples": {"shift": shift}}, f"shift {shift}") for shift in shifts}


def crossed_games(games: Sequence[tuple[str, int, Game]], settings: Mapping[str, Chapter5]) -> pd.DataFrame:
    """A row per game, given as (key of `settings`, size, game): `study.games_table` and the column set."""
    parts = []
    for key, size, game in games:
        number = settings[key].samples.of_game(game.seed)
        parts.append(games_table([(size, game)]).assign(set=number))
    return pd.concat(parts, ignore_index=True).sort_values(["policy", "size", "tower", "set"], ignore_index=True)


def crossed_leads(games: pd.DataFrame, policy: str = POLICIES[0]) -> pd.DataFrame:
    """Lead of `policy` over each other policy in the table of `crossed_games`, on towers that all sets were played on.

    Columns policy, size, rival, difference, std, low, high, towers, sets, and standard deviations of a lead from tower
    to tower (std_tower) and from set to set (std_set), 0 where its variance comes out below 0.
    """
    counts = games.pivot_table(index=["size", "tower"], columns=["policy", "set"], values="extractions")
    rows = []
    for size, part in counts.groupby(level="size"):
        for rival in dict.fromkeys(name for name, _ in counts.columns if name != policy):
            apart = (part[policy] - part[rival]).dropna()
            if min(apart.shape) > 1:
                rows.append((policy, size, rival, *lead(apart.to_numpy())))
    return pd.DataFrame(rows, columns=LEADS)


def lead(d: np.ndarray) -> tuple[float, ...]:
    """Mean of leads d (T, S) with std, 95 % interval, T, S, std_tower and std_set; T and S are at least 2."""
    from scipy.special import stdtrit

    T, S = d.shape
    mean, of_tower, of_set = d.mean(), d.mean(axis=1), d.mean(axis=0)
    left = d - of_tower[:, None] - of_set + mean
    squares = np.array([S * np.var(of_tower, ddof=1), T * np.var(of_set, ddof=1), 0.0])
    freedom = np.array([T - 1, S - 1, (T - 1) * (S - 1)])
    squares[2] = np.sum(left**2) / freedom[2]
    both = float(squares @ [1.0, 1.0, -1.0])
    larger = int(np.argmax(squares[:2]))
    if both > squares[larger]:
        dof = both**2 / float(np.sum(squares**2 / freedom))
    else:
        both, dof = float(squares[larger]), float(freedom[larger])
    std = float(np.sqrt(both / (T * S)))
    half = float(stdtrit(dof, 0.975)) * std
    components = np.sqrt(np.maximum(squares[:2] - squares[2], 0.0) / [S, T])
    return float(mean), std, float(mean - half), float(mean + half), T, S, *map(float, components)


def _name(shift: int) -> str:
    return f"shift_{shift}" if shift else NONE


@command
def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit code."""
    options = study_parser(__doc__, "crossed", 11, FOLDER).parse_args(argv)
    base, seed = configured(options.config)
    study = Study(options.folder, shifted(base), seed, options.blocks)
    tasks = study.tasks(POLICIES, options.size, options.towers)
    if study.catch_up(tasks, "crossed", options.plan):
        games = crossed_games(study.games_of(tasks), study.settings)
        study.report({"crossed_leads": crossed_leads(games), "crossed_games": games})
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
