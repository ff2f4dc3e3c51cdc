"""Read dataset.yaml and report every mistake in it.  `yaml_file` refuses what is unsafe to read."""

from collections.abc import Callable, Mapping
from itertools import islice
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.validate import ValidationReport
from thesis_lib.foundation.mistakes import Mistake, dotted, mistakes_in
from thesis_lib.foundation.regular_file import FileProblem
from thesis_lib.foundation.yaml_file import YamlProblem, read_yaml

FILE = "dataset.yaml"
MAX_REPORTED = 1000  # mistakes; for each unknown key the known ones are searched for a similar one
Model = TypeVar("Model", bound=BaseModel)
# what to do about a wrong or missing value; the nearest enclosing key counts
_REMEDIES = {
    ("schema",): "write 'schema: 1' (the version of the format that this program reads)",
    ("description",): "write free text, in quotes if it holds a colon",
    ("body",): "give the section body with shape and radius_of_gyration",
    ("body", "shape"): "write {kind: ellipse, semi_axes: [a, b]}, {kind: disk, radius: R} or "
    "{kind: polygon, vertices: [[x, y], ...]}, in m from the centre of mass",
    ("body", "mass"): "give the mass in kg as a number above 0, or leave it out",
    ("body", "radius_of_gyration"): "give it in m as a number above 0: sqrt(I/m) about the centre of mass "
    "(a/sqrt(6) for a uniform square of side a)",
    ("body", "homogeneous"): "write true if the body is of one density throughout, or leave it out",
    (
        "body",
        "uncertainty",
    ): "give relative standard uncertainties above 0 and below 1 ({mass: 0.001, size: 0.002}), or leave it out",
    ("surface",): "write {height: 0.0}, the height of the surface in m, or leave it out",
    (
        "surfaces",
    ): "write a list of walls {name: north, point: [x, y], normal: [0, -1]}: a point of the line in m, and the "
    "direction from the wall to the body; names have lower-case letters, digits and _",
    ("gravity",): "give 9.81 in m/s² (positive: it points down by convention), or leave it out; 0 for a motion over a "
    "level table",
    ("rate",): "give the sampling rate in Hz as a number above 0, or leave it out",
    ("noise",): "give one-sigma values above 0 (position in m, angle in rad, velocity in m/s, "
    "angular_velocity in rad/s), or leave noise out",
    ("spin",): "give the spin in rad/s, one sigma, as a number above 0, or leave it out",
    (): "walls need gravity: 0 (a motion over a level table), names of their own, and no surface beside them",
}


def load_header(folder: Path, report: ValidationReport) -> tuple[Header | None, dict]:
    """Header of the dataset in `folder` and its raw mapping; problems go to `report`.

    The header is None if something is wrong; the mapping is {} if the file holds none.
    """
    if not (folder / FILE).exists():
        report.error(FILE, "", "the file is missing", "write it (README, 'Your own drops'), or use the init command")
        return None, {}
    return parsed(folder, FILE, Header, report, _remedy)


def _remedy(mistake: Mistake) -> str:
    enclosing = (mistake.place[:n] for n in range(len(mistake.place), -1, -1))
    return next((_REMEDIES[part] for part in enclosing if part in _REMEDIES), "see the format")


def parsed(
    folder: Path, file: str, model: type[Model], report: ValidationReport, remedy: Callable[[Mistake], str]
) -> tuple[Model | None, dict]:
    """The content of a file as a model, and its raw mapping; problems go to `report`.

    The model is None if something is wrong; the mapping is {} if the file holds none.  `remedy` says what to do where
    the mistake itself does not.
    """
    try:
        document = read_yaml(folder / file, folder, aliases=False)
    except (FileProblem, YamlProblem) as error:
        report.error(file, getattr(error, "where", ""), error.what, error.remedy)
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
    return validated(raw, lines, file, model, report, remedy), raw


def header_of(raw: Mapping, report: ValidationReport) -> Header | None:
    """Header with the keys of dataset.yaml, None if something is wrong; problems go to `report`."""
    return validated(raw, {}, FILE, Header, report, _remedy)


def validated(
    raw: Mapping,
    lines: Mapping[tuple, int],
    file: str,
    model: type[Model],
    report: ValidationReport,
    remedy: Callable[[Mistake], str],
) -> Model | None:
    """The model of a mapping, None if something is wrong; `lines`: where each key stands in the file."""
    try:
        return model.model_validate(raw)
    except ValidationError as error:
        for mistake in islice(mistakes_in(error, raw, lines, model.model_json_schema()), MAX_REPORTED):
            key = dotted(mistake.place)
            where = key if mistake.line is None else f"line {mistake.line}, {key}"
            report.error(file, where, mistake.what, mistake.remedy or remedy(mistake))
        if (more := error.error_count() - MAX_REPORTED) > 0:
            report.error(file, "", f"{more:,} further keys or values are wrong", "correct the others first")
        return None


def salvage_shape(raw: Mapping) -> Shape | None:
    """The shape from a header that is wrong elsewhere, so that lengths can still be judged."""
    body = raw.get("body")
    if not isinstance(body, Mapping):
        return None
    try:
        return TypeAdapter(Shape).validate_python(body.get("shape"))
    except ValidationError:
        return None
