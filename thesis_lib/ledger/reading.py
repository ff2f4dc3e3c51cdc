"""Strict reading of YAML and CSV; one error lists every mistake.

YAML is validated by a pydantic model.  Each mistake is listed with its line and place; list entries are named by
their `id` if they have one.  CSV cells stay text until a number is asked for: pandas would turn a law called "NA"
into NaN and rename the second of two columns of the same name.
"""

import csv
import io
import math
from collections import Counter
from collections.abc import Container, Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Self, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, StringConstraints, ValidationError

from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.foundation.files import read_json
from thesis_lib.foundation.mistakes import Mistake, dotted, mistakes_in
from thesis_lib.foundation.regular_file import FileProblem, MissingFile, read_bytes
from thesis_lib.foundation.yaml_file import Document, Key, read_yaml

SHOWN = 100  # mistakes listed in full
MAX_CSV = 30_000_000  # bytes; in memory, lists of cells take about thirty times as much


def _not_a_flag(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("a number is wanted here, not true or false")
    return value


def _inside_results(value: str) -> str:
    path = PurePosixPath(value)
    if path.is_absolute() or ".." in path.parts or "\\" in value or path.suffix != ".csv":
        raise ValueError("a .csv file below the results folder is wanted, e.g. chapter3/table_3_1.csv")
    return value


Number = Annotated[float, BeforeValidator(_not_a_flag), Field(allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]+$")]
CsvFile = Annotated[str, AfterValidator(_inside_results)]

Model = TypeVar("Model", bound=BaseModel)


def load_yaml(path: str | Path) -> Document:
    """The content of a YAML file and the lines of its keys.

    UserError if the file is missing, is not plain YAML, or repeats a key (YAML would keep only the last).
    """
    document = read_yaml(path)
    document.refuse_repeated(path)
    return document


def validate(
    model: type[Model],
    document: Document,
    path: str | Path,
    problems: Sequence[str] = (),
    elsewhere: Container[Key] = (),
) -> Model:
    """The content of a document as an instance of `model`; UserError with a line for each mistake.

    problems: mistakes already known, which join the same error.  elsewhere: places, e.g. ("claims", 3, "check"), whose
    mistakes are reported at another place.
    """
    mistakes = list(problems)
    try:
        value = model.model_validate(document.content)
        if not mistakes:
            return value
    except ValidationError as error:
        found = mistakes_in(error, document.content, document.lines, model.model_json_schema())
        mistakes += [_sentence(mistake, document.content) for mistake in found if mistake.place[:3] not in elsewhere]
    count = f"{len(mistakes)} mistake{'s' if len(mistakes) > 1 else ''}"
    more = [f"... and {len(mistakes) - SHOWN} more"] if len(mistakes) > SHOWN else []
    raise UserError("\n- ".join([f"{path} has {count}:", *mistakes[:SHOWN], *more]))


def _sentence(mistake: Mistake, content: Any) -> str:
    """A mistake as "line 17: claim x: check.tolerance is 0, but must be above 0"."""
    at, place = [f"line {mistake.line}"] * bool(mistake.line), mistake.place
    claim = content["claims"][place[1]] if place[:1] == ("claims",) and len(place) > 1 else None
    if isinstance(claim, dict) and "id" in claim:
        at, place = [*at, f"claim {claim['id']}"], place[2:]
    said = mistake.of(dotted(place) or ("" if claim else "the whole file"))
    missing = f" ({mistake.meaning})" if mistake.meaning and mistake.what == "the key is missing" else ""
    return ": ".join([*at, said + missing])


class Cells:
    """A CSV table whose cells are text."""

    def __init__(self, path: Path, columns: list[str], rows: list[list[str]]) -> None:
        self.path, self.columns, self.rows = path, columns, rows

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read a CSV with one header line.

        UserError if the file is missing; CorruptFileError if it is empty or not UTF-8, repeats a column, or has a row
        of another length.
        """
        path = Path(path)
        try:
            text = read_bytes(path, MAX_CSV).decode("utf-8")
            lines = [line for line in csv.reader(io.StringIO(text, newline=""), strict=True) if line]
        except MissingFile as error:
            raise UserError(f"{path} does not exist; run the rule that makes it (snakemake {path}).") from error
        except (FileProblem, csv.Error, UnicodeDecodeError) as error:
            reason = error.what if isinstance(error, FileProblem) else error
            raise CorruptFileError(f"{path} cannot be read ({reason}); delete it and run again.") from error
        if not lines:
            raise CorruptFileError(f"{path} is empty; delete it and run again.")
        columns, rows = lines[0], lines[1:]
        twice = sorted(name for name, count in Counter(columns).items() if count > 1)
        if twice:
            raise CorruptFileError(f"{path} has two columns called {', '.join(twice)[:200]}; delete it and run again.")
        for i, row in enumerate(rows):
            if len(row) != len(columns):
                cells = f"{len(row)} cells under {len(columns)} columns"
                raise CorruptFileError(f"{path}, data row {i}: {cells}; delete it and run again.")
        return cls(path, columns, rows)

    def column(self, name: str) -> list[str]:
        """The cells of one column; UserError if there is none of this name."""
        if name not in self.columns:
            raise UserError(f"{self.path} has no column {name!r}; it has {', '.join(self.columns)}.")
        index = self.columns.index(name)
        return [row[index] for row in self.rows]


def number(cell: str) -> float:
    """The number in a cell; an empty cell is NaN, ValueError for anything else."""
    return float(cell) if cell.strip() else math.nan


def read_present(path: str | Path) -> dict[str, bool]:
    """Whether this run had each dataset, from a file like {"planar_impact": {"present": true, ...}, ...}.

    UserError if the file is missing or has another form.
    """
    content = read_json(path)
    if not all(isinstance(entry, dict) and isinstance(entry.get("present"), bool) for entry in content.values()):
        wanted = '{"planar_impact": {"present": true}}, one entry for each dataset'
        raise CorruptFileError(f"{path} should look like {wanted}; delete it and run again.")
    return {name: entry["present"] for name, entry in content.items()}
