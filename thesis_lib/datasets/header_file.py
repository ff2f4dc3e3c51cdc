"""Read dataset.yaml: safe against hostile files, and with one problem for each thing that is wrong.

The file is small by nature, so its size, its nesting and its use of anchors are bounded before anything is built
from it: an alias makes a few lines unfold into gigabytes.
"""

import difflib
from collections.abc import Mapping
from pathlib import Path

import yaml
from pydantic import BaseModel, TypeAdapter, ValidationError

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon, Shape
from thesis_lib.datasets.header import Body, Header, Noise, Surface
from thesis_lib.datasets.validate import Report

FILE = "dataset.yaml"
MAX_BYTES = 1_000_000  # a polygon of 1000 vertices takes 50 kB
MAX_DEPTH = 20  # the deepest legitimate nesting is 5; the YAML library recurses

SHAPES = {"ellipse": Ellipse, "disk": Disk, "polygon": Polygon}
_SECTIONS: dict[tuple, type[BaseModel]] = {
    (): Header,
    ("body",): Body,
    ("surface",): Surface,
    ("noise",): Noise,
    **{("body", "shape", kind): model for kind, model in SHAPES.items()},
}
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
    ("surface",): "write {height: 0.0}, the height of the surface in m, or leave it out",
    ("gravity",): "give 9.81 in m/s² (positive: it points down by convention), or leave it out",
    ("rate",): "give the sampling rate in Hz as a number above 0, or leave it out",
    ("noise",): "give one-sigma values above 0 (position in m, angle in rad, velocity in m/s, "
    "angular_velocity in rad/s), or leave noise out",
}


def load_header(folder: Path, report: Report) -> tuple[Header | None, dict]:
    """Header of the dataset in `folder` and the raw mapping; problems go to `report`.

    Returns (None, raw) where something is wrong; raw is {} where the file is no mapping.
    """
    path = folder / FILE
    if not path.is_file():
        report.error(
            FILE, "", "the file is missing", "write it (README, 'Your own data'), or use the init command"
        )
        return None, {}
    raw, lines = _parse(path, report)
    if raw is None:
        return None, {}
    try:
        return Header.model_validate(raw), raw
    except ValidationError as error:
        for entry in error.errors(include_url=False, include_context=True):
            _tell(entry, lines, report)
        return None, raw


def salvage_shape(raw: Mapping) -> object | None:
    """The shape from a header that is wrong elsewhere, so that lengths can be judged all the same."""
    body = raw.get("body")
    try:
        return TypeAdapter(Shape).validate_python(body["shape"])
    except (ValidationError, TypeError, KeyError):
        return None


def _parse(path: Path, report: Report) -> tuple[dict | None, dict[tuple, int]]:
    def refuse(where: str, what: str, remedy: str) -> tuple[None, dict]:
        report.error(FILE, where, what, remedy)
        return None, {}

    size = path.stat().st_size
    if size > MAX_BYTES:
        return refuse(
            "", f"has {size:,} bytes; the limit is {MAX_BYTES:,}", "keep measurements out of dataset.yaml"
        )
    try:
        text = path.read_bytes().decode("utf-8-sig")
        depth = 0
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            line = f"line {event.start_mark.line + 1}"
            if isinstance(event, yaml.AliasEvent):
                return refuse(line, "uses a YAML alias (*name)", "write the value out where it is needed")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                return refuse(
                    line, f"is nested more than {MAX_DEPTH} levels deep", "follow the documented format"
                )
        lines: dict[tuple, int] = {}
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        _locate(node, (), lines, report)
        raw = yaml.safe_load(text)
    except UnicodeDecodeError:
        return refuse("", "is not UTF-8 text", "save it as UTF-8")
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        return refuse(
            where, f"is not valid YAML ({error.problem})", "check indentation, colons and brackets there"
        )
    except (yaml.YAMLError, ValueError, OverflowError, TypeError) as error:
        reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        return refuse("", f"is not valid YAML ({reason})", "check it for odd characters and values")
    if not isinstance(raw, dict):
        kind = "empty" if raw is None else f"a {type(raw).__name__}"
        return refuse(
            "", f"is {kind}, not a mapping of keys to values", "start with 'schema: 1' on a line of its own"
        )
    return raw, lines


def _locate(node: yaml.Node | None, at: tuple, lines: dict[tuple, int], report: Report) -> None:
    """Line of every key; duplicated keys are told, because YAML silently keeps the last one."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            where = (*at, key.value if isinstance(key.value, str) else "?")
            if where in lines:
                report.error(
                    FILE,
                    f"line {key.start_mark.line + 1}, {_dotted(where)}",
                    f"the key stands twice (first in line {lines[where]})",
                    "keep one of them",
                )
            lines.setdefault(where, key.start_mark.line + 1)
            _locate(value, where, lines, report)
    elif isinstance(node, yaml.SequenceNode):
        for i, value in enumerate(node.value):
            lines[(*at, i)] = value.start_mark.line + 1
            _locate(value, (*at, i), lines, report)


def _tell(entry: Mapping, lines: Mapping[tuple, int], report: Report) -> None:
    """Turn one finding of pydantic into a problem."""
    loc, kind = tuple(entry["loc"]), entry["type"]
    key = tuple(part for i, part in enumerate(loc) if not (loc[:2] == ("body", "shape") and i == 2))
    line = next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), None)
    where = _dotted(key) if line is None else f"line {line}, {_dotted(key)}"
    if kind == "extra_forbidden":
        report.error(FILE, where, "unknown key", _unknown_key(loc))
        return
    remedy = next(
        (_REMEDIES[key[:n]] for n in range(len(key), 0, -1) if key[:n] in _REMEDIES), "see the format"
    )
    value = _short(entry.get("input"))
    context = entry.get("ctx", {})
    what = {
        "missing": "the key is missing",
        "greater_than": f"is {value}, but must be above {context.get('gt')}",
        "finite_number": f"is {value}, but must be a finite number",
        "float_parsing": f"is {value}, but must be a number",
        "float_type": f"is {value}, but must be a number",
        "literal_error": f"is {value}, but must be {context.get('expected')}",
        "union_tag_not_found": "the key kind is missing",
        "string_type": f"is {value}, but must be text",
    }.get(kind)
    if kind == "union_tag_invalid":
        tag = str(context.get("tag"))
        what = f"kind is '{tag}', which is no shape"
        remedy = _suggest(tag, list(SHAPES)) or remedy
    elif kind in ("model_type", "model_attributes_type"):
        what = f"is {value}, but must be a mapping of keys to values"
    report.error(FILE, where, what or f"is {value}: {entry['msg']}", remedy)


def _unknown_key(loc: tuple) -> str:
    name, section = str(loc[-1]), loc[:-1]
    known = _keys(_SECTIONS.get(section, Header))
    if (hint := _suggest(name, known)) is not None:
        return hint
    for other, model in _SECTIONS.items():
        if name in _keys(model) and other != section:
            home = _dotted(other[:2]) if other else "the top level"
            return f"it belongs under {home}"
    return f"remove it; known keys here: {', '.join(known)}"


def _keys(model: type[BaseModel]) -> list[str]:
    return [field.alias or name for name, field in model.model_fields.items()]


def _suggest(name: str, known: list[str]) -> str | None:
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else None


def _dotted(key: tuple) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key).lstrip(".")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
