"""Errors that a user can act on: what is wrong, where, and what to do about it."""

import difflib
from collections.abc import Iterable

from thesis_lib.foundation.terminal import visible


class UserError(Exception):
    """A mistake in the user's input, shown without a traceback; its text names the remedy."""

    def __str__(self) -> str:
        return visible(super().__str__())  # it may quote files from others, and is written into logs


class CorruptFileError(UserError):
    """One of our files cannot be read back; the remedy is to delete it and run again."""


def suggest(word: str, known: Iterable[str], most: int = 1) -> str:
    """Question with the known words that a mistyped one resembles: did you mean 'x' or 'y'?  Empty if none is alike."""
    alike = difflib.get_close_matches(word, list(known), n=most)
    return f"did you mean {' or '.join(map(repr, alike))}?" if alike else ""


def first_line(error: Exception) -> str:
    """The first line of the message of a library's error, at most 200 characters; its class name without a message."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
