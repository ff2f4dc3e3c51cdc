"""Stored comparison of laws and engines on measured sets: a row for each model without and with the named effects.

The table is config/proof/models_measured.csv; CI does not compute it, since the sets are not part of this project.
Columns are those of `compare.COLUMNS`, rounded, and those of whole tosses, after

| column  | unit | meaning                                       |
|---------|------|-----------------------------------------------|
| dataset |      | the measured set                              |
| trials  | 1    | number of trials compared, the first ones     |
| named   |      | effects that the critique named, joined by +  |

and before `STAMP` of `foundation.rows`.  If a set's tosses were recorded in randomly rotated axes, each toss is first
rotated to align the directions of the throws, as in the pipeline (`hidden_drift`, `along_throws`).
"""

from collections.abc import Callable

import numpy as np

from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.engines.compare import LAWS, OF_TOSSES, compare_models, row_title
from thesis_lib.critique.results.titles import effect_title
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.sources.along_throws import along_throws, hidden_drift
from thesis_lib.foundation.markdown import table
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import STAMP, Rows
from thesis_lib.statistics.wording import number
from thesis_lib.studies.proof.engines import ENGINES
from thesis_lib.studies.proof.store import COMMAND, STORE, stamped, with_effects

KEY = ("dataset", "effects", "model", "kind")
ROUNDED = (
    *("mu", "mu_std", "epsilon", "epsilon_std", "contact_time", "error", "error_low", "error_high"),
    *("behind", "behind_low", "behind_high", "noise_floor"),
    *(f"{name}{end}" for name in OF_TOSSES for end in ("", "_low", "_high")),
)
COLUMNS = ("dataset", "trials", "named", "model", "kind", "effects", "lacks", *ROUNDED, *STAMP)
ROWS = Rows(STORE / "models_measured.csv", COLUMNS, KEY, f"{COMMAND} measured-models run", digits=4)


def compute(dataset: Dataset, say: Callable[[str], None], effects: str = "", store: Rows = ROWS) -> None:
    """Criticise a measured set, compare laws and engines on it, and store the rows; `effects`, separated by commas, are
    switched on by hand."""
    if not dataset.space.is_plane and hidden_drift(dataset):
        dataset = along_throws(dataset)
    chosen = [name for name in effects.split(",") if name] or None
    critique = criticise_drops(dataset, rng=generator(0, dataset.name), effects=chosen, say=say)
    about = {"dataset": dataset.name, "trials": len(np.unique(critique.observations.trial))}
    about |= {"named": with_effects(critique)}
    for one in compare_models(critique, (LAWS, *ENGINES), say).to_dict("records"):
        store.put(stamped({**about, **{str(name): value for name, value in one.items()}}, compute))


def as_markdown(store: Rows = ROWS, planar: bool = True) -> str:
    """The stored rows of planar sets, or of sets in space, as a Markdown table; the best model first."""
    head = ("set", "model", "effects", "held-out error (m/s), 95 %", "noise", "μ", "ε", "contact", "cannot have")
    lines, rows = [], store.table()
    rows = rows[(rows["position"].astype(str) == "") == planar]
    if rows.empty:
        return f"None is compared yet: `{ROWS.command} DATA`."
    if not planar:
        head = (*head[:5], "tosses: position, %", "angle, °", *head[5:])
    for (name, trials), part in rows.groupby(["dataset", "trials"], sort=False):
        for row in part.sort_values("error").to_dict("records"):
            lacks = ", ".join(effect_title(effect) for effect in row["lacks"].split(" + ")) if row["lacks"] else ""
            lasting = f"{1e3 * round(float(row['contact_time']), 7):.3g} ms" if row["contact_time"] != "" else ""
            error = f"{number(row['error'])} ({number(row['error_low'])} to {number(row['error_high'])})"
            floor = number(float(row["noise_floor"])) if row["noise_floor"] != "" else "unknown"
            cells = (f"{name}, {trials}", row_title(row), row["effects"], error, floor)
            cells += () if planar else (number(float(row["position"])), number(float(row["angle"])))
            lines.append((*cells, f"{row['mu']:.3f}", f"{row['epsilon']:.3f}", lasting, lacks))
    if not any(line[-1] for line in lines):
        head, lines = head[:-1], [line[:-1] for line in lines]
    return table(head, lines)
