"""The proof in contacts of realistic duration: right verdicts by source, shape and contact time, against the targets.

`python -m thesis_lib.studies.proof contacts` prints `as_markdown`, a table that docs/findings.md contains.

Only parameters with a true value count.  Shares have 95 % Wilson intervals.
"""

import numpy as np
import pandas as pd

from thesis_lib.foundation.markdown import table as markdown
from thesis_lib.statistics.intervals import Z95
from thesis_lib.studies.proof.cases import FRESH, RIGID
from thesis_lib.studies.proof.results import of_table, usual
from thesis_lib.studies.proof.store import NOTHING, share

# figure, kind of the datasets, number of drops, required share
ASKED = (
    ("nothing hidden: adequate", NOTHING, 150, 0.95),
    ("one cause, named alone", "single", 150, 0.90),
    ("both of a pair, and nothing else", "pair", 150, 0.80),
    ("outside the library: unexplained", "outside", 150, 0.80),
    ("one cause, named alone, 50 drops", "single", 50, 0.75),
)
COVERED = "parameter inside its 95 % interval"
SHORT = ("nothing hidden", "one cause", "pair", "outside", "50 drops", "parameter")  # the figures as heads of columns
COVERAGE = (0.90, 0.98)
PLACE = ("source", "shape", "contact_time")
CONTACTS = ("figure", *PLACE, "at_least", "share", "low", "high", "n", "met")
EVERY = "all"  # stands for all sources or shapes; an empty contact time stands for all contact times


def by_contact(outcomes: pd.DataFrame, recovered: pd.DataFrame) -> pd.DataFrame:
    """A row per figure, source, shape and contact time with results, and rows of totals; columns `CONTACTS`.

    `outcomes` and `recovered` come from `results`; datasets of the first table of the proof do not count.
    """
    parts = [
        (figure, _real(of_table(outcomes, drops=drops)).query("kind == @kind"), "right", (asked, 1.0))
        for figure, kind, drops, asked in ASKED
    ]
    parts.append((COVERED, _real(of_table(recovered)), "inside", COVERAGE))
    rows = []
    for figure, table, measure, asked in parts:
        if len(table):
            rows.append(_row(figure, (EVERY, EVERY, np.nan), table[measure], asked))
        for body, of_body in table.groupby(["source", "shape"]):
            rows.append(_row(figure, (*body, np.nan), of_body[measure], asked))
            for time, group in of_body.groupby("contact_time"):
                rows.append(_row(figure, (*body, time), group[measure], asked))
    return pd.DataFrame(rows, columns=list(CONTACTS))


def _real(table: pd.DataFrame) -> pd.DataFrame:
    """Rows without those of the headline table and those of rigid sources with the usual contact time and shape."""
    table = table[table["seed"] < FRESH]
    first = usual(table[table["source"].isin(RIGID)])
    keys = list(table.columns.intersection(["source", "truth", "seed", *PLACE]))
    old = pd.MultiIndex.from_frame(first[keys])
    return table[~pd.MultiIndex.from_frame(table[keys]).isin(old)]


def _row(figure: str, place: tuple, counted: pd.Series, asked: tuple[float, float]) -> dict:
    found = share(counted)
    met = "met" if asked[0] <= found["share"] <= asked[1] else "missed"
    return {"figure": figure, "at_least": asked[0]} | found | dict(zip(PLACE, place)) | {"met": met}


def misses(outcomes: pd.DataFrame) -> list[str]:
    """A line for each dataset of `by_contact` whose verdict is wrong, by source, shape, contact time and truth."""
    rows = _real(outcomes[outcomes["drops"].isin({drops for *_, drops, _ in ASKED})]).query("not right")
    lines = []
    for (source, shape), group in rows.sort_values([*PLACE, "truth"]).groupby(["source", "shape"]):
        lines += ["", f"{source}, {shape}:", ""]
        for row in group.to_dict("records"):
            drops = ", 50 drops" if row["drops"] != 150 else ""
            said = row["why"] or row["named"] or "nothing named"
            lines.append(f"- {row['truth']}, {1e3 * row['contact_time']:g} ms{drops}: {row['verdict']}, {said}")
    return lines


def outside(recovered: pd.DataFrame) -> list[str]:
    """A line for each parameter of `by_contact` that lies outside its 95 % interval."""
    rows = _real(of_table(recovered)).query("not inside").sort_values([*PLACE, "truth"]).to_dict("records")
    return ["", "Parameters outside their 95 % interval:", ""] * bool(rows) + [
        f"- {row['source']}, {row['shape']}, {row['truth']}, {1e3 * row['contact_time']:g} ms: `{row['parameter']}` "
        f"{row['found']:.4g} ± {row['std']:.2g}, where {row['true']:g} was hidden"
        for row in rows
    ]


def accuracy(recovered: pd.DataFrame) -> list[str]:
    """A table of the errors of parameters by source: relative to the hidden value, and in standard errors."""
    rows = _real(of_table(recovered))
    if not len(rows):
        return []
    rows = rows.assign(off=100.0 * np.abs(rows["found"] / rows["true"] - 1.0), z=np.abs(rows["z"]))
    heads = ("source", "parameters inside", "off by (median)", "9 of 10 within", "95 % if standard errors times")
    lines = []
    for source, group in [(EVERY, rows), *rows.groupby("source")]:
        beyond = max(float(np.quantile(group["z"], 0.95)) / Z95, 1.0)
        inside = f"{group['inside'].sum():.0f} of {len(group)}"
        off = [f"{np.quantile(group['off'], share):.2g} %" for share in (0.5, 0.9)]
        lines.append((source, inside, *off, f"{beyond:.2g}"))
    return ["", markdown(heads, lines)]


def as_markdown(outcomes: pd.DataFrame, recovered: pd.DataFrame, folded: bool = False) -> str:
    """A row for each source, shape and contact time (ms) and a column for each figure, then accuracy, then all misses.

    If `folded`, the misses are in a collapsed section of the page.
    """
    table = by_contact(outcomes, recovered).fillna({"contact_time": 0.0})
    figures = {figure: f"≥ {100 * share:.0f} %" for figure, *_, share in ASKED}
    figures[COVERED] = f"{100 * COVERAGE[0]:.0f} to {100 * COVERAGE[1]:.0f} %"
    cells = {
        (*(row[name] for name in (*PLACE, "figure")),): f"{row['share'] * row['n']:.0f} of {row['n']}"
        for row in table.to_dict("records")
    }
    places = table[list(PLACE)].drop_duplicates().sort_values(list(PLACE))
    ordered = pd.concat([places[places["source"] == EVERY], places[places["source"] != EVERY]])
    lines = [("asked", "", "", *figures.values())]
    for source, shape, time in ordered.to_numpy():
        counted = (cells.get((source, shape, time, figure), "") for figure in figures)
        lines.append((source, shape, f"{1e3 * time:g}" if time else EVERY, *counted))
    missed = [*misses(outcomes), *outside(recovered)]
    if folded:
        missed = ["", "<details>", "<summary>Every miss by name</summary>", *missed, "", "</details>"]
    text = markdown(("source", "shape", "ms", *SHORT), lines)
    return "\n".join([text, *accuracy(recovered), *missed]) + "\n"
