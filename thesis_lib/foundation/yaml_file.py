"""YAML from users: plain values only, bounded in size, nesting and use of aliases, with the line of every key.

The library recurses into nested values, and a few lines of aliases can unfold into gigabytes, so both are bounded
before any value is built.  YAML silently keeps the last of repeated keys; they are listed for the caller to refuse.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from thesis_lib.foundation.errors import UserError, first_line
from thesis_lib.foundation.regular_file import FileProblem, read_bytes

MAX_BYTES = 1_000_000  # the largest file of this project, config/claims/chapter3.yaml, has 80 kB
MAX_DEPTH = 20  # the deepest legitimate nesting is 6
MAX_NODES = 200_000  # keys and values with aliases expanded; chapter 3's claims have some 5,000
# libyaml is ten times faster, if PyYAML was built with it
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

Key = tuple[str | int, ...]


@dataclass
class Document:
    """The content of a YAML file: mappings, lists and plain values.

    Attributes:
        lines: line of each key and list item, by its place, e.g. ("body", "vertices", 0).
        repeated: (place, line) of each repeated key of a mapping.
        nodes: number of keys and values with aliases expanded.
    """

    content: Any = None
    lines: dict[Key, int] = field(default_factory=dict)
    repeated: list[tuple[Key, int]] = field(default_factory=list)
    nodes: int = 0

    def refuse_repeated(self, path: str | Path) -> None:
        """Raise a UserError with the lines of repeated keys, of which YAML would silently keep the last."""
        if self.repeated:
            said = "the key '{}' occurs in line {} and again in line {}"
            repeats = [said.format(key[-1], self.lines[key], line) for key, line in self.repeated]
            more = f"; and {len(repeats) - 20} more" if len(repeats) > 20 else ""
            raise UserError(f"{path}: {'; '.join(repeats[:20])}{more}. Keep one of them.")


def read_yaml(path: str | Path, within: str | Path | None = None, aliases: bool = True) -> Document:
    """The content of a YAML file; `within` as in `regular_size`, `aliases`: whether they are allowed.

    FileProblem if it cannot be read, is not YAML of plain values in UTF-8, or exceeds the bounds.
    """
    try:
        return _parse(path, read_bytes(path, MAX_BYTES, within).decode("utf-8-sig"), aliases)
    except FileProblem:
        raise
    except UnicodeDecodeError as error:
        raise FileProblem(path, "is not UTF-8 text", "save it as UTF-8") from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        what = f"is not valid YAML ({error.problem})"
        raise FileProblem(path, what, "check indentation, colons and brackets there", where) from error
    except Exception as error:  # the library raises errors of many kinds: 2020-99-99, !!int '', !!bool x
        remedy = "check it for odd characters and values"
        raise FileProblem(path, f"is not valid YAML ({first_line(error)})", remedy) from error


def _parse(path: str | Path, text: str, aliases: bool) -> Document:
    depth = 0
    for event in yaml.parse(text, Loader=LOADER):
        if isinstance(event, yaml.AliasEvent) and not aliases:
            where, what = f"line {event.start_mark.line + 1}", "uses a YAML alias (*name)"
            raise FileProblem(path, what, "write the value out where it is needed", where)
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            _refuse_nesting(path, event)
    loader = LOADER(text)
    try:
        node = loader.get_single_node()
        document = Document()
        if node is not None:
            _locate(path, node, (), document)
            document.content = loader.construct_document(node)
        return document
    finally:
        loader.dispose()


def _refuse_nesting(path: str | Path, place: yaml.Event | yaml.Node) -> None:
    what = f"is nested more than {MAX_DEPTH} levels deep"
    raise FileProblem(path, what, "follow the documented format", f"line {place.start_mark.line + 1}")


def _locate(path: str | Path, node: yaml.Node, at: Key, document: Document) -> None:
    """Visit all nodes with aliases expanded: record lines and repeated keys, check the bounds."""
    document.nodes += 1
    if document.nodes > MAX_NODES:
        what = f"contains more than {MAX_NODES:,} keys and values, with aliases expanded"
        raise FileProblem(path, what, "follow the documented format")
    if len(at) > MAX_DEPTH:  # an alias inside its own value
        _refuse_nesting(path, node)
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            where = (*at, key.value if isinstance(key.value, str) else "?")
            line = key.start_mark.line + 1
            if where in seen and key.tag != "tag:yaml.org,2002:merge":
                document.repeated.append((where, line))
            seen.add(where)
            document.lines.setdefault(where, line)
            _locate(path, value, where, document)
    elif isinstance(node, yaml.SequenceNode):
        for i, value in enumerate(node.value):
            document.lines[(*at, i)] = value.start_mark.line + 1
            _locate(path, value, (*at, i), document)
