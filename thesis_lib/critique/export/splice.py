"""Edit numbers in a user's XML file: only the text of edited elements changes; all other bytes stay as they are.

Edits are made in lxml's tree: attributes set or removed, texts of elements without children, and new children.  They
are found by comparison with the elements as they were read.
"""

import codecs
import re
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import TypeAlias
from xml.parsers import expat

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

Element: TypeAlias = etree._Element
Splice: TypeAlias = tuple[int, int, bytes]  # first and last position, and the replacement
_ATTRIBUTE = re.compile(rb"""\s+([^\s=/>]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_TAG = re.compile(rb"<[^\s/>]+(?:" + _ATTRIBUTE.pattern.replace(b"(", b"(?:").replace(b"(?:?:", b"(?:") + rb")*\s*/?>")
_NOTE = re.compile(rb"<(?:!--|\?)")
_NAMESPACE = re.compile(rb'\s+xmlns(?::\w+)?="[^"]*"')
_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


@dataclass(frozen=True)
class _Read:
    """An element as it was read: positions of its start tag (`start`, `opened`) and end tag (`closes`, `end`) in the
    text, and its attributes and text."""

    element: Element
    start: int
    opened: int
    closes: int
    end: int
    attributes: dict[str, str]
    text: str | None

    @property
    def is_empty(self) -> bool:
        """Whether the element consists of a single tag."""
        return self.opened == self.end


class Source:
    """The bytes of a file, and its tree as read by lxml."""

    def __init__(self, content: bytes, root: Element) -> None:
        """LookupError if the encoding of the file is unknown, ValueError if tags are not where lxml found them."""
        stated = root.getroottree().docinfo.encoding or "utf-8"
        self._encoding = next((name for mark, name in _MARKS.items() if content.startswith(mark)), stated)
        self._text = content.decode(self._encoding).encode()
        elements = list(root.iter("*"))
        self._read = {
            element: _Read(element, *places, dict(element.attrib), element.text)
            for element, places in zip(elements, _places(self._text), strict=True)
        }
        self._root, self._declared = elements[0], b""

    def declare(self, prefix: str, namespace: str) -> None:
        """Declare the namespace of new elements at the root."""
        self._declared = f' xmlns:{prefix}="{namespace}"'.encode()

    def content(self) -> bytes:
        """Return the file with the edits that were made in its tree."""
        splices = [splice for read in self._read.values() for splice in self._edits(read)]
        parts, done = [], 0
        for first, last, new in sorted(splices, key=lambda splice: splice[:2]):
            parts += [self._text[done:first], new]
            done = last
        return b"".join([*parts, self._text[done:]]).decode().encode(self._encoding)

    def _edits(self, read: _Read) -> Iterator[Splice]:
        yield from self._of_tag(read)
        inside = b""
        if read.element.text != read.text:
            inside = (read.element.text or "").encode()
            if not read.is_empty:
                noted = _NOTE.search(self._text, read.opened, read.closes)
                yield read.opened, noted.start() if noted else read.closes, inside
        for child in read.element:
            if child not in self._read and isinstance(child.tag, str):
                elder = (self._read[one] for one in child.itersiblings(preceding=True) if one in self._read)
                before, blank = next(elder, None), self._blank(read)
                inside += blank + _written(child, blank)
                if not read.is_empty:
                    place = before.end if before else read.opened
                    yield place, place, blank + _written(child, blank)
        if read.is_empty and inside:
            name = re.match(rb"<([^\s/>]+)", self._text[read.start : read.opened])
            assert name is not None
            yield read.opened - 2, read.opened, b">" + inside + b"</" + name[1] + b">"

    def _of_tag(self, read: _Read) -> Iterator[Splice]:
        """Yield the edits of the attributes."""
        now = {name: value for name, value in read.element.attrib.items() if read.attributes.get(name) != value}
        gone, end = read.attributes.keys() - read.element.attrib.keys(), read.start
        for found in _ATTRIBUTE.finditer(self._text, read.start, read.opened):
            name, end = found[1].decode(), found.end()
            if name in gone:
                yield found.start(), end, b""
            elif name in now:
                yield *found.span(2 if found[2] is not None else 3), now.pop(name).encode()
        if end == read.start:
            end += len(re.match(rb"<[^\s/>]+", self._text[read.start : read.opened])[0])  # pyright: ignore[reportOptionalSubscript]
        new = b"".join(f' {name}="{value}"'.encode() for name, value in now.items())
        if new := new + self._declared * (read.element is self._root):
            yield end, end, new

    def _blank(self, read: _Read) -> bytes:
        """Return the white space before the first child (new line and indent); empty if there is other text."""
        first = next((one for one in read.element if one in self._read), None)
        blank = self._text[read.opened : self._read[first].start] if first is not None else b""
        return blank if not blank.strip() else b""


def _written(new: Element, blank: bytes) -> bytes:
    """Return the text of a new element, its lines beginning with `blank`."""
    own = deepcopy(new)
    own.tail = None
    if b"\n" in blank:
        etree.indent(own)
    return _NAMESPACE.sub(b"", etree.tostring(own, encoding="utf-8", xml_declaration=False)).replace(b"\n", blank)


def _places(text: bytes) -> list[tuple[int, int, int, int]]:
    """Return start, end of the start tag, start of the end tag and end of each element of an XML text in UTF-8."""
    found: list[list[int]] = []
    opened: list[int] = []
    parser = expat.ParserCreate("utf-8")

    def begin(name: str, attributes: dict[str, str]) -> None:
        if (tag := _TAG.match(text, parser.CurrentByteIndex)) is None:
            raise ValueError(f"the tag <{name}> cannot be parsed")
        opened.append(len(found))
        found.append([*tag.span(), 0, 0])

    def finish(name: str) -> None:
        places, here = found[opened.pop()], parser.CurrentByteIndex
        is_empty = text[places[1] - 2 : places[1]] == b"/>"
        places[2:] = [places[1], places[1]] if is_empty else [here, text.index(b">", here) + 1]

    parser.StartElementHandler, parser.EndElementHandler = begin, finish
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise ValueError(str(error)) from error
    return [(start, opened_at, closes, end) for start, opened_at, closes, end in found]
