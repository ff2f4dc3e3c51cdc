"""Common behaviour of all commands: error messages, exit codes, Ctrl-C, a closed pipe, colours on terminals only.

| exit code | when                                                                |
|-----------|---------------------------------------------------------------------|
| 0         | done                                                                |
| 1         | a check failed                                                      |
| 2         | wrong usage or bad input; stderr states the fault and the remedy    |
| 130       | interrupted (Ctrl-C)                                                |
"""

import argparse
import contextlib
import functools
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NoReturn, TextIO

from thesis_lib.foundation.errors import UserError, suggest
from thesis_lib.foundation.terminal import VisibleStream, visible

FAILED, WRONG, INTERRUPTED = 1, 2, 130
COLOURS = {  # beginning of a line -> SGR code of its first group
    r"(error:)": "1;31",
    r"(warning:)": "1;33",
    r"(usage:|examples:)": "1",
    r"\S[^:]*: (adequate|effects|unexplained)$": "1",
}


class TerminalStream(VisibleStream):
    """Stream that escapes unprintable characters, and colours the words of `COLOURS` on a terminal with colours.

    Colour is added last: texts contain no codes, and codes in texts from others are escaped.
    """

    def __init__(self, stream: TextIO):
        super().__init__(stream)
        self.terminal = stream.isatty()
        self._colours = self.terminal and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
        self._starts_line = True

    def write(self, text: str) -> int:
        shown = visible(text)
        if self._colours and text:
            lines = shown.split("\n")
            first = 0 if self._starts_line else 1
            self._starts_line = text.endswith("\n")
            shown = "\n".join([*lines[:first], *map(_coloured, lines[first:])])
        self._stream.write(shown)
        return len(text)

    def flush(self) -> None:
        self._stream.flush()

    def rewrite(self, text: str) -> None:
        """Replace the current line by `text`; for terminals only."""
        self._stream.write(f"\r{visible(text)}\x1b[K")
        self._stream.flush()


def _coloured(line: str) -> str:
    for pattern, code in COLOURS.items():
        if match := re.match(pattern, line):
            start, end = match.span(1)
            return f"{line[:start]}\x1b[{code}m{line[start:end]}\x1b[0m{line[end:]}"
    return line


def terminal_stream(stream: TextIO) -> TerminalStream:
    """The stream to which commands write; `stream` itself if it is one already, as when a command calls another."""
    return stream if isinstance(stream, TerminalStream) else TerminalStream(stream)


def command(main: Callable[[Sequence[str] | None], int]) -> Callable[..., int]:
    """Decorator of a command: errors, interruptions and closed pipes become text and exit codes."""

    @functools.wraps(main)
    def run(argv: Sequence[str] | None = None) -> int:
        out, err = terminal_stream(sys.stdout), terminal_stream(sys.stderr)
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                try:
                    return main(argv)
                finally:
                    out.flush()  # so that a closed pipe is noticed here and not while Python shuts down
            except UserError as error:
                print(f"error: {error}", file=sys.stderr)
                return WRONG
            except ModuleNotFoundError as error:
                if error.name is None or error.name.startswith("thesis_lib"):
                    raise
                print(f"error: {not_installed(error.name)}", file=sys.stderr)
                return WRONG
            except KeyboardInterrupt:
                print("interrupted", file=sys.stderr)
                return INTERRUPTED
            except BrokenPipeError:  # the reader (head, less) has seen enough
                with contextlib.suppress(OSError):
                    os.dup2(os.open(os.devnull, os.O_WRONLY), out.fileno())
                return 0
            except OSError as error:
                print(f"error: {error.filename or 'a file'}: {error.strerror or error}", file=sys.stderr)
                return WRONG

    return run


class Parser(argparse.ArgumentParser):
    """An argument parser whose help keeps its line breaks and whose errors have the common form.

    Values such as -0.01,0,0 and -y are treated as values, not as options.
    """

    def __init__(self, *args, formatter_class: type = argparse.RawDescriptionHelpFormatter, **kwargs):
        super().__init__(*args, formatter_class=formatter_class, **kwargs)
        self._negative_number_matcher = re.compile(r"-(\.?\d.*|[xyz])$")

    def error(self, message: str) -> NoReturn:
        """Print the fault, the usage and where to read more; exit with code 2."""
        if choice := re.search(r"invalid choice: '(.*)' \(choose from (.*)\)$", message):
            message += near(choice[1], re.findall(r"'([^']*)'", choice[2]))
        self.exit(WRONG, f"error: {message}\n{self.format_usage()}{self.prog} --help explains it\n")


def not_installed(package: str) -> str:
    """Message that a package is missing in this Python, and how to get the environment that has it."""
    root = Path(__file__).resolve().parents[2]
    if not (root / "environment.txt").is_file():  # installed as a library
        return f"{package} is not installed in this Python ({sys.executable}); install it with pip."
    activate = f"run '. {root}/.venv/bin/activate'"
    remedy = activate if (root / ".venv").is_dir() else f"run 'make setup' in {root}, then {activate[4:]}"
    return f"{package} is not installed in this Python ({sys.executable}); {remedy}, and try again."


def near(word: str, known: Iterable[str]) -> str:
    """End of a message, "; did you mean …?"; empty if no known word is similar."""
    said = suggest(word, known, most=3)
    return f"; {said}" if said else ""
