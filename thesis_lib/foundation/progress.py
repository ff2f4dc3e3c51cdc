"""Progress of a long command on stderr: on a terminal one line that is rewritten, elsewhere one line per minute.

The remaining time is shown if the completed share is known: from "3 of 10" in the text, or from a table of stages.
"""

import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import Self

from thesis_lib.foundation.command_line import terminal_stream

EVERY_TERMINAL, EVERY_LOG = 1.0, 60.0  # s between two lines
SHORT = 2.0  # s; an earlier forecast would be a guess


class Progress:
    """Context manager that is called with the current activity: `with Progress("my_drops") as say: say("fitting")`."""

    def __init__(
        self,
        label: str,
        *,
        quiet: bool = False,
        stages: Mapping[str, float] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ):
        """Each line begins with `label`; `stages` maps the beginning of a text to the share of the time (0 to 1) that
        has usually passed by then; `clock` is in seconds."""
        self._label, self._quiet, self._stages, self._clock = label, quiet, stages or {}, clock
        self._stream = terminal_stream(sys.stderr)
        self._text, self._end = "", 0.0  # s from the start
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Self:
        self._start = self._clock()
        if not self._quiet:
            self._thread.start()
        return self

    def __call__(self, text: str) -> None:
        """Show `text` as the current activity."""
        spent, share = self._clock() - self._start, self._share(text)
        self._text = text
        if share and spent > SHORT:
            self._end = spent / share
        if self._stream.terminal and not self._quiet:
            self._show()

    def __exit__(self, *exception: object) -> None:
        self._over.set()
        if not self._quiet:
            self._thread.join()
            if self._stream.terminal:
                self._stream.rewrite("")

    def line(self) -> str:
        """The current line."""
        spent = self._clock() - self._start
        remaining = self._end - spent
        rest = f"; about {duration(remaining)} left" if remaining > 0.5 else ""
        return f"{self._label}: {self._text}, {duration(spent)}{rest}"

    def _share(self, text: str) -> float:
        if counted := re.search(r"(\d+) of (\d+)", text):
            return int(counted[1]) / max(int(counted[2]), 1)
        return next((share for begin, share in self._stages.items() if text.startswith(begin)), 0.0)

    def _tick(self) -> None:
        while not self._over.wait(EVERY_TERMINAL if self._stream.terminal else EVERY_LOG):
            if self._text:
                self._show()

    def _show(self) -> None:
        if self._stream.terminal:
            self._stream.rewrite(self.line()[: shutil.get_terminal_size().columns - 1])
        else:
            print(self.line(), file=self._stream, flush=True)


def duration(seconds: float) -> str:
    """Duration as text: in seconds, from 90 s on in minutes."""
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
