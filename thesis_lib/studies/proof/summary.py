"""The proof against its targets: one row per figure and source, and all tables as text.

Unless stated otherwise a figure counts datasets of 150 drops with the rig's noise and effects at three times the noise
floor.  "mechanism" is our integration of compliant contact, "drake" is Drake's; both have contacts of 20 µs and are
judged together and separately.  Contacts of realistic duration have a table of their own (`by_contact`).

- A share is compared with its target and has a 95 % Wilson interval.  Parameters of one dataset are not quite
  independent; the interval of the coverage is therefore slightly too narrow.
- The coverage counts parameters of models that contain the hidden effect.  Its target also requires a median width
  over the Cramér-Rao bound of at most `WIDEST`.
- The misfit over its floor is the median over single-effect datasets, right or wrong, with an interval from order
  statistics.  The note gives the worst truth and the share of datasets within the target.
- A figure without stored results is "not run"; `n_asked` is the number of planned datasets.
"""

# pandas' stubs do not type the rows of a table
# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false, reportOptionalMemberAccess=false

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from thesis_lib.foundation.files import write_result
from thesis_lib.statistics.intervals import median_interval
from thesis_lib.studies.proof.by_contact import by_contact
from thesis_lib.studies.proof.cases import RIGID, Case, truths
from thesis_lib.studies.proof.results import confusion, misses, of_table, outcomes, recovered, usual
from thesis_lib.studies.proof.store import NOTHING, STORE, share

MECHANISMS = ("mechanism", "drake")
WIDEST = 1.3  # largest interval width over the Cramér-Rao bound
SEEDS_ASKED = {NOTHING: 200, "single": 10}  # planned datasets per truth and source at 150 drops
ASKED = {"pair": 10 * 10, "outside": 3 * 10, "small": 8 * 3}  # planned datasets; "small": per source, at 50 drops
SUMMARY = (
    *("figure", "source", "at_least", "aim", "measured", "low", "high"),
    *("n", "n_asked", "met", "group_size", "note"),
)
Measure = Literal["right", "coverage", "misfit"]
TITLES = {
    "summary": "The proof against its targets",
    "real_contacts": "Contacts as long as real ones: right verdicts, by source, shape and contact time",
    "misses": "Misses at 150 drops",
    "confusion": "Truth against verdict (medians; 95 % intervals)",
}
WIDTH = 120


@dataclass(frozen=True)
class SummaryTarget:
    """Target for one figure of the summary: datasets of one `kind` (`proof.results.KINDS`) with `drops` drops each.

    `measure` is the share of right verdicts, the coverage of parameters, or the misfit over its floor; `at_least` and
    `aim` are intervals (low, high) for its value; `groups` are sets of sources that are judged together.
    """

    figure: str
    measure: Measure
    kind: str
    at_least: tuple[float, float]
    aim: tuple[float, float]
    groups: tuple[tuple[str, ...], ...]
    drops: int = 150

    def met(self, value: float) -> str:
        """Return the strictest target that a value reaches: "aim", "at least", or "missed"."""
        limits = {"aim": self.aim, "at least": self.at_least}
        return next((name for name, (low, high) in limits.items() if low <= value <= high), "missed")


_EACH = (MECHANISMS, ("mechanism",), ("drake",))
_ALL = (RIGID, ("law",), ("mechanism",), ("drake",))
_FIRST = "one effect, named alone or in its group, laws injected, 150 drops"
_INSIDE = f"parameter inside its 95 % interval (laws injected), width over the Fisher bound ≤ {WIDEST:g}"
_AFTER = "held-out error after, over the noise floor (single effects)"
TARGETS = (
    SummaryTarget(_FIRST, "right", "single", (0.95, 1.0), (0.99, 1.0), (("law",),)),
    SummaryTarget("the same, mechanisms, 150 drops", "right", "single", (0.85, 1.0), (0.95, 1.0), _EACH),
    SummaryTarget("the same, mechanisms, 50 drops", "right", "single", (0.70, 1.0), (0.90, 1.0), _EACH, 50),
    SummaryTarget("nothing hidden, verdict adequate, per source", "right", NOTHING, (0.95, 1.0), (0.99, 1.0), _ALL[1:]),
    SummaryTarget("both effects of a pair", "right", "pair", (0.80, 1.0), (0.95, 1.0), _ALL),
    SummaryTarget("outside the library: unexplained", "right", "outside", (0.80, 1.0), (0.95, 1.0), _EACH),
    SummaryTarget(_INSIDE, "coverage", "single", (0.90, 1.0), (0.94, 0.96), (("law",),)),
    SummaryTarget(_AFTER, "misfit", "single", (0.0, 1.2), (0.0, 1.05), _ALL),
)


