"""What differences between the thesis's set-up and ours do to the games: one switch at a time.

A switch is an overlay of `chapter5` in config/chapter5_switches.yaml.  With each, training samples are collected anew,
learners are fitted to them, and every policy plays the same towers as without it ("none", the games of the study):

    effect of a switch on a policy = mean over towers of (extractions with it − extractions without it)

with Student's t interval over towers.  Blocks come in the same order with the same noise, and learners are fitted with
the same random numbers, so that "none" gives the games of `snakemake chapter5` again, and so does a switch that does
nothing.  Each set of samples and each game is a file of its own; what is there is not made again.

    python -m thesis_lib.jenga.study.switches --plan                          # how many games, about how long
    python -m thesis_lib.jenga.study.switches --towers 6                      # plays what is missing, then the table
    python -m thesis_lib.jenga.study.switches --switches none exact_states    # for a second terminal, the others there

Overlays to choose from are tried on development towers in the same way (switch_success.csv: shares of figure 5-6):

    python -m thesis_lib.jenga.study.switches --first 0 --towers 5 --policies exploration --overlays FILE --folder DIR
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from thesis_lib.foundation.command_line import Parser, command
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_json, write_json, write_result
from thesis_lib.foundation.progress import Progress, duration
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.settings import merged
from thesis_lib.foundation.yaml_file import read_yaml
from thesis_lib.jenga.play.game import Game, play, read_game, write_game
from thesis_lib.jenga.play.players import LEARNS_AS, policy_of
from thesis_lib.jenga.play.policies import Policy
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.robot.samples import PushSamples, read_samples, write_samples
from thesis_lib.jenga.study.collect import collect_named
from thesis_lib.jenga.study.study import games_table, success_table
from thesis_lib.statistics.intervals import mean_row

NONE = "none"
SWITCHES = Path("config/chapter5_switches.yaml")
CONFIG = Path("config/config.yaml")
FOLDER = Path("results/chapter5/switches")
POLICIES = ("hma", "mor", "network", "rule", "exploration")
FIXED = ("rule", "always_push", "exploration", "oracle")  # without training
GAME, SAMPLE = 70.0, 0.25  # s of CPU time that a whole game and a sample took when this was written


class GameTask(NamedTuple):
    """A game to be played: the switch, who plays, from how many samples (0: does not learn), on which tower."""

    switch: str
    policy: str
    size: int
    tower: int


@dataclass(frozen=True)
class Study:
    """Games of one folder.

    settings: of each switch, without it under `NONE`.  seed: of the configuration.  blocks: tried in a game.
    """

    folder: Path
    settings: Mapping[str, Chapter5]
    seed: int
    blocks: int

    def tasks(self, policies: Sequence[str], size: int, towers: int, first: int | None = None) -> list[GameTask]:
        """All games, tower by tower, so that an interrupted study compares what it has on the same towers.

        first: seed of the first tower, by default of the first test tower.
        """
        first = self.settings[NONE].towers.first_test if first is None else first
        return [
            GameTask(switch, policy, 0 if policy in FIXED else size, first + i)
            for i in range(towers)
            for switch in self.settings
            for policy in policies
        ]

    def path(self, task: GameTask) -> Path:
        """The file of a game."""
        return self.folder / task.switch / "games" / f"{task.policy}_{task.size}_{task.tower}.json"

    def missing(self, tasks: Sequence[GameTask]) -> list[GameTask]:
        """Games that have not been played."""
        return [task for task in tasks if not self.path(task).is_file()]

    def run(self, tasks: Sequence[GameTask], say: Callable[[str], None] = lambda _: None) -> None:
        """Play the games that are missing; UserError if those that are there were played with other settings."""
        self._check(tasks)
        missing = self.missing(tasks)
        learned: dict[tuple, Policy] = {}
        for i, task in enumerate(missing):
            say(f"game {i} of {len(missing)}, {task.policy} with {task.switch} on tower {task.tower}")
            # all games of a set have the very same learner
            key = (task.switch, task.policy, task.size, self._set(task) if task.size else 0)
            if key not in learned:
                learned[key] = self.policy(task)
            self.play(task, learned[key])

    def catch_up(self, tasks: Sequence[GameTask], name: str, plan: bool) -> bool:
        """Say how many games are missing and about how long they take, and play them unless that is all that is asked.

        False if they were not played.
        """
        missing = self.missing(tasks)
        about = duration(self.seconds(missing))
        there = f"{len(tasks) - len(missing)} of {len(tasks)} games are there"
        print(f"{there}; the others take about {about} of CPU time", flush=True)
        if not plan:
            with Progress(name) as say:
                self.run(tasks, say)
        return not plan

    def _check(self, tasks: Sequence[GameTask]) -> None:
        for switch in dict.fromkeys(task.switch for task in tasks):
            names = ("setup", "learner", "play", "towers", "samples")
            now = {name: getattr(self.settings[switch], name).model_dump(mode="json") for name in names}
            now |= {"seed": self.seed, "blocks": self.blocks}
            path = self.folder / switch / "settings.json"
            if path.is_file() and read_json(path) != now:
                raise UserError(f"the games of {path.parent} were played with other settings: move that folder away.")
            write_json(now, path)

    def seconds(self, tasks: Sequence[GameTask]) -> float:
        """About how long these games and their samples will take, from what they took when this was written."""
        sets = {(task.switch, self._set(task)): task.size for task in tasks if task.size}
        samples = sum(size for key, size in sets.items() if not self._samples_path(*key, size).is_file())
        return SAMPLE * samples + GAME * self.blocks / 45.0 * len(tasks)

    def play(self, task: GameTask, policy: Policy | None = None) -> Game:
        """Play a game and write its file."""
        settings = self.settings[task.switch]
        policy = policy or self.policy(task)
        game = play(task.tower, policy, settings.setup, self.seed, blocks=self.blocks)
        write_game(game, self.path(task))
        return game

    def policy(self, task: GameTask) -> Policy:
        """Who plays a game, fitted as in `workflow/scripts/chapter5/ch5_game.py`."""
        number = self._set(task)
        learned_from = [f"results/chapter5/samples/set_{number}.csv"] if task.size else []
        samples = self.samples(task.switch, number, task.size) if task.size else None
        # keyed as there, whatever the switch: the same samples give the same learner
        learns = LEARNS_AS.get(task.policy, task.policy)
        rng = generator(self.seed, "ch5_game", learns, str(task.size), *learned_from)
        return policy_of(task.policy, samples, task.size, self.settings[task.switch], rng)

    def samples(self, switch: str, number: int, size: int) -> PushSamples:
        """The training set of this number with a switch, collected if there is none."""
        path = self._samples_path(switch, number, size)
        if not path.is_file():
            settings = self.settings[switch]
            name = f"set_{number}"
            found, attempts = collect_named(name, size, settings.setup, settings.towers, settings.samples, self.seed)
            write_result(attempts, path.with_name(f"{path.stem}_attempts.csv"))
            write_samples(found, path)
        return read_samples(path)

    def games_of(self, tasks: Sequence[GameTask]) -> list[tuple[str, int, Game]]:
        """(switch, size, game) of the games that have been played."""
        return [(task.switch, task.size, read_game(self.path(task))) for task in tasks if self.path(task).is_file()]

    def report(self, tables: Mapping[str, pd.DataFrame]) -> None:
        """Write tables of the games by their names, and print the first."""
        for name, table in tables.items():
            write_result(table, self.folder / f"{name}.csv")
        shown = next(iter(tables.values()))
        print(shown.to_string(index=False, na_rep="", float_format="{:.1f}".format))
        print(f"tables: {self.folder}/{'.csv, '.join(tables)}.csv", file=sys.stderr)

    def _set(self, task: GameTask) -> int:
        return self.settings[task.switch].samples.of_game(task.tower)

    def _samples_path(self, switch: str, number: int, size: int) -> Path:
        return self.folder / switch / "samples" / f"set_{number}_{size}.csv"


def configured(path: str | Path) -> tuple[Chapter5, int]:
    """Settings of chapter 5 and the seed of a configuration; UserError without a seed."""
    document = read_yaml(path).content or {}
    if "seed" not in document:
        raise UserError(f"{path} has no seed.")
    return overlaid(Chapter5(), document.get("chapter5") or {}, str(path)), int(document["seed"])


def read_switches(path: str | Path, base: Chapter5) -> dict[str, Chapter5]:
    """Settings without a switch (`NONE`) and with each switch of a file; UserError for keys that do not exist."""
    document = read_yaml(path)
    document.refuse_repeated(path)
    if not isinstance(document.content, dict) or NONE in document.content:
        raise UserError(f"{path} must hold `switch: {{section: {{key: value}}}}`, and none called {NONE}.")
    return {NONE: base} | {name: overlaid(base, values, f"{path}, {name}") for name, values in document.content.items()}


def overlaid(base: Chapter5, values: Mapping[str, Any], where: str) -> Chapter5:
    """Settings with some values replaced; UserError that begins with `where` if they are none of chapter 5's."""
    try:
        return Chapter5.model_validate(merged(base.model_dump(), values))
    except ValueError as error:
        raise UserError(f"{where}: {error}") from error


