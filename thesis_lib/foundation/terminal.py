"""Safe output of text from others on a terminal: unprintable characters are shown as escapes and not obeyed.

A terminal obeys control characters in text (colours, window title, clipboard, erased lines), and marks of writing
direction can make a line read differently.  Names of folders, columns and keys come from the maker of a dataset.
"""

from typing import Any, TextIO

LAYOUT = "\n\t"


def visible(text: str) -> str:
    """The text with all unprintable characters except line breaks and tabs escaped as in Python.

    No-break spaces, as between a number and its unit, become spaces.

    >>> visible("a\\x1b[31mb")
    'a\\\\x1b[31mb'
    """
    text = text.replace("\N{NO-BREAK SPACE}", " ")  # unprintable for Python
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in LAYOUT else ascii(c)[1:-1] for c in text)


class VisibleStream:
    """A text stream that writes `visible` text and otherwise behaves like the stream it wraps."""

    def __init__(self, stream: TextIO):
        self._stream = stream

    def write(self, text: str) -> int:
        """Write `text`; return its number of characters."""
        self._stream.write(visible(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
