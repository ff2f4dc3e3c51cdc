"""Read dataset.yaml and report every mistake in it.  Files that are unsafe to read are refused by `yaml_file`."""

from collections.abc import Callable, Mapping
from itertools import islice
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.remedies import remedy_of
from thesis_lib.datasets.format.validate import ValidationReport
from thesis_lib.foundation.mistakes import Mistake, dotted, found, mistakes_in
from thesis_lib.foundation.regular_file import FileProblem
from thesis_lib.foundation.yaml_file import read_yaml

FILE = "dataset.yaml"
MAX_REPORTED = 1000  # mistakes; each unknown key costs a search for a similar known key
Model = TypeVar("Model", bound=BaseModel)


def load_header(folder: Path, report: ValidationReport) -> tuple[Header | SpaceHeader | None, dict]:
    """Header of the dataset in `folder`, and the raw mapping in its file; problems go to `report`.

    The header is None if it has faults; the mapping is {} if the file contains none.
    """
    if not (folder / FILE).exists():
        report.error(FILE, "", "the file is missing", "write it (README, 'Your own drops'), or use the init command")
        return None, {}
    raw, lines = mapping_in(folder, FILE, report)
    return (None, {}) if raw is None else (header_of(raw, report, folder, lines), raw)


def mapping_in(folder: Path, file: str, report: ValidationReport) -> tuple[dict | None, Mapping[tuple, int]]:
    """The mapping in a file (None if there is none) and the line of each key; problems go to `report`."""
    try:
        document = read_yaml(folder / file, folder, aliases=False)
    except FileProblem as error:
        report.error(file, error.where, error.what, error.remedy)
        return None, {}
    lines, raw = document.lines, document.content
    for key, line in document.repeated:
        where, what = f"line {line}, {dotted(key)}", f"the key occurs twice (first in line {lines[key]})"
        report.error(file, where, what, "keep one of them")
    if not isinstance(raw, dict):
        kind = "empty" if raw is None else f"a {type(raw).__name__}"
        report.error(
            file, "", f"is {kind}, not a mapping of keys to values", "start with 'schema: 1' on a line of its own"
        )
        return None, {}
    return raw, lines


def header_of(
    raw: Mapping, report: ValidationReport, folder: Path | None = None, lines: Mapping[tuple, int] | None = None
) -> Header | SpaceHeader | None:
    """Header made from the keys of dataset.yaml; None if they have faults, which go to `report`.

    `folder` contains the file of a mesh; `lines` gives the line of each key in the file.
    """
    schema, lines = schema_of(raw), lines or {}
    if "schema" in raw and (type(raw["schema"]), raw["schema"]) != (int, schema):
        where = f"line {lines['schema',]}, schema" if ("schema",) in lines else "schema"
        remedy = "write 'schema: 1' for a motion in a plane, 'schema: 2' for one in space"
        report.error(FILE, where, f"is {found(raw['schema'])}, but must be 1 or 2", remedy)
        return None
    model = SpaceHeader if schema == 2 else Header
    return validated(raw, lines, FILE, model, report, remedy_of(schema), {"folder": folder})


def schema_of(raw: Mapping) -> int:
    """Schema of a header: 2 for a body in space, else 1."""
    return 2 if raw.get("schema") == 2 else 1


def states_schema(raw: Mapping) -> bool:
    """Whether dataset.yaml can be read and its schema, 1 if the key is missing, is one of this format."""
    return bool(raw) and type(schema := raw.get("schema", 1)) is int and schema in (1, 2)


def validated(
    raw: Mapping,
    lines: Mapping[tuple, int],
    file: str,
    model: type[Model],
    report: ValidationReport,
    remedy: Callable[[Mistake], str],
    context: Mapping[str, object] | None = None,
) -> Model | None:
    """The mapping `raw` as a valid `model`; None if it has faults, which go to `report`.

    `lines` gives the line of each key, `remedy` advice on a mistake, `context` further data for checks of the model.
    """
    try:
        return model.model_validate(raw, context=dict(context or {}))
    except ValidationError as error:
        for mistake in islice(mistakes_in(error, raw, lines, model.model_json_schema()), MAX_REPORTED):
            key = dotted(mistake.place)
            where = key if mistake.line is None else f"line {mistake.line}, {key}"
            report.error(file, where, mistake.what, remedy(mistake))
        if (more := error.error_count() - MAX_REPORTED) > 0:
            report.error(file, "", f"{more:,} further keys or values are wrong", "correct the others first")
        return None


def salvage_shape(raw: Mapping) -> Shape | None:
    """The shape in a header that may have faults elsewhere, so that lengths can still be checked."""
    try:
        return TypeAdapter(Shape).validate_python(_shape_in(raw))
    except ValidationError:
        return None


def is_round(raw: Mapping) -> bool:
    """Whether the shape is a disk or a sphere, whose contact point does not depend on its orientation."""
    shape = _shape_in(raw)
    return isinstance(shape, Mapping) and shape.get("kind") == ("sphere" if schema_of(raw) == 2 else "disk")


def _shape_in(raw: Mapping) -> object:
    body = raw.get("body")
    return body.get("shape") if isinstance(body, Mapping) else None
