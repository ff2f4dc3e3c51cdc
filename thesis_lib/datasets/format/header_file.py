"""Read dataset.yaml and report every mistake in it.  `yaml_file` refuses what is unsafe to read."""

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
MAX_REPORTED = 1000  # mistakes; for each unknown key the known ones are searched for a similar one
Model = TypeVar("Model", bound=BaseModel)


def load_header(folder: Path, report: ValidationReport) -> tuple[Header | SpaceHeader | None, dict]:
    """Header of the dataset in `folder` and its raw mapping; problems go to `report`.

    The header is None if something is wrong; the mapping is {} if the file holds none.
    """
    if not (folder / FILE).exists():
        report.error(FILE, "", "the file is missing", "write it (README, 'Your own drops'), or use the init command")
        return None, {}
    raw, lines = mapping_in(folder, FILE, report)
    return (None, {}) if raw is None else (header_of(raw, report, folder, lines), raw)


def mapping_in(folder: Path, file: str, report: ValidationReport) -> tuple[dict | None, Mapping[tuple, int]]:
    """The mapping that a file holds, None if it holds none, and the line of each key; problems go to `report`."""
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
    """Header with the keys of dataset.yaml, None if something is wrong; problems go to `report`.

    `folder` is where a mesh lies, `lines` say where each key stands in the file.
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
    """2 for a body in space, else 1."""
    return 2 if raw.get("schema") == 2 else 1


def validated(
    raw: Mapping,
    lines: Mapping[tuple, int],
    file: str,
    model: type[Model],
    report: ValidationReport,
    remedy: Callable[[Mistake], str],
    context: Mapping[str, object] | None = None,
) -> Model | None:
    """The model of a mapping, None if something is wrong; `lines`: where each key stands in the file.

    `remedy` says what to do about a mistake, `context` is for checks of the model that look beyond the file.
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
    """The shape from a header that is wrong elsewhere, so that lengths can still be judged."""
    try:
        return TypeAdapter(Shape).validate_python(_shape_in(raw))
    except ValidationError:
        return None


def is_round(raw: Mapping) -> bool:
    """Whether the shape is a disk or a sphere, whose turning moves no contact point."""
    shape = _shape_in(raw)
    return isinstance(shape, Mapping) and shape.get("kind") == ("sphere" if schema_of(raw) == 2 else "disk")


def _shape_in(raw: Mapping) -> object:
    body = raw.get("body")
    return body.get("shape") if isinstance(body, Mapping) else None
