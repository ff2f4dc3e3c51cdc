"""Evaluation of claims: select our value from the results and apply the claim's check (formats in `ledger`).

If anything prevents a comparison (a missing file, column or row, several rows instead of one, text, NaN, infinity,
a dataset unknown to the run), the result has status `error`, never `reproduced`.
"""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import FLOAT_FORMAT, read_cells
from thesis_lib.thesis.ledger.checks import Extreme, Interval, IsTrue, Ordering, Threshold
from thesis_lib.thesis.ledger.format import Claim, Ledger
from thesis_lib.thesis.ledger.reading import number
from thesis_lib.thesis.ledger.result import ClaimStatus, Result

SAME_NUMBER = 1e-8  # relative; tables carry 9 digits, so equal numbers differ by at most 5e-10
SLACK = 1e-9  # relative; 0.13 − 0.12 must not exceed 0.01 by the last bits of binary fractions


def evaluate(ledger: Ledger, results_dir: str | Path, present: Mapping[str, bool], scale: str = "") -> list[Result]:
    """Evaluate each claim, in the ledger's order; mistakes in the results do not raise (see the module's docstring).

    `results_dir` contains the sources; `present`: whether this run had each dataset (`reading.read_present`); `scale`:
    that of the run, which may be too noisy to decide a claim.
    """
    read = functools.cache(lambda file: read_cells(Path(results_dir) / file))
    results = [_evaluate(claim, present, read) for claim in ledger.claims]
    return [_undecided(result) if scale == "quick" else result for result in results]


def _undecided(result: Result) -> Result:
    """Result as it counts at the quick scale: "not decided" if a claim with `quick` was compared."""
    why = result.claim.quick
    if why is None or result.status not in (ClaimStatus.REPRODUCED, ClaimStatus.DEVIATES):
        return result
    return replace(result, status=ClaimStatus.UNDECIDED, finding=why)


def _evaluate(claim: Claim, present: Mapping[str, bool], read: Callable[[str], pd.DataFrame]) -> Result:
    published = _published(claim)
    if unknown := [name for name in claim.needs if name not in present]:
        known = ", ".join(sorted(present)) or "none"
        finding = f"the run does not report on the dataset {', '.join(unknown)} (known: {known})"
        return Result(claim, ClaimStatus.ERROR, published, finding=finding)
    if absent := [name for name in claim.needs if not present[name]]:
        return Result(claim, ClaimStatus.NO_DATA, published, finding=f"needs the dataset {', '.join(absent)}")
    table = pd.DataFrame()
    try:
        table = read(claim.source.file)
        measures = {Ordering: _measure_ordering, Extreme: _measure_extreme, IsTrue: _measure_flag}
        measure = measures.get(type(claim.check), _measure_number)
        return replace(measure(claim, _selected(claim, table)), published=published)
    except KeyError as column:
        finding = f"{claim.source.file} has no column {column}; it has {', '.join(table.columns)}"
    except UserError as error:
        finding = str(error)
    return Result(claim, ClaimStatus.ERROR, published, finding=finding)


def _selected(claim: Claim, table: pd.DataFrame) -> pd.DataFrame:
    """Select the rows of a table by a claim's source; cells are text."""
    source = claim.source
    table[source.column]  # report a missing column before a missing row
    rows = _with(table, source.where)
    if rows.empty:
        raise UserError(f"{source.file} has no row with {_condition(source.where)}")
    return rows


def _with(rows: pd.DataFrame, cells: Mapping[str, object]) -> pd.DataFrame:
    for name, value in cells.items():
        rows = rows.loc[[_matches(cell, value) for cell in rows[name]]]
    return rows


def _only(claim: Claim, rows: pd.DataFrame, **further: object) -> pd.Series:
    """Return the only row with these further cells; UserError if there is not exactly one."""
    rows = _with(rows, further)
    if len(rows) != 1:
        where = _condition({**claim.source.where, **further})
        raise UserError(f"{claim.source.file} has {len(rows) or 'no'} rows with {where}; exactly one is needed")
    return rows.iloc[0]


def _std(claim: Claim, row: pd.Series) -> float:
    """Standard error in a row; NaN if the claim names no column for it."""
    name = claim.source.std_column
    std = math.nan if name is None else _number(claim, row, name)
    if std < 0:
        raise UserError(f"{claim.source.file}, data row {row.name}: {name} is {_short(std)}, below zero")
    return std


def _number(claim: Claim, row: pd.Series, column: str) -> float:
    try:
        value = number(row[column])
    except ValueError:
        value = math.inf
    if not math.isfinite(value):
        content = "empty or NaN" if math.isnan(value) else repr(row[column])
        raise UserError(f"{claim.source.file}, data row {row.name}: {column} is {content}, not a finite number")
    return value


def _short(value: float) -> str:
    return f"{value:.4g}"  # enough digits for a sentence


def _matches(cell: str, wanted: object) -> bool:
    if isinstance(wanted, bool):
        return cell.strip().lower() == str(wanted).lower()
    if isinstance(wanted, str):
        return cell == wanted
    try:
        return math.isclose(number(cell), float(wanted), rel_tol=SAME_NUMBER)  # type: ignore[arg-type]
    except ValueError:
        return False


def _condition(where: Mapping[str, object]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in where.items()) or "any content"


