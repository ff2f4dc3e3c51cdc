"""Evaluate each claim: select our value from the results and apply the claim's check (formats in `ledger`).

Whatever prevents a comparison (a missing file, column or row, several rows where one is wanted, text, NaN, infinity,
a dataset unknown to the run) gives a result of status `error`, never a pass.
"""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import FLOAT_FORMAT
from thesis_lib.ledger.checks import Extreme, Interval, IsTrue, Ordering, Threshold
from thesis_lib.ledger.format import Claim, Ledger
from thesis_lib.ledger.reading import Cells, number
from thesis_lib.ledger.result import ClaimStatus, Result

SAME_NUMBER = 1e-8  # relative; tables carry 9 digits, so equal numbers differ by at most 5e-10
SLACK = 1e-9  # relative; 0.13 − 0.12 must not exceed 0.01 by the last bits of binary fractions


def evaluate(ledger: Ledger, results_dir: str | Path, present: Mapping[str, bool], scale: str = "") -> list[Result]:
    """The result of each claim, in the ledger's order; mistakes in the results do not raise (see the module's head).

    `results_dir` holds the sources; `present`: whether this run had each dataset (`reading.read_present`); `scale` at
    which it ran, which may be too noisy to decide a claim.
    """
    read = functools.cache(lambda file: Cells.read(Path(results_dir) / file))
    results = [_evaluate(claim, present, read) for claim in ledger.claims]
    return [_undecided(result) if scale == "quick" else result for result in results]


def _undecided(result: Result) -> Result:
    """The result at the quick scale, which decides nothing about claims that say so."""
    why = result.claim.quick
    if why is None or result.status not in (ClaimStatus.REPRODUCED, ClaimStatus.DEVIATES):
        return result
    return replace(result, status=ClaimStatus.UNDECIDED, finding=why)


def _evaluate(claim: Claim, present: Mapping[str, bool], read: Callable[[str], Cells]) -> Result:
    published = _published(claim)
    if unknown := [name for name in claim.needs if name not in present]:
        known = ", ".join(sorted(present)) or "none"
        finding = f"the run reports nothing about the dataset {', '.join(unknown)} (known: {known})"
        return Result(claim, ClaimStatus.ERROR, published, finding=finding)
    if absent := [name for name in claim.needs if not present[name]]:
        return Result(claim, ClaimStatus.NO_DATA, published, finding=f"needs the dataset {', '.join(absent)}")
    try:
        rows = _Rows.select(claim, read)
        measures = {Ordering: _measure_ordering, Extreme: _measure_extreme, IsTrue: _measure_flag}
        return replace(measures.get(type(claim.check), _measure_number)(rows), published=published)
    except UserError as error:
        return Result(claim, ClaimStatus.ERROR, published, finding=str(error))


@dataclass(frozen=True)
class _Rows:
    """The rows selected by a claim's source; their values are still text."""

    cells: Cells
    rows: list[int]
    claim: Claim

    @classmethod
    def select(cls, claim: Claim, read: Callable[[str], Cells]) -> "_Rows":
        source, cells = claim.source, read(claim.source.file)
        rows = list(range(len(cells.rows)))
        for name, value in source.where.items():
            column = cells.column(name)
            rows = [i for i in rows if _matches(column[i], value)]
        cells.column(source.column)  # report a missing column before a missing row
        if not rows:
            raise UserError(f"{cells.path} has no row with {_condition(source.where)}")
        return cls(cells, rows, claim)

    def only(self) -> int:
        if len(self.rows) > 1:
            where = _condition(self.claim.source.where)
            raise UserError(f"{self.cells.path} has {len(self.rows)} rows with {where}; one is wanted")
        return self.rows[0]

    def named(self, key: str, name: object) -> int:
        column = self.cells.column(key)
        rows = [i for i in self.rows if _matches(column[i], name)]
        if len(rows) != 1:
            where = _condition({**self.claim.source.where, key: name})
            raise UserError(f"{self.cells.path} has {len(rows) or 'no'} rows with {where}; one is wanted")
        return rows[0]

    def value(self, row: int) -> float:
        return self._number(self.claim.source.column, row)

    def std(self, row: int) -> float:
        """Standard error in a row; NaN if the claim names no column for it."""
        name = self.claim.source.std_column
        if name is None:
            return math.nan
        std = self._number(name, row)
        if std < 0:
            raise UserError(f"{self.cells.path}, data row {row}: {name} is {_short(std)}, below zero")
        return std

    def _number(self, column: str, row: int) -> float:
        cell = self.cells.column(column)[row]
        try:
            value = number(cell)
        except ValueError:
            value = math.inf
        if not math.isfinite(value):
            content = "empty or NaN" if math.isnan(value) else repr(cell)
            raise UserError(f"{self.cells.path}, data row {row}: {column} is {content}, not a finite number")
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
    return ", ".join(f"{name} = {value}" for name, value in where.items()) or "anything in it"


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


