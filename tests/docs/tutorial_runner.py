"""Runs a tutorial as a reader would: saves its files, runs its commands in order, compares what they print.

In a tutorial stands

    Save this as `PATH`:   and a python block    the file, from the root of the repository
    ```bash                                      commands to run there, one shell a block
    ```bash long                                 the same, but Snakemake makes a dry run
    ```bash repository                           commands to run in the root of the repository, while all others of the
                                                 page, and its files, belong to the folder `mine` beside it
    ```text  right behind a bash block           what it prints: words exactly, numbers within `ROUNDING`

Where a printed text has … or a new line, or goes on before or after, anything may stand.
"""

import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NUMBER = r"[-−]?\d+\.?\d*(?:e-?\d+)?"
COMMAND = 'thesis-lib() { python -m thesis_lib "$@"; }'  # the installed one may belong to another checkout
ROUNDING = 0.1  # relative: other versions of the libraries move floors, and whatever is drawn, by a few per cent
_BLOCK = re.compile(
    r"(?:Save this as `(?P<path>[^`]+)`:\n\n)?^```(?P<kind>\w*)(?P<where> long| repository)?\n(?P<text>.*?)^```$",
    re.M | re.S,
)


@dataclass
class Step:
    """A file to save (path), or commands (long: as a dry run; repository: in its root) with what they print."""

    text: str
    path: str | None = None
    long: bool = False
    repository: bool = False
    prints: list[str] = field(default_factory=list)


def steps_of(page: str) -> list[Step]:
    """The steps of a tutorial in order."""
    steps: list[Step] = []
    for match in _BLOCK.finditer(page):
        if match["path"]:
            steps.append(Step(match["text"], path=match["path"]))
        elif match["kind"] == "bash":
            steps.append(
                Step(match["text"], long=match["where"] == " long", repository=match["where"] == " repository")
            )
        elif match["kind"] == "text" and steps:
            steps[-1].prints.append(match["text"])
    return steps


def run(step: Step, folder: Path, project: Path | None = None) -> str:
    """Save or run one step in `folder`, by default the root of the project; returns what was printed.

    Raises:
        AssertionError: a command fails, or prints something else than the tutorial says.
    """
    if step.path:
        (folder / step.path).write_text(step.text, encoding="utf-8")
        return ""
    commands = step.text
    if step.long:
        commands = re.sub(r"^snakemake ", "snakemake --dry-run --quiet all ", commands, flags=re.M)
    environment = os.environ | {
        "PYTHONPATH": str(project or folder),
        "OMP_NUM_THREADS": "1",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "XDG_CACHE_HOME": str(folder / ".cache"),
    }
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", f"{COMMAND}\n{commands}"],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{commands}\nends with {done.returncode}:\n{(done.stdout + done.stderr)[-2000:]}"
    for text in step.prints:
        compare(text, done.stdout)
    return done.stdout


def compare(said: str, printed: str) -> None:
    """Raises AssertionError where a program prints something else than a tutorial says."""
    printed = " ".join(printed.split())
    start = 0
    for part in re.split(r"…|\n(?= {4}\S)", said):
        words = " ".join(part.split())
        pattern = f"({NUMBER})".join(re.escape(piece) for piece in re.split(NUMBER, words))
        found = re.compile(pattern).search(printed, start)
        assert found, f"the tutorial shows {words!r}, which is not printed (any more):\n{printed[:3000]}"
        start = found.end()
        for here, there in zip(re.findall(NUMBER, words), found.groups()):
            here, there = (float(number.replace("−", "-")) for number in (here, there))
            assert abs(here - there) <= ROUNDING * abs(there), f"{words!r}: {here:g} is now {there:g}"
