"""Tables of all keys of the configuration and of dataset and recording headers, from the models that validate them."""

import json
import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic.fields import FieldInfo

from thesis_lib.foundation.markdown import code, table
from thesis_lib.foundation.settings import Section

PLAIN = {int: "whole number", float: "number", str: "text", bool: "true or false", Any: "anything"}
LIMITS = {
    **{Ge: ("≥", "ge"), Gt: (">", "gt"), Le: ("≤", "le"), Lt: ("<", "lt")},
    **{MinLen: ("at least", "min_length"), MaxLen: ("at most", "max_length")},
}
LONGEST = 120  # largest number of characters of a default in a table


def text() -> str:
    """All sections as Markdown, in the order of the configuration."""
    from thesis_lib.thesis.config import Config

    return "\n\n".join(_sections("", Config()))


def header_text(header: type[Section]) -> str:
    """Table of all keys of a header with their defaults; of alternative sections, the first one's keys come first."""
    return table(("key", "needed", "kind", "meaning"), _header_rows("", header))


def _header_rows(path: str, section: type[Section], within: str = "") -> Iterator[tuple[str, str, str, str]]:
    """Rows of the keys of a section; `within`: the section's own key, if it may be absent."""
    for name, field in section.model_fields.items():
        key = f"{path}{field.alias or name}"
        if name == "shape":
            yield code(key), "yes", "see above", "m, in the frame of the body"
        elif inner := _sections_in(field.annotation):
            if listed := key == "surfaces":
                yield code(key), "no", "list", field.description or ""
            for one in inner:
                own = "" if field.is_required() else code(key)
                yield from _header_rows(f"{key}{'[]' * listed}.", one, own)
        else:
            needed = f"yes, within {within}".removesuffix(", within ") if field.is_required() else "no"
            if not field.is_required() and field.default not in (None, ""):
                number = isinstance(field.default, (int, float)) and not isinstance(field.default, bool)
                needed += f", default {f'{field.default:g}' if number else json.dumps(field.default)}"
            yield code(key), needed, kind(field).removesuffix(" or null"), field.description or ""


def kind(field: FieldInfo) -> str:
    """The values that a key accepts, in words, with their limits."""
    return " ".join(filter(None, (_kind(field.annotation), _limits(field.metadata))))


def _sections(path: str, values: Section) -> Iterator[str]:
    """A section with its defaults: plain keys as a table, followed by the inner sections."""
    title = f"## `{path}`" if path else "## Top level"
    intro = (type(values).__doc__ or "").strip().split("\n\n")[0].replace("\n    ", " ")
    fields = type(values).model_fields
    inner = [name for name, field in fields.items() if _section_of(field.annotation)]
    rows = [
        (code(name), _default(getattr(values, name)), kind(field), field.description or "")
        for name, field in fields.items()
        if name not in inner
    ]
    yield f"{title}\n\n{intro}" + (f"\n\n{table(('key', 'default', 'kind', 'meaning'), rows)}" if rows else "")
    for name in inner:
        yield from _sections(f"{path}.{name}".lstrip("."), getattr(values, name))


def _section_of(annotation: Any) -> type[Section] | None:
    """The section that a key holds, or None; in the configuration no list or dictionary holds sections."""
    return annotation if isinstance(annotation, type) and issubclass(annotation, Section) else None


def _sections_in(annotation: Any) -> list[type[Section]]:
    if section := _section_of(annotation):
        return [section]
    return [section for part in get_args(annotation) for section in _sections_in(part)]


def _default(value: Any) -> str:
    if isinstance(value, Section):
        value = value.model_dump(mode="json")
    written = json.dumps(_readable(value), ensure_ascii=False, default=str)
    return code(written if len(written) <= LONGEST else f"{written[: LONGEST - 2]} …")


def _readable(value: Any) -> Any:
    """The value with derived numbers (π, a radius of gyration) rounded to six digits."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: _readable(inner) for key, inner in value.items()}
    return [_readable(inner) for inner in value] if isinstance(value, list | tuple) else value


def _kind(annotation: Any) -> str:
    if annotation in PLAIN:
        return PLAIN[annotation]
    if section := _section_of(annotation):
        return "a section: " + ", ".join(map(code, section.model_fields))
    origin, inner = get_origin(annotation), get_args(annotation)
    if annotation is type(None):
        return "null"
    if origin is Annotated:
        first, *limits = inner
        if isinstance(limits[0], FieldInfo):
            limits = [*limits[0].metadata, *limits[1:]]
        return " ".join(filter(None, (_kind(first), _limits(limits))))
    if origin is Literal:
        return " or ".join(code(json.dumps(value).strip('"')) for value in inner)
    if origin in (Union, types.UnionType):
        return " or ".join(_kind(part) for part in inner)
    if origin is dict:
        return f"{_kind(inner[0])}: {_kind(inner[1])}"
    if origin in (tuple, list):
        if inner[-1] is Ellipsis or origin is list:
            return f"list of {_kind(inner[0])}"
        return f"{len(inner)} × {_kind(inner[0])}" if len(set(inner)) == 1 else ", ".join(map(_kind, inner))
    raise TypeError(f"a key of the configuration has the type {annotation!r}; add a description of it to PLAIN")


def _limits(metadata: Any) -> str:
    return ", ".join(
        f"{sign} {getattr(limit, attribute):g}"
        for limit in metadata
        for of_kind, (sign, attribute) in LIMITS.items()
        if isinstance(limit, of_kind)
    )
