"""The format of config/claims.yaml: each number and each ordering that the thesis states.

```yaml
schema: 1
claims:
  - id: table_3_1.mirtich.mu.as_published     # unique, dotted
    chapter: 3
    location: Table 3.1, row Mirtich, column mu
    statement: The friction coefficient that fits Mirtich's law, as coded by the authors, to all impacts.
    published: 0.062          # what the thesis states (see below when it may be left out)
    unit: "1"
    source:                   # where ours is found, below the results folder
      file: chapter3/planar_impact/table_3_1.csv
      where: {law: mirtich_as_published}      # must select exactly one row (orderings: the rows compared)
      column: mu
      std_column: mu_std      # optional: our standard error
    check: {kind: abs, tolerance: 0.01, reason: two bootstrap standard errors and the rounding to 0.001}
    needs: [planar_impact]    # datasets; without one of them the claim shows "data not present"
    note: why ours deviates, if known; shown only when it does       # optional
```

| kind            | reproduced if                                                   | keys beside `kind`     |
|-----------------|-----------------------------------------------------------------|------------------------|
| abs             | abs(ours − published) ≤ tolerance                               | tolerance              |
| rel             | abs(ours − published) ≤ tolerance · abs(published)              | tolerance (a fraction) |
| interval        | abs(ours − published) ≤ k · std + rounding                      | k, rounding (0)        |
| greater, less   | ours − k · std > threshold; ours + k · std < threshold          | threshold, k (0)       |
| ordering        | the rows stand in this order of the column                      | key, rows, order       |
| argmax, argmin  | this row has the largest (smallest) value of the rows selected  | key, row, among        |
| true            | the cell is true                                                |                        |

- abs, rel and interval need a `published` number.  greater and less may have one (it is shown).  The others take
  what is published from the check; `published` may repeat it but not contradict it.
- `where` compares text cells exactly and numbers to 8 digits; several columns may be named.
- ordering: `rows` names values of the column `key`, e.g. [a, b, c]; a nested list is a group whose inner order is not
  claimed, e.g. [a, [b, c], d].  Rows not named are ignored.  `order` is ascending (default) or descending.
- argmax and argmin compare with all rows selected, or with those named in `among`.
- ordering, argmax and argmin take `k` or `tie_tolerance`: two rows compare as stated only if they differ by more than k
  standard errors of the difference, √(s₁² + s₂²) (k = 0, the default: by more than nothing, so a tie deviates); or,
  with `tie_tolerance`, if they break the order by no more than that.
- A `reason` is required wherever a tolerance, a k or a tie_tolerance is given, and for a threshold of our choice: one
  that differs from `published`, or that is not 0 where nothing is published.
- Our number may not be NaN or infinite: that is an error, never a pass (see `evaluate`).
"""

import math
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PlainValidator, StringConstraints, field_validator, model_validator

from thesis_lib.ledger.reading import (
    CsvFile,
    Name,
    NonNegative,
    Number,
    Positive,
    Section,
    Text,
    load_yaml,
    validate,
)


def _cell(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str) or value != value:
        raise ValueError("a text, a number, true or false is wanted here")
    return value


def _cell_or_group(value: Any) -> Any:
    if isinstance(value, list):
        if not value:
            raise ValueError("an empty group orders nothing")
        return [_cell(row) for row in value]
    return _cell(value)


def _published(value: Any) -> Any:
    if isinstance(value, list):
        return [_cell_or_group(row) for row in value]
    try:  # YAML 1.1 reads 1e-3 (without a dot) as text
        value = float(value) if isinstance(value, str) else value
    except ValueError:
        return value
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("a published number is finite")
    return None if value is None else _cell(value)


Cell = Annotated[Any, PlainValidator(_cell)]  # one message instead of one for each type of a union
CellOrGroup = Annotated[Any, PlainValidator(_cell_or_group)]


class Source(Section):
    """The cell (or, for orderings, the cells) of a results table that holds our value."""

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


class _Threshold(Section):
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


