"""Fonts of a PDF with the glyphs that it uses, and no other table than a reader of the PDF needs.

Matplotlib has fontTools read a font whole for every file in which a glyph of it stands, which took half of saving a
figure.  Here the bytes of the glyphs are copied, with their hints.  Format: OpenType 1.9, tables of TrueType outlines.
"""

import struct
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

HINTS = (b"cvt ", b"fpgm", b"prep")
WORDS, SCALE, TWO_SCALES, MATRIX, MORE = 0x1, 0x8, 0x40, 0x80, 0x20  # flags of a part of a glyph


class SmallFont:
    """The glyphs of a TrueType file with these numbers, their parts and that of what is missing.

    Attributes:
        data: the font as a file.
        glyph_index_map: number in `data` by that in the file.
    """

    def __init__(self, file: str, glyphs: Iterable[int]) -> None:
        tables = _tables(file)
        head, hhea, maxp, widths = (tables[name] for name in (b"head", b"hhea", b"maxp", b"hmtx"))
        start = np.frombuffer(tables[b"loca"], ">u4").tolist() if head[51] else _doubled(tables[b"loca"])
        chosen = list(dict.fromkeys([0, *sorted(glyphs)]))
        outlines = []
        for glyph in chosen:  # which grows by the parts of what is in it
            outlines.append(bytearray(tables[b"glyf"][start[glyph] : start[glyph + 1]]))
            chosen += dict.fromkeys(part for _, part in _parts(outlines[-1]) if part not in chosen)
        self.glyph_index_map = {glyph: i for i, glyph in enumerate(chosen)}
        for outline in outlines:
            for at, part in _parts(outline):
                struct.pack_into(">H", outline, at, self.glyph_index_map[part])
            outline += bytes(-len(outline) % 4)
        last, count = int.from_bytes(hhea[34:36], "big") - 1, struct.pack(">H", len(chosen))
        # glyphs after the last that has a width of its own have its width
        beside = ((4 * min(glyph, last), 4 * glyph + 2 - 2 * max(glyph - last, 0)) for glyph in chosen)
        made = {name: tables[name] for name in HINTS if name in tables} | {
            b"glyf": b"".join(outlines),
            b"loca": np.cumsum([0, *map(len, outlines)]).astype(">u4").tobytes(),
            b"hmtx": b"".join(widths[width : width + 2] + widths[left : left + 2] for width, left in beside),
            b"head": head[:8] + bytes(4) + head[12:50] + b"\0\1" + head[52:],
            b"hhea": hhea[:34] + count,
            b"maxp": maxp[:4] + count + maxp[6:],
        }
        self.data = _file(made)

    @property
    def font(self) -> "SmallFont":
        return self

    def save(self, file: BinaryIO, **options: object) -> None:
        file.write(self.data)


@contextmanager
def glyphs_alone() -> Iterator[None]:
    """Save figures with small fonts; matplotlib has no option for that."""
    from matplotlib.backends import _backend_pdf_ps

    whole = _backend_pdf_ps.get_glyphs_subset

    @contextmanager
    def small(file: str, glyphs: Iterable[int]) -> Iterator[Any]:
        if b"glyf" in _tables(str(file)):
            yield SmallFont(str(file), glyphs)
        else:
            with whole(file, set(glyphs)) as font:
                yield font

    _backend_pdf_ps.get_glyphs_subset = small
    try:
        yield
    finally:
        _backend_pdf_ps.get_glyphs_subset = whole


@cache
def _tables(file: str) -> dict[bytes, bytes]:
    """The tables of a font by name; none of a collection of fonts."""
    data = Path(file).read_bytes()
    entries = b"" if data[:4] == b"ttcf" else data[12 : 12 + 16 * int.from_bytes(data[4:6], "big")]
    return {name: data[at : at + size] for name, _, at, size in struct.iter_unpack(">4sIII", entries)}


def _doubled(loca: bytes) -> list[int]:
    return (2 * np.frombuffer(loca, ">u2").astype(int)).tolist()


def _parts(outline: bytes) -> list[tuple[int, int]]:
    """Where in its outline a glyph of parts names each of them, and the part's number; [] of a plain one."""
    at, found, more = 10, [], len(outline) > 10 and struct.unpack_from(">h", outline)[0] < 0
    while more:
        flags, part = struct.unpack_from(">HH", outline, at)
        found.append((at + 2, part))
        at += 4 + (4 if flags & WORDS else 2)
        at += 2 if flags & SCALE else 4 if flags & TWO_SCALES else 8 if flags & MATRIX else 0
        more = flags & MORE
    return found


def _file(tables: dict[bytes, bytes]) -> bytes:
    """The file of a font with these tables."""
    count, entries, content = len(tables), b"", b""
    power = count.bit_length() - 1
    start = b"\0\1\0\0" + struct.pack(">HHHH", count, 16 << power, power, 16 * count - (16 << power))
    for name, table in sorted(tables.items()):
        padded = table + bytes(-len(table) % 4)
        total = int(np.frombuffer(padded, ">u4").sum(dtype=np.uint64)) & 0xFFFFFFFF
        entries += struct.pack(">4sIII", name, total, len(start) + 16 * count + len(content), len(table))
        content += padded
    return start + entries + content
