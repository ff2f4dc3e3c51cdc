"""Mistakes that pydantic finds in a file, as messages: their place, the values that are allowed, and the known keys.

The messages are used for all files that users write (header of a dataset, recording, configuration, claims).
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from thesis_lib.foundation.errors import suggest

LONGEST = 60  # characters of a value that are shown
MOST_HOMES = 3  # sections that are suggested for a key
Place = tuple[str | int, ...]
Schema = Mapping[str, Any]


@dataclass(frozen=True)
class Mistake:
    """A mistake in a file.

    `line` is that of the nearest key around it, None if there is none; `remedy` is "" if it does not follow from the
    mistake; `meaning` is the description of the key, "" if there is none.
    """

    place: Place
    line: int | None
    what: str
    remedy: str
    meaning: str

    def of(self, key: str) -> str:
        """The mistake as a sentence about `key`, with the remedy."""
        verb = " " if self.what.startswith("is ") else ": "
        return f"{key}{verb if key else ''}{self.what}" + (f"; {self.remedy}" if self.remedy else "")


def mistakes_in(
    error: ValidationError, content: Any, lines: Mapping[Place, int], schema: Mapping[str, Any]
) -> Iterator[Mistake]:
    """The mistakes in a file with `content`; `lines` are the lines of its keys, `schema` is the JSON schema of it."""
    for entry in error.errors(include_url=False):
        place = _place(entry["loc"], content)
        meaning = next((node["description"] for node in _nodes(schema, entry["loc"]) if "description" in node), "")
        # the line of the key, or of the nearest enclosing key; None for the whole file
        line = next((lines[place[:n]] for n in range(len(place), 0, -1) if place[:n] in lines), None)
        yield Mistake(place, line, *_said(entry, schema), meaning)


def _place(loc: Place, content: Any) -> Place:
    """A place without the kinds of sections that pydantic puts between keys."""
    place: Place = ()
    for depth, part in enumerate(loc, 1):
        if isinstance(content, dict):
            inside = part in content
        else:
            inside = isinstance(content, list) and part in range(len(content))
        if inside or depth == len(loc) or not isinstance(content, dict):
            place += (part,)
            content = content[part] if inside else None  # pyright: ignore[reportCallIssue, reportArgumentType]
    return place


def _said(entry: Any, schema: Schema) -> tuple[str, str]:
    """Message on the fault, and on the remedy if that is known."""
    context = entry.get("ctx", {})
    kind = str(context.get("discriminator", "")).strip("'")
    match entry["type"]:
        case "extra_forbidden":
            return "unknown key", unknown_key(entry["loc"], schema)
        case "missing":
            return "the key is missing", ""
        case "union_tag_not_found":
            return f"the key {kind} is missing", ""
        case "union_tag_invalid":
            tag, known = context["tag"], re.findall(r"'([^']*)'", context["expected_tags"])
            return f"{kind} is '{tag}', but must be {' or '.join(known)}", suggest(tag, known)
        case _:
            return wrong_value(entry), ""


def dotted(place: Place) -> str:
    """A place in the usual notation: surfaces[0].normal."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")


def found(value: object) -> str:
    """A value as found in the file, cut to `LONGEST` characters."""
    text = repr(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def message(mistake: Mapping[str, Any]) -> str:
    """The plain message of an entry of `ValidationError.errors()`."""
    return str(mistake["msg"]).removeprefix("Value error, ")


def wrong_value(mistake: Mapping[str, Any]) -> str:
    """Message on a wrong value, from an entry of `ValidationError.errors()`."""
    context = mistake.get("ctx", {})
    must_be = {
        "greater_than": f"above {context.get('gt')}",
        "greater_than_equal": f"{context.get('ge')} or more",
        "less_than": f"below {context.get('lt')}",
        "less_than_equal": f"{context.get('le')} or less",
        **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
        "finite_number": "a finite number",
        **dict.fromkeys(("float_parsing", "float_type"), "a number"),
        **dict.fromkeys(("int_parsing", "int_type", "int_from_float"), "a whole number"),
        "literal_error": context.get("expected"),
        "string_type": "text",
        **dict.fromkeys(("tuple_type", "list_type"), "a list"),
        **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "a mapping of keys to values"),
    }.get(mistake["type"])
    if must_be:
        return f"is {found(mistake.get('input'))}, but must be {must_be}"
    # YAML has no tuples
    text = message(mistake).replace("Tuple", "List").replace("tuple", "list")
    shown = mistake.get("input")
    return text if isinstance(shown, dict | list) else f"is {found(shown)}: {text}"


def unknown_key(place: Place, schema: Schema) -> str:
    """Advice on an unknown key: a similar key, the right section for it, or the keys of its section.

    `schema`: the JSON schema of the whole file.
    """
    # pydantic names the kind of a section as one part of its place
    plains = (plain for node in _nodes(schema, place[:-1]) for plain in _plain(schema, node))
    name, known = str(place[-1]), list(dict.fromkeys(key for plain in plains for key in plain.get("properties", {})))
    if question := suggest(name, known):
        return question
    if homes := [home for home, keys in _sections(schema, schema, ()) if name in keys]:
        names = list(dict.fromkeys(dotted(home) or "the top level" for home in homes))
        return f"it belongs under {' or '.join(names[:MOST_HOMES])}"
    return f"remove it; known keys here: {', '.join(known)}"


def _nodes(schema: Schema, place: Place) -> list[Schema]:
    """The parts of a schema that describe the value at a place."""
    nodes = [schema]
    for part in place:
        nodes = [child for node in nodes for child in _children(schema, node, part)]
    return nodes


def _children(schema: Schema, node: Schema, part: str | int) -> list[Schema]:
    if part in (kinds := node.get("discriminator", {}).get("mapping", {})):
        return [{"$ref": kinds[part]}]
    children = []
    for plain in _plain(schema, node):
        if isinstance(part, int):
            children += [*plain.get("prefixItems", ())[part : part + 1], plain.get("items")]
        else:
            children.append(plain.get("properties", {}).get(part, plain.get("additionalProperties")))
    return [child for child in children if isinstance(child, Mapping)]


def _plain(schema: Schema, node: Schema) -> list[Schema]:
    """The alternatives of a node, without references."""
    if "$ref" in node:
        return _plain(schema, schema["$defs"][node["$ref"].rpartition("/")[2]])
    alternatives = [*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())]
    return [plain for child in alternatives for plain in _plain(schema, child)] or [node]


def _sections(schema: Schema, node: Schema, place: Place) -> Iterator[tuple[Place, Schema]]:
    """Each section below a node, by its place, with its keys."""
    for plain in _plain(schema, node):
        if properties := plain.get("properties", {}):
            yield place, properties
        for key, child in properties.items():
            yield from _sections(schema, child, (*place, key))
        if isinstance(items := plain.get("items"), Mapping):
            yield from _sections(schema, items, place)
