"""The option --effects of all commands: effects and laws of one's own, from files and from installed packages."""

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from thesis_lib.foundation.errors import UserError

HELP = (
    "Python file with effects or laws of your own, which join the library; it runs with your rights, so read what "
    "others wrote; may be given several times"
)


def add_option(parser: argparse.ArgumentParser) -> None:
    """Let a command take --effects FILE.py."""
    parser.add_argument("--effects", action="append", dest="files", metavar="FILE.py", default=[], help=HELP)


def load_additions(files: Sequence[str], data: Iterable[str | Path] = ()) -> list[dict[str, str]]:
    """What installed packages offer and what the files hold, for JSON; that files run is said on stderr before.

    Files must not lie in the folders `data`.  UserError as in `thesis_lib.extensions.loading.load`.
    """
    from thesis_lib.extensions.loading import load

    for path in files:
        if not path.endswith(".py") and not Path(path).exists():
            raise UserError(f"--effects {path}: no such file. It takes a Python file; a name goes behind --effect.")
    return load(files, data=data, say=note)


def note(text: str) -> None:
    """Tell what a user should know before it happens, also where progress is not wanted."""
    print(f"note: {text}", file=sys.stderr, flush=True)
