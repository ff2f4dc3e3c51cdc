"""Checks before a file is opened: it must be a regular file, of bounded size, inside its folder.

Reading a folder, a pipe or a device would fail with an obscure error or never end, a huge file would fill the memory,
and a link in a user's folder can lead anywhere.
"""

import os
import stat
from pathlib import Path

from thesis_lib.foundation.errors import UserError


class FileProblem(UserError):
    """A file that is refused: the fault `what`, the `remedy`, and the place `where` in the file ("" for all of it)."""

    def __init__(self, path: str | Path, what: str, remedy: str, where: str = ""):
        self.what, self.remedy, self.where = what, remedy, where
        super().__init__(f"{path} {what}{' in ' if where else ''}{where}; {remedy}.")


class MissingFile(FileProblem):
    """There is nothing at this path."""


def regular_size(path: str | Path, limit: int, within: str | Path | None = None) -> int:
    """Size in bytes of a regular file, at most `limit`; `within` is a folder that links must not leave.

    MissingFile if there is none; FileProblem if it is not a regular file, is larger, or lies outside `within`.
    """
    try:
        status = os.stat(path)  # noqa: PTH116  (Path.stat does the same)
        outside = within is not None and not Path(path).resolve().is_relative_to(Path(within).resolve())
    except FileNotFoundError as error:
        raise MissingFile(path, "does not exist", "give a file that does") from error
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileProblem(path, f"cannot be opened ({reason})", "check the path and the rights") from error
    if stat.S_ISDIR(status.st_mode):
        raise FileProblem(path, "is a folder, expected a file", "give the file")
    if not stat.S_ISREG(status.st_mode):
        raise FileProblem(path, "is a pipe or a device, expected a file", "give a regular file")
    if outside:
        raise FileProblem(path, "is a link that leads out of its folder", "put the file itself there")
    if status.st_size > limit:
        raise FileProblem(path, f"has {status.st_size:,} bytes; the limit is {limit:,}", "give a smaller file")
    return status.st_size


def is_file(path: str | Path) -> bool:
    """Whether there is a regular file of this name; False also for impossible names."""
    try:
        return Path(path).is_file()
    except OSError:
        return False


def read_bytes(path: str | Path, limit: int, within: str | Path | None = None) -> bytes:
    """Content of a regular file; arguments and errors as in `regular_size`."""
    regular_size(path, limit, within)
    try:
        with Path(path).open("rb") as file:
            content = file.read(limit + 1)
    except OSError as error:
        raise FileProblem(path, f"cannot be read ({error.strerror})", "check the rights") from error
    if len(content) > limit:  # the kernel's own files report a size of 0
        raise FileProblem(path, f"has more than {limit:,} bytes", "give a smaller file")
    return content
