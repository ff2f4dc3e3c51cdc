"""Errors that a user can act on: what is wrong, where, and what to do about it."""

from thesis_lib.foundation.terminal import visible


class UserError(Exception):
    """A mistake in the user's input, shown without a traceback; its text names the remedy."""

    def __str__(self) -> str:
        return visible(super().__str__())  # it quotes strangers' files, and also ends up in logs


class CorruptFileError(UserError):
    """One of our files cannot be read back; the remedy is to delete it and run again."""
