"""Edits of single numbers in an XML file; every other byte stays as it is.

The file is parsed once, for where its elements begin and end in bytes.  Document types are refused: what they declare
(entities) could unfold to gigabytes or open other files, and no engine's file needs them.  Nothing that the file names
is opened.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import read_bytes

LARGEST = 20_000_000  # bytes; a humanoid's file has 0.1 MB, one with meshes in it a few
DEEPEST = 200  # elements within each other
_START_TAG = re.compile(rb"<(?:[^>\"']|\"[^\"]*\"|'[^']*')*>")
_ATTRIBUTE = re.compile(rb"\s+(?P<name>[^\s=/>]+)\s*=\s*(?P<quote>[\"'])(?P<value>.*?)(?P=quote)", re.S)
_WIDE = (b"\xff\xfe", b"\xfe\xff", b"<\x00", b"\x00<")  # UTF-16, whose bytes are not those of the text


@dataclass(eq=False)
class Element:
    """An element of a file: its bytes are [start, end), its start tag [start, opened), its content [opened, closed)."""

    tag: str
    attributes: dict[str, str]
    line: int
    start: int
    opened: int
    closed: int = 0
    end: int = 0
    parent: "Element | None" = None
    children: list["Element"] = field(default_factory=list)

    def walk(self) -> Iterator["Element"]:
        """This element and all below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    def all(self, tag: str) -> list["Element"]:
        """Children of this tag."""
        return [child for child in self.children if child.tag == tag]

    def find(self, *tags: str) -> "Element | None":
        """The first child of the first tag, of it the first of the next, and so on; None if one is missing."""
        found: Element | None = self
        for tag in tags:
            found = next(iter(found.all(tag)), None) if found else None
        return found


class Edits:
    """A file and the edits to be made in it; all places are those of the file as it was read."""

    def __init__(self, path: str | Path) -> None:
        """Read and parse; UserError if it cannot be read, is no XML, has a document type, or nests too deeply."""
        self.path, self.content = Path(path), read_bytes(path, LARGEST)
        if self.content.startswith(_WIDE):
            raise UserError(f"{path} is not UTF-8 text; save it as UTF-8.")
        self.root = self._parsed()
        self._edits: list[tuple[int, int, bytes]] = []

    # --- reading ---

    def _parsed(self) -> Element:
        parser = expat.ParserCreate()
        open_: list[Element] = []
        roots: list[Element] = []

        def start(tag: str, attributes: dict[str, str]) -> None:
            at = parser.CurrentByteIndex
            match = _START_TAG.match(self.content, at)
            if match is None or len(open_) >= DEEPEST:
                raise UserError(f"{self.path}, line {parser.CurrentLineNumber}: elements nest too deeply.")
            parent = open_[-1] if open_ else None
            element = Element(tag, attributes, parser.CurrentLineNumber, at, match.end(), parent=parent)
            (parent.children if parent else roots).append(element)
            open_.append(element)

        def end(tag: str) -> None:
            element = open_.pop()
            if self.content[element.opened - 2 : element.opened] == b"/>":
                element.closed = element.end = element.opened
            else:
                element.closed = parser.CurrentByteIndex
                element.end = self.content.index(b">", element.closed) + 1

        def refuse(*_: object) -> None:
            raise UserError(f"{self.path} has a document type (<!DOCTYPE ...>); remove it, no model needs one.")

        parser.StartElementHandler, parser.EndElementHandler = start, end
        parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
        try:
            parser.Parse(self.content, True)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            raise UserError(
                f"{self.path} is not XML: {reason} in line {error.lineno}; check it, or give the model's own file."
            ) from error
        except (LookupError, ValueError) as error:  # an unknown encoding
            raise UserError(f"{self.path} is not XML that can be read ({error}); save it as UTF-8.") from error
        return roots[0]

    def text(self, element: Element) -> str:
        """What stands between an element's tags."""
        return self.content[element.opened : element.closed].decode("utf-8", "replace").strip()

    def numbers(self, element: Element, attribute: str = "") -> list[float] | None:
        """Numbers of an attribute, or of the text; None without the attribute.  UserError if they are none."""
        said = element.attributes.get(attribute) if attribute else self.text(element)
        if said is None:
            return None
        try:
            values = [float(word) for word in said.split()]
        except ValueError:
            values = [float("nan")]
        if not all(abs(value) < 1e300 for value in values):
            what = f"{attribute}={said[:60]!r}" if attribute else repr(said[:60])
            raise UserError(f"{self.path}, line {element.line}: <{element.tag}> {what} holds no finite numbers.")
        return values

    # --- editing ---

    def set_attribute(self, element: Element, name: str, value: str) -> None:
        """Write the value of an attribute; add it at the end of the start tag if it is new."""
        found = self._attribute(element, name)
        if found:
            self._edits.append((*found.span("value"), value.encode()))
        else:
            tag = self.content[element.start : element.opened]
            at = element.start + len(tag.rstrip(b">").rstrip(b"/").rstrip())
            self._edits.append((at, at, f' {name}="{value}"'.encode()))

    def set_text(self, element: Element, value: str) -> None:
        """Write an element's text; blanks around the old one stay."""
        old = self.content[element.opened : element.closed]
        if element.opened == element.end:  # <mass/>
            tag = self.content[element.start : element.opened]
            new = tag[:-2].rstrip() + f">{value}</{element.tag}>".encode()
            self._edits.append((element.start, element.end, new))
            return
        left = len(old) - len(old.lstrip())
        self._edits.append((element.opened + left, element.opened + max(left, len(old.rstrip())), value.encode()))

    def add_child(self, element: Element, lines: list[str]) -> None:
        """Add lines of XML as the first child of an element, indented like the others."""
        newline = b"\r\n" if b"\r\n" in self.content else b"\n"
        indent = self._indent(element.children[0]) if element.children else self._indent(element) + b"  "
        text = b"".join(newline + indent + line.encode() for line in lines)
        if element.opened == element.end:
            tag = self.content[element.start : element.opened]
            closing = newline + self._indent(element) + f"</{element.tag}>".encode()
            self._edits.append((element.start, element.end, tag[:-2].rstrip() + b">" + text + closing))
        else:
            self._edits.append((element.opened, element.opened, text))

    def result(self) -> bytes:
        """The file with all edits; two edits of the same bytes are an error of the program."""
        content, last = bytearray(self.content), len(self.content)
        # from the end, so that places before stay right; of insertions at one place the last first
        for i in sorted(range(len(self._edits)), key=lambda i: (*self._edits[i][:2], i), reverse=True):
            start, end, new = self._edits[i]
            assert end <= last, "edits overlap"
            content[start:end] = new
            last = start
        return bytes(content)

    def _attribute(self, element: Element, name: str) -> re.Match[bytes] | None:
        # from attribute to attribute: a name may also stand in the value of another one
        position = element.start + 1 + len(element.tag.encode())
        while found := _ATTRIBUTE.match(self.content, position):
            if found["name"] == name.encode():
                return found
            position = found.end()
        return None

    def _indent(self, element: Element) -> bytes:
        line = self.content.rfind(b"\n", 0, element.start) + 1
        before = self.content[line : element.start]
        return before if not before.strip() else before[: len(before) - len(before.lstrip())]
