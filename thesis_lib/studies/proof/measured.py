"""Stored critiques of measured sets: verdict, effects, errors, and whether the remaining error could be explained.

    python -m thesis_lib.studies.proof measured run data/measured/planar_dice --trials 150 --single
    python -m thesis_lib.studies.proof measured table

`run` adds or replaces a row of config/proof/measured.csv.  CI does not run it: the sets are not part of this project.

| column                     | unit | meaning                                                                    |
|----------------------------|------|----------------------------------------------------------------------------|
| dataset, trials, hits      |      | the set, trials with usable hits, and `all` or `single` hits               |
| detected, used             | 1    | number of hits                                                             |
| verdict, effects           |      | effects in the order of selection; "~" marks a stand-in (confounder)       |
| chosen                     |      | how effects were chosen: `searched`, or `by hand`                          |
| base, error, noise_floor   | m/s  | held-out error without and with the effects, and of noise; empty: unknown  |
| median                     | m/s  | of the held-out errors with the effects                                    |
| learned, low, high         | m/s  | `questions.floor` of held-out single hits: `learned`, `gain`; plane only   |
| max_effects                | 1    | largest number of effects that the search could name                       |
| code, made                 |      | hash of the code that made the row, empty: unknown; date                   |
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.questions.floor import floor
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.sources.along_throws import along_throws, hidden_drift
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.markdown import table
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import Rows, by_cells
from thesis_lib.statistics.wording import number
from thesis_lib.studies.proof.store import stamped, stored

KEY = ("dataset", "trials", "hits", "chosen")  # if effects were chosen by hand, they also belong to the key
FOUND = (
    *("detected", "used", "verdict", "effects", "base", "error", "median", "noise_floor"),
    *("learned", "low", "high", "max_effects"),
)
ROWS = stored("measured", KEY, FOUND, "measured run", digits=6, order=by_cells(*KEY, "effects"))
MOST_EFFECTS = 10  # a rig that was not built for the critique deviates in more than four ways
SEED = 0
_SEEN = {"planar_impact": "ellipse", "planar_dice": "dice", "contactnets_cube": "cube"}


def row(critique: DropsCritique, hits: str, chosen: str) -> dict:
    """The row of the table for a critique."""
    (_, _, before), (_, fitted, after) = critique.ladder[0], critique.ladder[-1]
    o, stand_ins = critique.observations, critique.stand_ins
    names = [step.effect.name for step in critique.discovery.steps if step.clears or chosen != "searched"]
    rest = floor(fitted, critique.held_out, generator(SEED, "floor")) if critique.space.is_plane else None
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
        **({"learned": rest.learned, "low": rest.gain[1], "high": rest.gain[2]} if rest else {}),
        "max_effects": critique.settings.max_effects,
    }


def store(new: dict, rows: Rows = ROWS) -> None:
    """Add a row, or replace the row with the same key (and, if chosen by hand, the same effects)."""
    by_hand = () if new["chosen"] == "searched" else ("effects",)
    replace(rows, key=(*KEY, *by_hand)).put(stamped(new, row))


def compute(dataset: Dataset, say: Callable[[str], None], single: bool = False, effects: str = "") -> None:
    """Criticise a measured set, with all hits or `single` ones, and store its row.

    `effects`, separated by commas, are switched on instead of a search.
    """
    most = MOST_EFFECTS if dataset.space.is_plane else None  # in space the library's default
    settings = CritiqueSettings(episodes=not single, max_effects=most)
    if not dataset.space.is_plane and hidden_drift(dataset):
        dataset = along_throws(dataset)
    by_hand = list(filter(None, effects.split(","))) or None
    own = generator(SEED, dataset.name)
    critique = criticise_drops(dataset, rng=own, settings=settings, effects=by_hand, say=say)
    store(row(critique, "single" if single else "all", "by hand" if by_hand else "searched"))


def as_markdown(rows: Rows = ROWS) -> str:
    """The stored rows as Markdown."""
    head = ("set", "hits used", "effects", "verdict", "before", "after (median)", "noise", "with the rest learned")
    return table(head, [_line(one) for _, one in pd.read_csv(rows.path).iterrows()])


def _line(one: pd.Series) -> tuple[str, ...]:
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
        "" if np.isnan(one["learned"]) else number(one["learned"]),
    )