def effects(games: Sequence[tuple[str, int, Game]]) -> pd.DataFrame:
    """A row per switch and policy, of games given as (switch, size, game).

    Columns switch, policy, size, mean, std (standard error), low, high, n, refused; and against the games without a
    switch on the same towers: difference, difference_std, difference_low, difference_high, n_paired.
    """
    table = pd.concat([games_table([(size, game)]).assign(switch=switch) for switch, size, game in games])
    rows = []
    keys = ["switch", "policy", "size"]
    for (switch, policy, size), part in table.groupby(keys, sort=False):
        counts = part.set_index("tower")["extractions"].dropna()
        if counts.empty:
            continue
        plain = table[(table["switch"] == NONE) & (table["policy"] == policy) & (table["size"] == size)]
        apart = (counts - plain.set_index("tower")["extractions"]).dropna().to_numpy()
        paired = mean_row(apart) if switch != NONE and len(apart) else [np.nan] * 5
        rows.append((switch, policy, size, *mean_row(counts.to_numpy()), part["refused"].sum(), *paired))
    names = [*keys, "mean", "std", "low", "high", "n", "refused"]
    names += ["difference", "difference_std", "difference_low", "difference_high", "n_paired"]
    return pd.DataFrame(rows, columns=names)


def successes(games: Sequence[tuple[str, int, Game]]) -> pd.DataFrame:
    """`study.success_table` (figure 5-6) of each switch: column switch, then the columns there."""
    parts = []
    for switch in dict.fromkeys(switch for switch, _, _ in games):
        own = [(size, game) for name, size, game in games if name == switch and not game.refused]
        if not own:
            continue
        attempts = pd.concat([game.table().assign(size=size) for size, game in own], ignore_index=True)
        shown = max((size for size, game in own if game.policy == "hma"), default=0)
        found = success_table(attempts, shown)
        parts.append(found[found["attempts"] > 0].assign(switch=switch))
    table = pd.concat(parts, ignore_index=True)
    return table[["switch", *(name for name in table.columns if name != "switch")]]


