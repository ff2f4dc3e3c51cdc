"""The `source` and the `check` of a claim: where our value is found, and when it counts as reproduced.

| kind            | reproduced if                                                   | keys beside `kind`     |
|-----------------|-----------------------------------------------------------------|------------------------|
| abs             | abs(ours − published) ≤ tolerance                               | tolerance              |
| rel             | abs(ours − published) ≤ tolerance · abs(published)              | tolerance (a fraction) |
| interval        | abs(ours − published) ≤ k · std + rounding                      | k, rounding (0)        |
| greater, less   | ours − k · std > threshold; ours + k · std < threshold          | threshold, k (0)       |
| ordering        | the column puts the rows in this order                          | key, rows, order       |
| argmax, argmin  | this row has the largest (smallest) value of the rows selected  | key, row, among        |
| true            | the cell is true                                                |                        |

- ordering: `rows` lists values of the column `key`, e.g. [a, b, c].  A nested list is a group without inner order,
  e.g. [a, [b, c], d].  Rows not listed are ignored.  `order` is ascending (default) or descending.
- argmax and argmin compare with all rows selected, or only with those in `among`.
- ordering, argmax and argmin accept `k` or `tie_tolerance`.  With k, two rows must differ by more than k standard
  errors of the difference, √(s₁² + s₂²); the default k = 0 refuses ties.  With `tie_tolerance`, a pair may break the
  order by at most that much.
- A tolerance, a k or a tie_tolerance requires a `reason`.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, PlainValidator, model_validator

from thesis_lib.foundation.settings import Section
from thesis_lib.ledger.reading import CsvFile, NonNegative, Number, Positive, Text


def cell(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str) or value != value:
        raise ValueError("a text, a number, true or false is wanted here")
    return value


def cell_or_group(value: Any) -> Any:
    if isinstance(value, list):
        if not value:
            raise ValueError("an empty group orders nothing")
        return [cell(row) for row in value]
    return cell(value)


Cell = Annotated[Any, PlainValidator(cell)]  # one message instead of one for each type of a union
CellOrGroup = Annotated[Any, PlainValidator(cell_or_group)]


class Source(Section):
    """The cell that holds our value (for orderings, the cells) in a table of results."""

    file: CsvFile = Field(description="CSV below the results folder")
    where: dict[str, Cell] = Field({}, description="column: value; all must hold")
    column: Text
    std_column: Text | None = Field(None, description="standard error of `column`")


class Abs(Section):
    """abs(ours − published) ≤ tolerance, in the claim's unit."""

    kind: Literal["abs"] = "abs"
    tolerance: Positive
    reason: Text

    def text(self) -> str:
        return f"±{self.tolerance:g}: {self.reason}"


class Rel(Section):
    """abs(ours − published) ≤ tolerance · abs(published)."""

    kind: Literal["rel"] = "rel"
    tolerance: Positive
    reason: Text

    def text(self) -> str:
        return f"±{100 * self.tolerance:g} %: {self.reason}"


class Interval(Section):
    """abs(ours − published) ≤ k · std + rounding."""

    kind: Literal["interval"] = "interval"
    k: Positive
    rounding: NonNegative = Field(0.0, description="half a unit of the published value's last digit")
    reason: Text

    def text(self) -> str:
        rounding = f" ± {self.rounding:g} for rounding" if self.rounding else ""
        return f"within {self.k:g} standard errors{rounding}: {self.reason}"


class Threshold(Section):
    threshold: Number
    k: NonNegative = 0.0
    reason: Text | None = None

    @model_validator(mode="after")
    def _has_reason(self) -> Self:
        _require_reason(self, "k")
        return self

    def text(self) -> str:
        by = f" by more than {self.k:g} standard errors" if self.k else ""
        why = f": {self.reason}" if self.reason else ""
        return f"{self.kind} than {self.threshold:g}{by}{why}"  # type: ignore[attr-defined]


class Greater(Threshold):
    """ours − k · std > threshold."""

    kind: Literal["greater"] = "greater"


class Less(Threshold):
    """ours + k · std < threshold."""

    kind: Literal["less"] = "less"


class _Ranked(Section):
    key: Text = Field(description="column whose values name the rows")
    k: NonNegative = 0.0
    tie_tolerance: NonNegative = 0.0
    reason: Text | None = None

    @model_validator(mode="after")
    def _one_margin(self) -> Self:
        if self.k and self.tie_tolerance:
            raise ValueError("k asks for more than a tie and tie_tolerance for less: give one of them")
        _require_reason(self, "k", "tie_tolerance")
        return self

    def text(self) -> str:
        if self.k:
            return f"by more than {self.k:g} standard errors of the difference: {self.reason}"
        if self.tie_tolerance:
            return f"ties up to {self.tie_tolerance:g} allowed: {self.reason}"
        return "no tie"


class Ordering(_Ranked):
    """The column puts the rows in this order; a nested list is a group without inner order."""

    kind: Literal["ordering"] = "ordering"
    rows: Annotated[list[CellOrGroup], Field(min_length=2)]
    order: Literal["ascending", "descending"] = "ascending"

    @property
    def groups(self) -> list[list]:
        """The rows as groups; a single row is a group of one."""
        return [row if isinstance(row, list) else [row] for row in self.rows]

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        _require_distinct("rows", [row for group in self.groups for row in group])
        return self


class _Extreme(_Ranked):
    row: Cell
    among: Annotated[list[Cell], Field(min_length=2)] | None = None

    @model_validator(mode="after")
    def _row_among(self) -> Self:
        if self.among is not None:
            _require_distinct("among", self.among)
            if self.row not in self.among:
                raise ValueError(f"among does not hold the row {self.row!r} itself")
        return self


class ArgMax(_Extreme):
    """This row has the largest value."""

    kind: Literal["argmax"] = "argmax"


class ArgMin(_Extreme):
    """This row has the smallest value."""

    kind: Literal["argmin"] = "argmin"


class IsTrue(Section):
    """The cell, a flag computed by the pipeline, is true."""

    kind: Literal["true"] = "true"

    def text(self) -> str:
        return "a flag, no tolerance"


def _kind_true(value: Any) -> Any:
    # YAML reads `kind: true` as a flag
    return {**value, "kind": "true"} if isinstance(value, dict) and value.get("kind") is True else value


Check = Annotated[
    Annotated[Abs | Rel | Interval | Greater | Less | Ordering | ArgMax | ArgMin | IsTrue, Field(discriminator="kind")],
    BeforeValidator(_kind_true),
]


def _require_reason(check: Any, *names: str) -> None:
    margins = [name for name in names if getattr(check, name)]
    if margins and check.reason is None:
        raise ValueError(f"reason is missing: say why this {margins[0]} is the right one")


def _require_distinct(name: str, rows: list) -> None:
    if len(set(map(str, rows))) < len(rows):
        raise ValueError(f"{name} names a row twice")