class Greater(_Threshold):
    """ours − k · std > threshold."""

    kind: Literal["greater"] = "greater"


class Less(_Threshold):
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
    """The rows stand in this order of the column; a nested list is a group without inner order."""

    kind: Literal["ordering"] = "ordering"
    rows: Annotated[list[CellOrGroup], Field(min_length=2)]
    order: Literal["ascending", "descending"] = "ascending"

    @property
    def groups(self) -> list[list]:
        """The rows, each single one as a group of one."""
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
    """The cell, a flag that the pipeline has computed, is true."""

    kind: Literal["true"] = "true"

    def text(self) -> str:
        return "a flag, no tolerance"


Check = Annotated[
    Abs | Rel | Interval | Greater | Less | Ordering | ArgMax | ArgMin | IsTrue, Field(discriminator="kind")
]


class Claim(Section):
    """One statement of the thesis and how ours is compared with it."""

    id: Annotated[str, StringConstraints(pattern=r"^[a-z0-9_-]+(\.[a-z0-9_-]+)+$")]
    chapter: Annotated[int, Field(ge=1, le=9)]
    location: Text
    statement: Text = Field(description="one sentence that a stranger can read")
    published: Annotated[Any, PlainValidator(_published)] = None
    unit: Text = "1"
    source: Source
    check: Check
    needs: list[Name] = Field([], description="datasets without which nothing is compared")
    note: Text | None = None

    @field_validator("check", mode="before")
    @classmethod
    def _kind_true(cls, value: Any) -> Any:
        if isinstance(value, dict) and value.get("kind") is True:  # YAML reads `kind: true` as a flag
            return {**value, "kind": "true"}
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check, number = self.check, type(self.published) in (int, float)
        if isinstance(check, Abs | Rel | Interval) and not number:
            raise ValueError(f"published must be a number, since the check is of kind {check.kind}")
        if isinstance(check, Rel) and self.published == 0:
            raise ValueError("published is 0, so a relative tolerance admits nothing else: use kind abs")
        if isinstance(check, _Threshold) and self.published is not None and not number:
            raise ValueError(
                f"published must be a number or left out, since the check is of kind {check.kind}"
            )
        if isinstance(check, _Threshold) and check.reason is None:
            stated_threshold = 0.0 if self.published is None else self.published
            if check.threshold != stated_threshold:
                raise ValueError(f"check.reason is missing: say why the threshold is {check.threshold:g}")
        stated = {Ordering: "rows", ArgMax: "row", ArgMin: "row"}.get(type(check))
        if stated and self.published is not None and self.published != getattr(check, stated):
            raise ValueError(f"published contradicts check.{stated}; leave it out")
        if isinstance(check, IsTrue) and self.published not in (None, True):
            raise ValueError("published can only be true here; leave it out")
        if (isinstance(check, Interval) or getattr(check, "k", 0)) and self.source.std_column is None:
            raise ValueError("source.std_column is missing: the check counts standard errors")
        return self


class Ledger(Section):
    """The content of config/claims.yaml."""

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    claims: list[Claim]


def read_ledger(path: str | Path) -> Ledger:
    """Read and check config/claims.yaml.

    Raises:
        UserError: the file is missing, or one line for each thing that is wrong in it, with the claim's id.
    """
    content = load_yaml(path)
    claims = content.get("claims") if isinstance(content, dict) else None
    ids = [claim.get("id") for claim in claims if isinstance(claim, dict)] if isinstance(claims, list) else []
    twice = [name for name, count in Counter(map(str, ids)).items() if count > 1]
    return validate(Ledger, content, path, [f"claim {name}: this id stands more than once" for name in twice])


def _require_reason(check: Any, *names: str) -> None:
    given = [name for name in names if getattr(check, name)]
    if given and check.reason is None:
        raise ValueError(f"reason is missing: say why this {given[0]} is the right one")


def _require_distinct(name: str, rows: list) -> None:
    if len(set(map(str, rows))) < len(rows):
        raise ValueError(f"{name} names a row twice")
