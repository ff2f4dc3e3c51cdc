"""Mistakes that pydantic finds in YAML, in words: what a value must be, and which keys there are.

Header and configuration share the words; each adds where the mistake stands and what to do about it.
"""

import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

LONGEST = 60  # characters of a value that are shown
MOST_HOMES = 3  # sections that are named for a key
Place = tuple[str | int, ...]
Schema = Mapping[str, Any]


def dotted(place: Place) -> str:
    """A place as it is written: surfaces[0].normal."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")


def found(value: object) -> str:
    """A value as it was found, cut to `LONGEST` characters."""
    text = repr(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def suggest(name: str, known: Iterable[str]) -> str | None:
    """The known name that a mistyped one resembles, as a question; None if it resembles none."""
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else None


def wrong_value(mistake: Mapping[str, Any]) -> str:
    """What is wrong with a value, by an entry of `ValidationError.errors()`."""
    if mistake["type"] == "missing":
        return "is missing"
    context = mistake.get("ctx", {})
    must_be = {
        "greater_than": f"above {context.get('gt')}",
        "greater_than_equal": f"{context.get('ge')} or more",
        "less_than": f"below {context.get('lt')}",
        "less_than_equal": f"{context.get('le')} or less",
        "bool_type": "true or false",
        "bool_parsing": "true or false",
        "finite_number": "a finite number",
        "float_parsing": "a number",
        "float_type": "a number",
        "int_parsing": "a whole number",
        "int_type": "a whole number",
        "int_from_float": "a whole number",
        "literal_error": context.get("expected"),
        "string_type": "text",
        "tuple_type": "a list",
        "list_type": "a list",
        "dict_type": "a mapping of keys to values",
        "model_type": "a mapping of keys to values",
        "model_attributes_type": "a mapping of keys to values",
    }.get(mistake["type"])
    if must_be:
        return f"is {found(mistake.get('input'))}, but must be {must_be}"
    # YAML has no tuples
    text = str(mistake["msg"]).removeprefix("Value error, ").replace("Tuple", "List").replace("tuple", "list")
    return f"is {found(mistake.get('input'))}: {text}"


def unknown_key(place: Place, schema: Schema) -> str:
    """What to do about an unknown key: a similar key, its true section, or the keys that its section has.

    `schema`: the JSON schema of the whole file.
    """
    name, known = str(place[-1]), keys_at(schema, place[:-1])
    if question := suggest(name, known):
        return question
    if homes := [home for home, keys in _sections(schema, schema, ()) if name in keys]:
        names = list(dict.fromkeys(dotted(home) or "the top level" for home in homes))
        return f"it belongs under {' or '.join(names[:MOST_HOMES])}"
    return f"remove it; known keys here: {', '.join(known)}"


def keys_at(schema: Schema, place: Place) -> list[str]:
    """Keys of the section at `place`, where pydantic names the kind of a section as one part of it."""
    nodes = [schema]
    for part in place:
        nodes = [child for node in nodes for child in _children(schema, node, part)]
    return list(dict.fromkeys(key for node in nodes for plain in _plain(schema, node) for key in _properties(plain)))


def _children(schema: Schema, node: Schema, part: str | int) -> list[Schema]:
    if part in (kinds := node.get("discriminator", {}).get("mapping", {})):
        return [{"$ref": kinds[part]}]
    children = []
    for plain in _plain(schema, node):
        if isinstance(part, int):
            children += [*plain.get("prefixItems", ())[part : part + 1], plain.get("items")]
        else:
            children.append(_properties(plain).get(part, plain.get("additionalProperties")))
    return [child for child in children if isinstance(child, Mapping)]


def _plain(schema: Schema, node: Schema) -> list[Schema]:
    """The alternatives of a node, without references."""
    if "$ref" in node:
        return _plain(schema, schema["$defs"][node["$ref"].rpartition("/")[2]])
    alternatives = [*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())]
    return [plain for child in alternatives for plain in _plain(schema, child)] or [node]


def _properties(node: Schema) -> Schema:
    return node.get("properties", {})


def _sections(schema: Schema, node: Schema, place: Place) -> Iterator[tuple[Place, Schema]]:
    """Each section below a node, by its place, with its keys."""
    for plain in _plain(schema, node):
        if properties := _properties(plain):
            yield place, properties
        for key, child in properties.items():
            yield from _sections(schema, child, (*place, key))
        if isinstance(items := plain.get("items"), Mapping):
            yield from _sections(schema, items, place)
