"""Tables of the proof: a row per dataset, per recovered parameter, per cell of equal datasets, and per miss.

The verdict on a dataset is right (`is_right`) if it is exact:

- nothing was hidden, and the verdict is `adequate`;
- the cause is outside the library, and the verdict is `unexplained`;
- one effect was hidden, and the verdict is `effects` with one group, which contains that effect;
- two effects were hidden (truth "a+b"), and the verdict is `effects` with two groups, one for each effect.

A refusal is wrong, and so is a group of more than `LARGEST_GROUP` effects.  Effects that the contact of the source has
by itself (`Case.by_itself`) are removed first; `effects` with nothing else then counts as `adequate`.

A named group is wrong (`wrong_names`) if it contains none of the hidden effects.

The misfit over its floor is the largest over the channels of the hidden effect: the error of impacts over the noise
floor, and the misfits of flights and gaps in units of noise, with floor 1.  (The covariance of gaps is conservative:
without hidden effects their misfit is below 1.)  If no effect is known, only impacts count.  The misfit of continuity
of the pose ("meet") is not stored.

| on paper           | in code                                 | unit | a row of    |                                |
|--------------------|-----------------------------------------|------|-------------|--------------------------------|
| E/E₀ before, after | `before_over_floor`, `after_over_floor` | 1    | `outcomes`  | base law; with effects found   |
| z                  | `z`                                     | 1    | `recovered` | (found − true) / std           |
| σ/σ_CR             | `width`                                 | 1    | `recovered` | std over the Cramér-Rao bound  |
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.effects import EFFECTS
from thesis_lib.statistics.intervals import Z95
from thesis_lib.studies.proof.cases import RATIO, SOURCES, Case
from thesis_lib.studies.proof.compute import VERDICTS, numbers_of_row, read_rows
from thesis_lib.studies.proof.store import NOTHING, STORE, Cells, groups_of, is_exact, numbers_of, share

KINDS = ("single", NOTHING, "pair", "outside")
# datasets of a cell differ only in the seed
CELL = ("source", "truth", "ratio", "drops", "noise", "shape", "contact_time")
OUTCOMES = (
    *(*CELL, "seed", "kind", "effect", "verdict", "named_first", "named", "group_size", "right", "wrong_names"),
    *("error_before", "error_after", "floor", "before_over_floor", "after_over_floor", "why"),
)
RECOVERED = (*CELL, "seed", "effect", "parameter", "true", "found", "std", "z", "inside", "width")
TABLE = {"ratio": RATIO, "drops": 150, "noise": 1.0}  # datasets of the summary; others are for the detection curves
MISFITS = ("error_before", "error_after", "floor", "before_over_floor", "after_over_floor")
CONFUSION = (
    *CELL,
    *("kind", "n", "right", "right_low", "right_high", "group_size", "named_first", "verdicts"),
    *MISFITS,
    *("n_parameters", "z", "coverage", "coverage_low", "coverage_high", "width"),
)
MISSES = ("source", "truth", "seed", "shape", "contact_time", "kind", "verdict", "named", "why")


def is_right(case: Case, verdict: str, groups: Sequence[Sequence[str]]) -> bool:
    """Return whether the verdict is exact, as defined in the module's docstring."""
    verdict, groups = _without_own(case, verdict, groups)
    return is_exact(verdict, case.expected, groups)


def wrong_names(case: Case, verdict: str, groups: Sequence[Sequence[str]]) -> int:
    """Return the number of named groups that contain none of the hidden effects."""
    hidden = {name for names in case.expected for name in names}
    return sum(not hidden & set(group) for group in _without_own(case, verdict, groups)[1])


def _without_own(case: Case, verdict: str, groups: Sequence[Sequence[str]]) -> tuple[str, Sequence[Sequence[str]]]:
    """Verdict and groups without effects that the contact of the source has by itself."""
    others = [group for group in groups if not set(group) & set(case.by_itself)]
    alone = verdict == "effects" and len(groups) > 0 and not others
    return ("adequate" if alone else verdict), others


def outcomes(store: Path = STORE) -> pd.DataFrame:
    """A row per stored dataset, columns `OUTCOMES`, sorted; missing group_size and misfits are NaN.

    `effect` is the effect that describes a single truth best, "" if there is none.  `named` joins effects of a group by
    "/" and groups by " + ".  `group_size` is the mean over groups.  This function and its callers raise
    CorruptFileError if a stored result cannot be read.
    """
    rows = [_outcome(case, row) for source in SOURCES for case, row in read_rows(source, store).items()]
    return _sorted(pd.DataFrame(rows, columns=list(OUTCOMES)), ["source", "kind", *CELL[1:], "seed"])


def recovered(store: Path = STORE) -> pd.DataFrame:
    """A row per parameter that has a true value, in models that contain the hidden effect; columns `RECOVERED`."""
    rows = [
        _cell(case) | {"effect": case.truth, "parameter": name} | _deviation(*values)
        for source in SOURCES
        for case, row in read_rows(source, store).items()
        for name, values in numbers_of(row["parameters"]).items()
        if values[2] > 0.0
    ]
    return _sorted(pd.DataFrame(rows, columns=list(RECOVERED)), [*CELL, "seed", "parameter"])


