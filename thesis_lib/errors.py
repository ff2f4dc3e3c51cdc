"""Errors that a user can act on: what is wrong, where, and what to do about it."""


class UserError(Exception):
    """A mistake in the user's input. Its text is shown without a traceback and names the remedy."""


class CorruptFileError(UserError):
    """A file of ours that cannot be read back; the remedy is to delete it and run again."""
