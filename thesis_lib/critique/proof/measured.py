"""The critique of measured sets, stored: verdict, effects, errors, and whether what is left could be explained at all.

    python -m thesis_lib.critique.proof.measured run data/measured/planar_dice --trials 150 --single
    python -m thesis_lib.critique.proof.measured table

`run` adds or replaces a row of config/proof/measured.csv.  CI does not run it: the sets are not part of this project.

| column                     | unit | meaning                                                                    |
|----------------------------|------|----------------------------------------------------------------------------|
| dataset, trials, hits      |      | the set, trials with usable hits, and `all` or `single` hits               |
| detected, used             | 1    | hits                                                                       |
| verdict, effects           |      | effects in the order of selection, "~" before a stand-in                   |
| chosen                     |      | `searched`, or `by hand`                                                   |
| base, error, noise_floor   | m/s  | held-out error before and with the effects, and of noise, empty if unknown |
| median                     | m/s  | of the held-out errors with the effects                                    |
| learned, low, high         | m/s  | `questions.floor` of held-out single hits: `learned`, `gain`               |
| max_effects                | 1    | most that the search could name                                            |
| code, made                 |      | hash of the code that made the row, empty: unknown; date                   |
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.questions.floor import floor
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.command_line import command, run_or_table
from thesis_lib.foundation.markdown import table as markdown
from thesis_lib.foundation.progress import Progress
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import STAMP, Rows, by_cells, stamp
from thesis_lib.statistics.wording import number

if TYPE_CHECKING:
    import pandas as pd

KEY = ("dataset", "trials", "hits", "chosen")  # and the effects, where these were chosen by hand
COLUMNS = (
    *(*KEY, "detected", "used", "verdict", "effects", "base", "error", "median", "noise_floor"),
    *("learned", "low", "high", "max_effects", *STAMP),
)
PATH = Path(__file__).resolve().parents[3] / "config" / "proof" / "measured.csv"
ORDER = by_cells(*KEY, "effects")
STORE = Rows(PATH, COLUMNS, KEY, "python -m thesis_lib.critique.proof.measured run", digits=6, order=ORDER)
MOST_EFFECTS = 10  # a rig that nobody made for this has more than four faults
SEED = 0
_SEEN = {"planar_impact": "ellipse", "planar_dice": "dice"}


def row(critique: DropsCritique, hits: str, chosen: str) -> dict:
    """The row of a critique."""
    (_, _, before), (_, fitted, after) = critique.ladder[0], critique.ladder[-1]
    o, stand_ins = critique.observations, critique.stand_ins
    names = [step.effect.name for step in critique.discovery.steps if step.clears or chosen != "searched"]
    rest = floor(fitted, critique.held_out, generator(SEED, "floor"))
    return {
        "dataset": critique.dataset,
        "trials": len(np.unique(o.trial)),
        "hits": hits,
        "chosen": chosen,
        "detected": int(o.hits.sum()) + len(o.found.left_out),
        "used": int(o.hits.sum()),
        "verdict": critique.verdict,
        "effects": " + ".join(f"{'~' * (name in stand_ins)}{name}" for name in names),
        "base": float(before.error.mean()),
        "error": float(after.error.mean()),
        "median": float(np.median(after.error)),
        "noise_floor": after.floor,
        "learned": rest.learned,
        "low": rest.gain[1],
        "high": rest.gain[2],
        "max_effects": critique.settings.max_effects,
        **stamp(__file__),
    }


def store(new: dict, rows: Rows = STORE) -> None:
    """Add a row, or replace that of the same key; chosen by hand, also of the same effects."""
    by_hand = () if new["chosen"] == "searched" else ("effects",)
    replace(rows, key=(*KEY, *by_hand)).put(new)


def table(path: Path = PATH) -> str:
    """The stored rows as Markdown."""
    import pandas as pd

    head = ("set", "hits used", "effects", "verdict", "before", "after (median)", "noise", "with the rest learned")
    return markdown(head, [_line(one) for _, one in pd.read_csv(path).iterrows()])


def _line(one: "pd.Series") -> tuple[str, ...]:
    titles = "; ".join(
        f"{EFFECTS[name.lstrip('~')].title}{' (a stand-in)' * name.startswith('~')}"
        for name in str(one["effects"]).split(" + ")
    )
    return (
        f"{_SEEN.get(one['dataset'], one['dataset'])}, {one['trials']} trials",
        f"{100 * one['used'] / one['detected']:.0f} % of {one['detected']:,}",
        titles + ("" if one["chosen"] == "searched" else " (chosen by hand)"),
        one["verdict"],
        number(one["base"]),
        f"{number(one['error'])} ({number(one['median'])})",
        "unknown" if np.isnan(one["noise_floor"]) else number(one["noise_floor"], 2),
        number(one["learned"]),
    )


@command
def main(argv: Sequence[str] | None = None) -> int:
    prog, how = "python -m thesis_lib.critique.proof.measured", "criticise a measured set and store its row"
    parser, _, run = run_or_table(prog, __doc__ or "", how, "print the stored rows")
    run.add_argument("folder")
    run.add_argument("--trials", type=int, help="the first ones; default: all")
    run.add_argument("--single", action="store_true", help="single hits only, no episodes")
    run.add_argument("--effects", default="", help="to switch on by hand, with commas, instead of the search")
    args = parser.parse_args(argv)
    if args.command == "table":
        print(table())
        return 0
    from thesis_lib.datasets.read import read_dataset

    dataset = read_dataset(args.folder).first_trials(args.trials)
    settings = CritiqueSettings(episodes=not args.single, max_effects=MOST_EFFECTS)
    by_hand = list(filter(None, args.effects.split(","))) or None
    with Progress(dataset.name) as say:
        own = generator(SEED, dataset.name)
        critique = criticise_drops(dataset, rng=own, settings=settings, effects=by_hand, say=say)
    new = row(critique, "single" if args.single else "all", "by hand" if by_hand else "searched")
    store(new)
    print("\n".join(f"{name}: {value}" for name, value in new.items()))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