def summary(store: Path = STORE) -> pd.DataFrame:
    """The proof against its targets: columns `SUMMARY`; `met` is aim, at least, missed, or not run (no results)."""
    datasets, parameters = usual(outcomes(store)), usual(recovered(store))
    rows = []
    for target in TARGETS:
        for group in target.groups:
            sized = of_table(datasets, drops=target.drops)
            counted = sized[(sized["kind"] == target.kind) & sized["source"].isin(group)]
            row = {"figure": target.figure, "source": "all" if group == RIGID else " + ".join(group), "note": ""}
            row |= {"at_least": _said(target, target.at_least), "aim": _said(target, target.aim)}
            row |= {"n_asked": _asked(target, group), "group_size": np.nan}
            if target.kind in ("single", "pair"):  # for other kinds every named group is wrong
                row["group_size"] = counted["group_size"].mean()
            if target.measure == "coverage":
                counted = of_table(parameters, drops=target.drops)
                counted = counted[counted["source"].isin(group)]
            elif target.measure == "misfit":
                counted = counted[np.isfinite(counted["after_over_floor"].astype(float))]
            rows.append(row | (_MEASURES[target.measure](target, counted) if len(counted) else _NOT_RUN))
    return pd.DataFrame(rows, columns=list(SUMMARY))


_NOT_RUN = {"n": 0, "measured": np.nan, "low": np.nan, "high": np.nan, "met": "not run"}


def _share(target: SummaryTarget, hits: pd.Series) -> dict:
    of = share(hits)
    return of | {"measured": of["share"], "met": target.met(of["share"])}


def _coverage(target: SummaryTarget, values: pd.DataFrame) -> dict:
    found, width = _share(target, values["inside"]), float(values["width"].median())
    if not width <= WIDEST:  # an unknown width (NaN) also misses the target
        found["met"] = "missed"
    note = f"{len(values)} parameters, median width over the bound {width:.2f}"
    return found | {"n": len(values.drop_duplicates(["source", "truth", "seed"])), "note": note}


def _misfit(target: SummaryTarget, rows: pd.DataFrame) -> dict:
    values = rows["after_over_floor"].to_numpy(float)
    median, (low, high) = float(np.median(values)), median_interval(values)
    by_truth, most = rows.groupby("truth")["after_over_floor"].median(), target.at_least[1]
    impacts = (rows["error_after"] / rows["floor"]).median()
    note = (
        f"{100 * np.mean(values <= most):.0f} % of datasets ≤ {most:g}; worst {by_truth.idxmax()} "
        f"{by_truth.max():.2f}; impacts alone {impacts:.2f}"
    )
    return {"n": len(rows), "measured": median, "low": low, "high": high, "met": target.met(median), "note": note}


_MEASURES = {"right": lambda target, rows: _share(target, rows["right"]), "coverage": _coverage, "misfit": _misfit}


def _asked(target: SummaryTarget, group: Sequence[str]) -> float:
    """Number of planned datasets; NaN if not planned per source, or if it depends on which effects are named."""
    if target.measure == "coverage":
        return np.nan
    if target.drops != 150:
        return float(ASKED["small"] * len(group))
    if target.kind in SEEDS_ASKED:
        count = sum(Case(source, truth, 0).kind == target.kind for source in group for truth in truths(source))
        return float(SEEDS_ASKED[target.kind] * count)
    return float(ASKED[target.kind]) if group == target.groups[0] else np.nan


def _said(target: SummaryTarget, limits: tuple[float, float]) -> str:
    low, high = limits
    if target.measure == "misfit":
        return f"≤ {high:g}"
    return f"{100 * low:.0f} %" if high == 1.0 else f"{100 * low:.0f}-{100 * high:.0f} %"


def tables(store: Path = STORE) -> dict[str, pd.DataFrame]:
    """The tables `summary`, `real_contacts`, `misses`, `confusion`; CorruptFileError if stored rows are unreadable."""
    made = {"summary": summary(store), "real_contacts": by_contact(outcomes(store), recovered(store))}
    return made | {"misses": misses(store), "confusion": confusion(store)}


def report(store: Path = STORE, folder: Path | None = None) -> str:
    """All tables as text for a terminal of `WIDTH` columns; if a `folder` is given, they are also written there as CSV
    files named as in `tables`."""
    content = tables(store)
    for name, table in content.items() if folder else ():
        write_result(table, Path(folder) / f"{name}.csv")
    form = {"index": False, "na_rep": "", "float_format": "{:.4g}".format, "line_width": WIDTH, "max_colwidth": 100}
    return "\n".join(f"{TITLES[name]}: {len(table)}\n\n{table.to_string(**form)}\n" for name, table in content.items())
