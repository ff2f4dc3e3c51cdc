"""The format of config/figures.yaml: the columns of each figure's CSV and how far they may move.

```yaml
schema: 1
scales: [quick, default]            # scales with stored copies; others are not compared (these two if left out)
ignore:                             # pictures that are no figures of the thesis; pattern below results: why
  "critique/*": checked by its own tests
figures:
  figure_3_8:                       # name of the stored copy
    file: chapter3/{dataset}/figure_3_8.csv       # below the results folder
    datasets: [planar_impact, simulated_drops]    # one copy for each; leave out if the figure uses none
    keys: [law, panel]              # compared exactly, as text
    columns:                        # every other column needs a tolerance and its reason
      error: {abs: 1.0e-4, rel: 0.01, reason: bandwidth search stops at a relative change of 0.01}
    rows: {max: 40}                 # optional: the copy keeps at most so many rows, evenly spaced
```

A number agrees if abs(ours − stored) ≤ abs + rel · abs(stored).  NaN agrees only with NaN, an infinity only with the
same one.  Rows are compared by position, and their number must not change; where it may, e.g. because a detection
threshold lets one impact more or less through, write `rows: {tolerance: 3, reason: ...}`: rows are then found by
their keys, and up to `tolerance` of the stored ones may be gone.

Stored copies lie at config/figures/<scale>/<dataset, or common>/<name>.csv, with the position in the figure's CSV as
first column, `row`.  The last row is always kept, so its position tells how many rows there were.
"""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from thesis_lib.ledger.expected import Scale
from thesis_lib.ledger.reading import CsvFile, Name, NonNegative, Section, Text, load_yaml, validate

ROW = "row"  # column of a stored copy: position in the figure's CSV, from 0
COMMON = "common"  # folder of the figures that use no dataset


class Tolerance(Section):
    """A number agrees if abs(ours − stored) ≤ abs + rel · abs(stored)."""

    abs: NonNegative | None = None
    rel: NonNegative | None = None
    reason: Text

    @model_validator(mode="after")
    def _one_given(self) -> Self:
        if self.abs is None and self.rel is None:
            raise ValueError("give abs, rel, or both")
        return self


class Rows(Section):
    """How the stored copy is thinned, and by how much the number of rows may change."""

    max: Annotated[int, Field(ge=2, le=400)] = 40
    tolerance: Annotated[int, Field(ge=0)] = 0
    reason: Text | None = None

    @model_validator(mode="after")
    def _has_reason(self) -> Self:
        if self.tolerance and self.reason is None:
            raise ValueError("reason is missing: say why the number of rows may change")
        return self


class Figure(Section):
    """One figure's CSV: where it lies and how each column is compared."""

    file: CsvFile
    datasets: list[Name] = Field([], description="one copy for each; [] if it uses none")
    keys: list[Text] = Field([], description="columns compared exactly, as text")
    columns: dict[Text, Tolerance] = Field({}, description="columns of numbers")
    rows: Rows = Rows()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        both = [name for name in self.keys if name in self.columns]
        if both:
            raise ValueError(f"{', '.join(both)} stands in keys and in columns; keys are compared exactly")
        if not self.keys and not self.columns:
            raise ValueError("keys and columns are both empty: nothing would be compared")
        if ROW in (*self.keys, *self.columns):
            raise ValueError(f"the column name {ROW!r} is taken by the stored copies")
        if len(set(self.keys)) < len(self.keys) or len(set(self.datasets)) < len(self.datasets):
            raise ValueError("keys or datasets names something twice")
        if "{dataset}" in self.file and not self.datasets:
            raise ValueError("file holds {dataset}, but datasets is empty")
        if "{dataset}" not in self.file and len(self.datasets) > 1:
            raise ValueError("file must hold {dataset}, since there are several datasets")
        if self.rows.tolerance and not self.keys:
            raise ValueError("rows.tolerance needs keys, by which the rows are found again")
        return self

    def sources(self) -> dict[str, str]:
        """CSV below the results folder for each dataset (or for `COMMON`)."""
        return {name: self.file.replace("{dataset}", name) for name in self.datasets or [COMMON]}


class FigureSpec(Section):
    """The content of config/figures.yaml."""

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    scales: list[Scale] = Field(["quick", "default"], description="scales with stored copies")
    ignore: dict[Text, Text] = Field({}, description="pattern of pictures: why they have no copy")
    figures: dict[Name, Figure]

    @model_validator(mode="after")
    def _one_entry_each(self) -> Self:
        files = [file for figure in self.figures.values() for file in figure.sources().values()]
        twice = sorted({file for file in files if files.count(file) > 1})
        if twice:
            raise ValueError(f"two figures name the file {', '.join(twice)}")
        return self


def read_figure_spec(path: str | Path) -> FigureSpec:
    """Read and check config/figures.yaml.

    Raises:
        UserError: the file is missing, or one line for each thing that is wrong in it.
    """
    return validate(FigureSpec, load_yaml(path), path)