def _published(claim: Claim) -> str:
    check = claim.check
    if isinstance(check, Ordering):
        sign = " < " if check.order == "ascending" else " > "
        groups = [", ".join(map(str, group)) for group in check.groups]
        return sign.join(f"{{{text}}}" if ", " in text else text for text in groups)
    if isinstance(check, Extreme):
        return str(check.row)
    if isinstance(check, IsTrue):
        return "true"
    if claim.published is None:
        return f"{'>' if check.kind == 'greater' else '<'} {FLOAT_FORMAT % check.threshold}"
    return FLOAT_FORMAT % claim.published


def _measure_number(claim: Claim, rows: pd.DataFrame) -> Result:
    check, row = claim.check, _only(claim, rows)
    value, std = _number(claim, row, claim.source.column), _std(claim, row)
    if isinstance(check, Threshold):
        name, reference, sign = "the threshold", check.threshold, 1.0 if check.kind == "greater" else -1.0
        beyond, margin = sign * (value - reference), check.k * std if check.k else 0.0
        holds, hidden = beyond > margin, abs(beyond) < margin
    else:
        name, reference = "the published value", float(claim.published)
        if isinstance(check, Interval):
            allowed = check.k * std + check.rounding
        else:
            allowed = check.tolerance * (abs(reference) if check.kind == "rel" else 1.0)
        holds, hidden = abs(value - reference) <= allowed * (1 + SLACK), False
    difference = value - reference
    relative = difference / abs(reference) if reference else math.nan
    name += f" {_short(reference)}" if isinstance(check, Threshold) else ""
    share = "" if math.isnan(relative) else f" ({100 * relative:+.3g} %)"
    finding = f"differs from {name} by {difference:+.4g}{share}"
    finding += f", less than {check.k:g} standard errors: the noise is too large to decide" if hidden else ""
    return Result(claim, _status(holds, hidden), "", FLOAT_FORMAT % value, std, difference, relative, finding)


def _measure_flag(claim: Claim, rows: pd.DataFrame) -> Result:
    row, column = _only(claim, rows), claim.source.column
    cell = row[column].strip().lower()
    if cell not in ("true", "false", "1", "0"):
        raise UserError(f"{claim.source.file}, data row {row.name}: {column} is {cell!r}, neither true nor false")
    ours = "true" if cell in ("true", "1") else "false"
    return Result(claim, _status(ours == "true"), ours=ours, finding=f"found {ours}")


def _measure_ordering(claim: Claim, rows: pd.DataFrame) -> Result:
    check = claim.check
    groups = [[_member(claim, _only(claim, rows, **{check.key: name})) for name in group] for group in check.groups]
    pairs = [(a, b) for i, low in enumerate(groups) for high in groups[i + 1 :] for a in low for b in high]
    ascending = check.order == "ascending"
    return _ranked(claim, [one for group in groups for one in group], pairs, 1.0 if ascending else -1.0, ascending)


def _measure_extreme(claim: Claim, rows: pd.DataFrame) -> Result:
    check = claim.check
    best = _only(claim, rows, **{check.key: check.row})
    if len(rows) < 2:
        raise UserError(f"{claim.source.file}: {check.row} is the only row selected, so there is nothing to compare")
    others = {i: _member(claim, row) for i, row in rows.iterrows()}
    top = others[best.name]
    pairs = [(one, top) for i, one in others.items() if i != best.name]
    largest = check.kind == "argmax"
    return _ranked(claim, list(others.values()), pairs, 1.0 if largest else -1.0, not largest)


class _Member(NamedTuple):
    """A row that is compared with others: name, value, and standard error (0 if the check does not use it)."""

    name: str
    value: float
    std: float

    def __str__(self) -> str:
        return f"{self.name} ({_short(self.value)})"


def _member(claim: Claim, row: pd.Series) -> _Member:
    value = _number(claim, row, claim.source.column)
    return _Member(row[claim.check.key], value, _std(claim, row) if claim.check.k else 0.0)


def _ranked(
    claim: Claim, members: list[_Member], pairs: list[tuple[_Member, _Member]], sign: float, ascending: bool
) -> Result:
    """Compare pairs (before, after): sign · (after − before) must exceed k standard errors.

    `ascending`: our values are shown in ascending order.
    """
    check, broken, hidden = claim.check, [], True
    for before, after in pairs:
        step, margin = sign * (after.value - before.value), check.k * math.hypot(before.std, after.std)
        if not step > margin:
            side = "above" if sign > 0 else "below"
            broken.append((step, f"{after} is not {side} {before}" + " by enough" * (step > 0)))
            hidden = hidden and abs(step) < margin
    broken.sort(key=lambda item: item[0])  # the worst first
    finding = "; ".join(text for _, text in broken[:3])
    if len(broken) > 3:
        finding += f"; and {len(broken) - 3} more pairs"
    if broken and hidden:
        finding += f"; less than {check.k:g} standard errors: the noise is too large to decide"
    # equal values are sorted by name, for a deterministic order
    order = sorted(members, key=lambda one: (one.value if ascending else -one.value, one.name))
    ours = (" < " if ascending else " > ").join(map(str, order))
    return Result(claim, _status(not broken, hidden), ours=ours, finding=finding)


def _status(holds: bool, hidden: bool = False) -> ClaimStatus:
    """Status of a check; `hidden`: it fails by less than the noise."""
    return ClaimStatus.REPRODUCED if holds else ClaimStatus.UNDECIDED if hidden else ClaimStatus.DEVIATES