def _measure_number(rows: _Rows) -> Result:
    claim, check, row = rows.claim, rows.claim.check, rows.only()
    value, std = rows.value(row), rows.std(row)
    if isinstance(check, Threshold):
        name, reference, sign = "the threshold", check.threshold, 1.0 if check.kind == "greater" else -1.0
        holds = sign * (value - reference) > (check.k * std if check.k else 0.0)
    else:
        name, reference = "the published value", float(claim.published)
        if isinstance(check, Interval):
            allowed = check.k * std + check.rounding
        else:
            allowed = check.tolerance * (abs(reference) if check.kind == "rel" else 1.0)
        holds = abs(value - reference) <= allowed * (1 + SLACK)
    difference = value - reference
    relative = difference / abs(reference) if reference else math.nan
    name += f" {_short(reference)}" if isinstance(check, Threshold) else ""
    share = "" if math.isnan(relative) else f" ({100 * relative:+.3g} %)"
    finding = f"differs from {name} by {difference:+.4g}{share}"
    return Result(claim, _status(holds), "", FLOAT_FORMAT % value, std, difference, relative, finding)


def _measure_flag(rows: _Rows) -> Result:
    row, column = rows.only(), rows.claim.source.column
    cell = rows.cells.column(column)[row].strip().lower()
    if cell not in ("true", "false", "1", "0"):
        raise UserError(f"{rows.cells.path}, data row {row}: {column} is {cell!r}, neither true nor false")
    ours = "true" if cell in ("true", "1") else "false"
    return Result(rows.claim, _status(ours == "true"), ours=ours, finding=f"found {ours}")


def _measure_ordering(rows: _Rows) -> Result:
    check = rows.claim.check
    groups = [[rows.named(check.key, name) for name in group] for group in check.groups]
    # all pairs, not only those of neighbouring groups: with ties allowed the order is not transitive
    pairs = [(a, b) for i, low in enumerate(groups) for high in groups[i + 1 :] for a in low for b in high]
    ascending = check.order == "ascending"
    return _ranked(rows, [row for group in groups for row in group], pairs, 1.0 if ascending else -1.0, ascending)


def _measure_extreme(rows: _Rows) -> Result:
    check = rows.claim.check
    top = rows.named(check.key, check.row)
    others = rows.rows if check.among is None else [rows.named(check.key, name) for name in check.among]
    if len(others) < 2:
        raise UserError(f"{rows.cells.path}: {check.row} is the only row selected, so it is trivially extreme")
    pairs = [(row, top) for row in others if row != top]
    largest = check.kind == "argmax"
    return _ranked(rows, others, pairs, 1.0 if largest else -1.0, not largest)


def _ranked(rows: _Rows, members: list[int], pairs: list[tuple[int, int]], sign: float, ascending: bool) -> Result:
    """Compare pairs (before, after): sign · (after − before) must exceed k standard errors, or be ≥ −tie_tolerance.

    `ascending`: our values are shown with the smallest first.
    """
    check = rows.claim.check
    value = {row: rows.value(row) for row in members}
    std = {row: rows.std(row) for row in members} if check.k else dict.fromkeys(members, 0.0)
    column = rows.cells.column(check.key)

    def show(row: int) -> str:
        return f"{column[row]} ({_short(value[row])})"

    broken = []
    for before, after in pairs:
        step = sign * (value[after] - value[before])
        if check.tie_tolerance:
            holds = step >= -check.tie_tolerance * (1 + SLACK)
        else:
            holds = step > check.k * math.hypot(std[before], std[after])
        if not holds:
            side = "above" if sign > 0 else "below"
            broken.append((step, f"{show(after)} is not {side} {show(before)}" + " by enough" * (step > 0)))
    broken.sort(key=lambda item: item[0])  # the worst first
    finding = "; ".join(text for _, text in broken[:3])
    if len(broken) > 3:
        finding += f"; and {len(broken) - 3} more pairs"
    # equal values by name, for a deterministic order
    order = sorted(members, key=lambda row: (value[row] if ascending else -value[row], column[row]))
    ours = (" < " if ascending else " > ").join(show(row) for row in order)
    return Result(rows.claim, _status(not broken), ours=ours, finding=finding)


def _status(holds: bool) -> ClaimStatus:
    return ClaimStatus.REPRODUCED if holds else ClaimStatus.DEVIATES
