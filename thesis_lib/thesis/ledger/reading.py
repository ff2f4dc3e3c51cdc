"""Strict reading of YAML, with one error that lists every mistake.

YAML is validated by a pydantic model.  Each mistake is listed with its line and place; list entries are identified by
their `id` if they have one.
"""

import math
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, StringConstraints, ValidationError

from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.foundation.files import read_json
from thesis_lib.foundation.mistakes import Mistake, dotted, mistakes_in
from thesis_lib.foundation.yaml_file import Document, read_yaml

SHOWN = 100  # mistakes listed in full


def _not_a_flag(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("expected a number, not true or false")
    return value


def _inside_results(value: str) -> str:
    path = PurePosixPath(value)
    if path.is_absolute() or ".." in path.parts or "\\" in value or path.suffix != ".csv":
        raise ValueError("expected a .csv file below the results folder, e.g. chapter3/table_3_1.csv")
    return value


Number = Annotated[float, BeforeValidator(_not_a_flag), Field(allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]+$")]
CsvFile = Annotated[str, AfterValidator(_inside_results)]

Model = TypeVar("Model", bound=BaseModel)


def load_yaml(path: str | Path) -> Document:
    """Read the content of a YAML file and the lines of its keys.

    UserError if the file is missing, is not plain YAML, or repeats a key (of which YAML would keep only the last).
    """
    document = read_yaml(path)
    document.refuse_repeated(path)
    return document


def validate(model: type[Model], document: Document, path: str | Path) -> Model:
    """Return the content of a document as an instance of `model`; UserError with a line for each mistake.

    Mistakes that aliases repeat are listed once.
    """
    try:
        return model.model_validate(document.content)
    except ValidationError as error:
        found: dict[tuple, Mistake] = {}
        for mistake in mistakes_in(error, document.content, document.lines, model.model_json_schema()):
            found.setdefault((mistake.line, mistake.what, *mistake.place[-1:]), mistake)
    mistakes = [_sentence(mistake, document.content) for mistake in found.values()]
    count = f"{len(mistakes)} mistake{'s' if len(mistakes) > 1 else ''}"
    more = [f"... and {len(mistakes) - SHOWN} more"] if len(mistakes) > SHOWN else []
    raise UserError("\n- ".join([f"{path} has {count}:", *mistakes[:SHOWN], *more]))


def _sentence(mistake: Mistake, content: Any) -> str:
    """Describe a mistake, as in "line 17: claim x: check.tolerance is 0, but must be above 0"."""
    at, place = [f"line {mistake.line}"] * bool(mistake.line), mistake.place
    claim = content["claims"][place[1]] if place[:1] == ("claims",) and len(place) > 1 else None
    if isinstance(claim, dict) and "id" in claim:
        at, place = [*at, f"claim {claim['id']}"], place[2:]
    said = mistake.of(dotted(place) or ("" if claim else "the whole file"))
    missing = f" ({mistake.meaning})" if mistake.meaning and mistake.what == "the key is missing" else ""
    return ": ".join([*at, said + missing])


def number(cell: str) -> float:
    """Return the number in a cell; an empty cell is NaN; ValueError for anything else."""
    return float(cell) if cell.strip() else math.nan


def read_present(path: str | Path) -> dict[str, bool]:
    """Read whether this run had each dataset, from a file like {"planar_impact": {"present": true, ...}, ...}.

    UserError if the file is missing or has a wrong form.
    """
    content = read_json(path)
    if not all(isinstance(entry, dict) and isinstance(entry.get("present"), bool) for entry in content.values()):
        wanted = '{"planar_impact": {"present": true}}, one entry for each dataset'
        raise CorruptFileError(f"{path} should look like {wanted}; delete it and run again.")
    return {name: entry["present"] for name, entry in content.items()}