@command
def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit code."""
    parser = study_parser(__doc__, "switches", 6, FOLDER)
    parser.add_argument("--first", type=int, help="seed of the first tower (the first test tower)")
    parser.add_argument("--policies", nargs="+", default=POLICIES, help=f"who plays ({' '.join(POLICIES)})")
    parser.add_argument("--switches", nargs="+", help=f"switches to play, {NONE} among them (all)")
    parser.add_argument("--overlays", type=Path, default=SWITCHES, help="file of the switches (%(default)s)")
    options = parser.parse_args(argv)
    base, seed = configured(options.config)
    known = read_switches(options.overlays, base)
    if unknown := [name for name in options.switches or () if name not in known]:
        raise UserError(f"there is no switch {unknown[0]} in {options.overlays}; known are {', '.join(known)}.")
    study = Study(options.folder, known, seed, options.blocks)
    tasks = study.tasks(options.policies, options.size, options.towers, options.first)
    mine = [task for task in tasks if task.switch in (options.switches or known)]
    if study.catch_up(mine, "switches", options.plan):
        games = study.games_of(tasks)
        study.report({"switch_effects": effects(games), "switch_success": successes(games)})
    return 0


def study_parser(about: str | None, name: str, towers: int, folder: Path) -> Parser:
    """The parser of a command that plays the games of a study, by default on so many test towers."""
    parser = Parser(prog=f"python -m thesis_lib.jenga.study.{name}", description=about)
    parser.add_argument("--plan", action="store_true", help="only say how many games are missing and what they take")
    parser.add_argument("--towers", type=int, default=towers, help="test towers, the same for all (%(default)s)")
    parser.add_argument("--size", type=int, default=100, help="samples that learners learn from (%(default)s)")
    parser.add_argument("--blocks", type=int, default=45, help="blocks tried in a game (%(default)s)")
    parser.add_argument("--config", type=Path, default=CONFIG, help="seed and settings (%(default)s)")
    parser.add_argument("--folder", type=Path, default=folder, help="of games and tables (%(default)s)")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
