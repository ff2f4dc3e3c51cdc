"""Errors that a user can act on: what is wrong, where, and what to do about it."""

from thesis_lib.foundation.terminal import visible


class UserError(Exception):
    """A mistake in the user's input. Its text is shown without a traceback and names the remedy."""

    def __str__(self) -> str:
        return visible(super().__str__())  # it quotes files of strangers, and also ends up in logs


class CorruptFileError(UserError):
    """A file of ours that cannot be read back; the remedy is to delete it and run again."""
