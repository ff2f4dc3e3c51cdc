"""Text of strangers on a terminal: what would not print is shown as an escape instead of being obeyed.

A terminal takes orders in its text (colours, the title of the window, the clipboard, erased lines), and marks of
writing direction make a line read as another.  Names of folders, columns and keys come from whoever made a dataset.
"""

from typing import TextIO

LAYOUT = "\n\t"


def visible(text: str) -> str:
    """The text with all that is not printable, line breaks and tabs apart, as Python would write it.

    >>> visible("a\\x1b[31mb")
    'a\\\\x1b[31mb'
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in LAYOUT else ascii(c)[1:-1] for c in text)


class VisibleStream:
    """A text stream that writes `visible` text; all else is that of the stream below."""

    def __init__(self, stream: TextIO):
        self._stream = stream

    def write(self, text: str) -> int:
        """Write text; returns the number of characters given."""
        self._stream.write(visible(text))
        return len(text)

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)
