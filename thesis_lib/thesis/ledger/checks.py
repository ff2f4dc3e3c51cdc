"""The `source` of a claim, where our value is found, and its `check`, the condition for it to be reproduced.

| kind            | reproduced if                                                   | keys beside `kind`     |
|-----------------|-----------------------------------------------------------------|------------------------|
| abs             | abs(ours − published) ≤ tolerance                               | tolerance              |
| rel             | abs(ours − published) ≤ tolerance · abs(published)              | tolerance (a fraction) |
| interval        | abs(ours − published) ≤ k · std + rounding                      | k, rounding (0)        |
| greater, less   | ours − k · std > threshold; ours + k · std < threshold          | threshold, k (0)       |
| ordering        | the column sorts the rows in this order                         | key, rows, order       |
| argmax, argmin  | this row has the largest (smallest) value of the rows selected  | key, row               |
| true            | the cell is true                                                |                        |

- ordering: `rows` lists values of the column `key`, e.g. [a, b, c].  A nested list is a group without inner order,
  e.g. [a, [b, c], d].  Rows not listed are ignored.  `order` is ascending (default) or descending.
- ordering, argmax and argmin accept `k`: two rows must differ by more than k standard errors of the difference,
  √(s₁² + s₂²); the default k = 0 rejects ties.
- With a margin of k standard errors, a check that fails by less than the margin is "not decided", because of noise.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, PlainValidator, model_validator

from thesis_lib.foundation.settings import Section
from thesis_lib.thesis.ledger.reading import CsvFile, NonNegative, Number, Positive, Text


def cell(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str) or value != value:
        raise ValueError("expected text, a number, true or false")
    return value


def cell_or_group(value: Any) -> Any:
    if isinstance(value, list):
        if not value:
            raise ValueError("a group must not be empty")
        return [cell(row) for row in value]
    return cell(value)


def published(value: Any) -> Any:
    if isinstance(value, list):
        return [cell_or_group(row) for row in value]
    try:  # YAML 1.1 reads 1e-3 (without a dot) as text
        value = float(value) if isinstance(value, str) else value
    except ValueError:
        return value
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("a published number must be finite")
    return None if value is None else cell(value)


# gives one message instead of one for each type of a union
Cell = Annotated[Any, PlainValidator(cell)]
CellOrGroup = Annotated[Any, PlainValidator(cell_or_group)]
Published = Annotated[Any, PlainValidator(published)]


class SourceCell(Section):
    """Cell (for orderings, cells) with our value in a table of results."""

    file: CsvFile = Field(description="CSV below the results folder")
    where: dict[str, Cell] = Field({}, description="column: value; all must hold")
    column: Text
    std_column: Text | None = Field(None, description="standard error of `column`")


class Within(Section):
    """Check abs(ours − published) ≤ tolerance, in the claim's unit (abs) or times abs(published) (rel)."""

    kind: Literal["abs", "rel"]
    tolerance: Positive
    reason: Text = Field(description="why this tolerance is appropriate")

    def text(self) -> str:
        amount = f"{self.tolerance:g}" if self.kind == "abs" else f"{100 * self.tolerance:g} %"
        return f"±{amount}: {self.reason}"


class Interval(Section):
    """Check abs(ours − published) ≤ k · std + rounding."""

    kind: Literal["interval"]
    k: Positive
    rounding: NonNegative = Field(0.0, description="half a unit of the published value's last digit")
    reason: Text = Field(description="why this k is appropriate")

    def text(self) -> str:
        rounding = f" ± {self.rounding:g} for rounding" if self.rounding else ""
        return f"within {self.k:g} standard errors{rounding}: {self.reason}"


class _Margin(Section):
    k: NonNegative = 0.0
    reason: Text | None = None

    @model_validator(mode="after")
    def _has_reason(self) -> Self:
        if self.k and self.reason is None:
            raise ValueError("reason is missing: state why this k is appropriate")
        return self


class Threshold(_Margin):
    """Check ours − k · std > threshold (greater), or ours + k · std < threshold (less)."""

    kind: Literal["greater", "less"]
    threshold: Number

    def text(self) -> str:
        by = f" by more than {self.k:g} standard errors" if self.k else ""
        why = f": {self.reason}" if self.reason else ""
        return f"{self.kind} than {self.threshold:g}{by}{why}"


class _Ranked(_Margin):
    key: Text = Field(description="column whose values identify the rows")

    def text(self) -> str:
        if self.k:
            return f"by more than {self.k:g} standard errors of the difference: {self.reason}"
        return "no tie"


class Ordering(_Ranked):
    """Check that the column sorts the rows in this order; a nested list is a group without inner order."""

    kind: Literal["ordering"]
    rows: Annotated[list[CellOrGroup], Field(min_length=2)]
    order: Literal["ascending", "descending"] = "ascending"

    @property
    def groups(self) -> list[list]:
        """Return the rows as groups; a single row is a group of one."""
        return [row if isinstance(row, list) else [row] for row in self.rows]

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        rows = [str(row) for group in self.groups for row in group]
        if len(set(rows)) < len(rows):
            raise ValueError("rows names a row twice")
        return self


class Extreme(_Ranked):
    """Check that this row has the largest (argmax) or smallest (argmin) value."""

    kind: Literal["argmax", "argmin"]
    row: Cell


class IsTrue(Section):
    """Check that the cell, a flag computed by the pipeline, is true."""

    kind: Literal["true"]

    def text(self) -> str:
        return "a flag, no tolerance"


def _kind_true(value: Any) -> Any:
    # YAML reads `kind: true` as a flag
    return {**value, "kind": "true"} if isinstance(value, dict) and value.get("kind") is True else value


Check = Annotated[
    Annotated[Within | Interval | Threshold | Ordering | Extreme | IsTrue, Field(discriminator="kind")],
    BeforeValidator(_kind_true),
]