def _deviation(true: float, found: float, std: float, fisher: float) -> dict:
    off, width = found - true, std / fisher if fisher else np.nan
    inside = abs(off) <= Z95 * std
    return {"true": true, "found": found, "std": std, "z": off / std, "inside": inside, "width": width}


def _sorted(table: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    orders = {"source": SOURCES, "kind": KINDS}

    def rank(column: pd.Series) -> pd.Series:
        return column.map(orders[str(column.name)].index) if column.name in orders else column

    return table.sort_values(by, key=rank, ignore_index=True)


def _cell(case: Case) -> dict:
    return {key: getattr(case, key) for key in (*CELL, "seed")}


def _outcome(case: Case, row: Cells) -> dict:
    groups, numbers = groups_of(row["named"]), numbers_of_row(row)
    effects = case.expected[0] if case.kind == "single" else ()
    sizes = [len(group) for group in _without_own(case, row["verdict"], groups)[1]]
    outcome = _cell(case) | {name: row[name] for name in ("verdict", "named", "why")}
    outcome |= {"kind": case.kind, "effect": effects[0] if effects else "", "floor": numbers["floor"]}
    outcome |= {"named_first": groups[0][0] if groups else "", "group_size": float(np.mean(sizes)) if sizes else np.nan}
    judged = (("right", is_right), ("wrong_names", wrong_names))
    outcome |= {name: judge(case, row["verdict"], groups) for name, judge in judged}
    for when, which in (("before", "base"), ("after", "augmented")):
        outcome |= {f"error_{when}": numbers[which], f"{when}_over_floor": _misfit(numbers, effects, which)}
    return outcome


def _misfit(numbers: Mapping[str, float], effects: Sequence[str], when: str) -> float:
    """The largest misfit over its floor in the channels of `effects`; NaN if unknown."""
    channels = {channel for name in effects for channel in EFFECTS[name].channels} or {"impact"}
    floor = numbers["floor"]
    over_floor = {name: numbers[f"{name}_{when}"] for name in ("flight", "touch")}
    over_floor["impact"] = numbers[when] / floor if floor else np.nan
    return max((v for name, v in over_floor.items() if name in channels and np.isfinite(v)), default=np.nan)


def usual(table: pd.DataFrame) -> pd.DataFrame:
    """Rows with the shape and contact time that cases of their source and truth have by default."""
    cells = table[["source", "truth", "shape", "contact_time"]].drop_duplicates()
    keep = [
        Case(s, t, 0, shape=shape, contact_time=time).is_usual for s, t, shape, time in cells.itertuples(index=False)
    ]
    return table.merge(cells[keep], how="inner") if len(table) else table


def of_table(table: pd.DataFrame, **changes: float) -> pd.DataFrame:
    """Rows with the ratio, number of drops and noise of `TABLE`, where `changes` do not replace them."""
    keep = np.ones(len(table), bool)
    for key, value in (TABLE | changes).items():
        keep &= (table[key] == value).to_numpy()
    return table[keep]


def confusion(store: Path = STORE) -> pd.DataFrame:
    """A row per cell of equal datasets: shares with Wilson's intervals, medians of misfits, |z| and widths."""
    datasets, parameters = outcomes(store), recovered(store)
    by_cell = dict(list(parameters.groupby(list(CELL)))) if len(parameters) else {}
    rows = []
    for cell, group in datasets.groupby(list(CELL), sort=False):
        values = by_cell.get(cell, parameters.iloc[:0])
        row = dict(zip(CELL, cell)) | {name: group[name].median() for name in MISFITS}
        row |= {"kind": group["kind"].iloc[0], "n": len(group), "group_size": group["group_size"].mean()}
        row |= dict(zip(("right", "right_low", "right_high"), share(group["right"]).values()))
        row["named_first"] = _counts(group.loc[group["named_first"] != "", "named_first"])
        row["verdicts"] = _counts(group["verdict"], VERDICTS)
        row |= {"n_parameters": len(values), "z": values["z"].abs().median(), "width": values["width"].median()}
        row |= dict(zip(("coverage", "coverage_low", "coverage_high"), share(values["inside"]).values()))
        rows.append(row)
    return pd.DataFrame(rows, columns=list(CONFUSION))


def _counts(values: pd.Series, order: Sequence[str] | None = None) -> str:
    """Counts as text, "a:3;b:1", the most frequent first, or in `order`."""
    counts = values.value_counts()
    names = sorted(counts.index, key=lambda name: (-counts[name], name))
    names = [name for name in order if name in counts.index] if order else names
    return ";".join(f"{name}:{counts[name]}" for name in names)


def misses(store: Path = STORE) -> pd.DataFrame:
    """Every dataset of `TABLE` with a wrong verdict; columns `MISSES`."""
    datasets = of_table(outcomes(store))
    return datasets.loc[~datasets["right"].astype(bool), list(MISSES)].reset_index(drop=True)
