"""Critique of many datasets, each in its own process, so that a bad dataset does not stop the others (see `isolated`).

OUT/<dataset>/ holds the files of a single critique, byte for byte; OUT/<dataset>.log holds its output and the traceback
of a crash; index.html, batch.csv and batch.json list all datasets, and the reasons of failures.

A batch resumes where it stopped.  OUT/.batch/<dataset>.json holds the checksums of data, settings, code and files of a
finished critique; a dataset is skipped only if none of them has changed.
"""

import contextlib
import fcntl
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from threadpoolctl import threadpool_limits

from thesis_lib.commands.comparison import read_run
from thesis_lib.critique import run
from thesis_lib.critique.run import criticise
from thesis_lib.datasets.format.folder import INPUTS, looks_like_dataset
from thesis_lib.datasets.format.tables import MAX_BYTES
from thesis_lib.datasets.recordings.recording import is_recording
from thesis_lib.effects import require_known
from thesis_lib.extensions.loading import load
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_json, write_json
from thesis_lib.foundation.isolated import ProcessResult, Task, run_isolated
from thesis_lib.foundation.progress import duration
from thesis_lib.foundation.provenance import file_sha256, lib_hash, value_sha256
from thesis_lib.foundation.regular_file import FileProblem, regular_size
from thesis_lib.report import batch_index
from thesis_lib.report.critique.folder import LAST, MODEL_FILE

STATE = ".batch"
PRELOAD = (
    "thesis_lib.extensions.loading",
    "thesis_lib.critique.run",
    "thesis_lib.report.critique.page",
    "thesis_lib.datasets.read",
    "thesis_lib.figures.critique.pictures",
)


@dataclass(frozen=True)
class Batch:
    """Result of a batch.

    `rows` (see `batch_index`) are in the order of the datasets, `finished` in the order in which the critiques ended;
    `skipped` lists the names of the datasets that were already finished.
    """

    rows: list[dict]
    finished: list[ProcessResult]
    skipped: list[str]

    @property
    def failed(self) -> list[dict]:
        """Rows of the datasets without a verdict."""
        return [row for row in self.rows if row["status"] == "failed"]


def find_datasets(paths: Sequence[str | Path]) -> tuple[list[Path], list[Path]]:
    """Dataset folders among `paths` and directly below them, and the other folders next to datasets found below.

    A path without anything like a dataset counts as a dataset, so that reading it reports the error.
    """
    datasets, others = [], []
    for path in map(Path, paths):
        below = []
        if path.is_dir() and not looks_like_dataset(path):
            below = sorted(p for p in path.iterdir() if p.is_dir() and not p.name.startswith("."))
        inside = [p for p in below if looks_like_dataset(p)]
        datasets += inside or [path]
        others += [p for p in below if p not in inside] if inside else []
    return list(dict.fromkeys(datasets)), others


def criticise_folder(
    path: str,
    folder: str,
    seed: int,
    effects: Sequence[str] | None,
    files: Sequence[str] = (),
    additions: Sequence[Mapping[str, str]] = (),
) -> dict:
    """Criticise one dataset in its own process, which loads user-defined effects again.

    UserError if these differ from the `additions` of the batch.
    """

    if additions and load(files, say=print) != list(additions):
        raise UserError("The effects or laws of your own have changed since the batch began; start it again.")
    with threadpool_limits(limits=1):  # other datasets use the other cores
        criticise(path, effects=effects, seed=seed, say=print).save(folder)
    return {}


def run_batch(
    paths: Sequence[str | Path],
    out: str | Path,
    seed: int,
    *,
    effects: Sequence[str] | None = None,
    files: Sequence[str] = (),
    additions: Sequence[Mapping[str, str]] = (),
    jobs: int = 1,
    time_limit: float | None = None,
    memory_limit: float | None = None,
    say: Callable[[str], None] = lambda text: None,
    work: Callable[..., dict] = criticise_folder,
) -> Batch:
    """Criticise many datasets (folders), and write an index of them into `out`, even if interrupted.

    Args:
        seed, effects: as for one dataset (`criticise`).
        files, additions: loaded Python files with user-defined effects, and the list of additions to the library.
        jobs: number of datasets processed at a time.
        time_limit, memory_limit: s of wall time and bytes of resident memory per dataset; None for no limit.
        say: called with a line for each dataset that ends.
        work: function called for each dataset with the arguments of `criticise_folder`.

    UserError if names collide, an effect is unknown, or another batch writes into `out`.
    """
    if not all(map(is_recording, paths)):  # mechanisms have other effects
        require_known(effects or ())
    out = Path(out)
    named = _names(paths, out)
    with _only_one(out):
        of_ones_own = (tuple(files), tuple(additions)) if additions else ()
        code = lib_hash(run.__file__)  # covers all modules that a critique runs
        settings = {"seed": seed, "effects": effects and list(effects), "code": code, "additions": list(additions)}
        keys = {name: _key(Path(os.path.realpath(path)), settings) for name, path in named.items()}
        skipped = [name for name in named if _is_done(out, name, keys[name])]
        rows = {name: _row(out, name) for name in skipped}
        if skipped:
            say(f"{len(skipped)} of {len(named)} datasets are done already, with the same data and settings")
        tasks = [
            Task(name, (str(path), str(out / name), seed, effects, *of_ones_own), out / f"{name}.log")
            for name, path in named.items()
            if name not in rows
        ]
        finished: list[ProcessResult] = []
        limits = {"jobs": jobs, "time_limit": time_limit, "memory_limit": memory_limit, "preload": PRELOAD}
        start = time.monotonic()
        try:
            with contextlib.closing(run_isolated(work, tasks, **limits)) as outcomes:
                for outcome in outcomes:
                    finished.append(outcome)
                    rows[outcome.name] = _closed(out, outcome, keys[outcome.name])
                    spent = time.monotonic() - start
                    say(_progress(rows[outcome.name], len(rows), len(named), outcome, spent, len(finished)))
        finally:
            ordered = [rows[name] for name in named if name in rows]
            batch_index.write_index(ordered, out, total=len(named), seed=seed, effects=effects)
    return Batch(ordered, finished, skipped)


def batch_text(batch: Batch, out: Path) -> str:
    """Summary of a batch: number of datasets with each verdict, reasons of failures, and output paths."""
    lines = [batch_index.summary_text(batch.rows, len(batch.rows))]
    if batch.skipped:
        lines.append(f"  {len(batch.skipped)} of them were done already")
    for row in batch.failed:
        log = out / f"{row['dataset']}.log"
        lines.append(f"  {batch_index.plain(row['dataset'])} failed: {row['reason']}\n      log: {log}")
    return "\n".join([*lines, f"\nwritten to {out}; open {out / 'index.html'}"])


def _closed(out: Path, outcome: ProcessResult, key: str | None) -> dict:
    """Row of a dataset that has just ended; the dataset is marked as done if it has a verdict."""
    if outcome.failure is not None:
        return batch_index.row_of_failure(outcome.name, outcome.failure)
    row = _row(out, outcome.name)
    if row["status"] == "done" and key is not None:
        with contextlib.suppress(OSError):  # without the mark the dataset is criticised again
            write_json({"key": key, "files": _written(out / outcome.name)}, out / STATE / f"{outcome.name}.json")
    return row


def _row(out: Path, name: str) -> dict:
    try:
        return batch_index.row_of_verdict(name, read_run(out / name))
    except UserError as error:
        return batch_index.row_of_failure(name, str(error))


def _progress(row: Mapping, count: int, total: int, outcome: ProcessResult, spent: float, ended: int) -> str:
    """Progress line such as "[  3/100] my_drops: effects (com_offset), 21 s; about 12 min left"."""
    what = f"FAILED: {row['reason']}" if row["status"] == "failed" else row["verdict"] or batch_index.NO_VERDICT
    named = f" ({row['effects']})" if row["effects"] else ""
    rest = "" if count == total else f"; about {duration((total - count) * spent / ended)} left"
    name = f"[{count:{len(str(total))}d}/{total}] {batch_index.plain(row['dataset'])}"
    return f"{name}: {what}{named}, {outcome.wall_s:.0f} s{rest}"


def _names(paths: Sequence[str | Path], out: Path) -> dict[str, Path]:
    """Dataset folders by name; UserError if a name is repeated or unusable, or if a dataset would be overwritten."""
    named: dict[str, Path] = {}
    for path in map(Path, paths):
        name = Path(os.path.realpath(path)).name  # unlike Path.resolve, realpath survives a loop of links
        if name in named:
            raise UserError(
                f"Two datasets are called {name}: {named[name]} and {path}. Their results would overwrite each other; "
                "rename one of the folders, or run two batches with different -o."
            )
        if os.path.realpath(out / name) == os.path.realpath(path):
            raise UserError(f"-o {out} is the folder that contains the datasets; choose another folder.")
        named[name] = path
    taken = {STATE, *batch_index.INDEX_FILES, *(f"{name}.log" for name in named)}
    for name in named:
        if name in taken:
            raise UserError(f"A batch writes a file called {name}; rename the dataset folder {named[name]}.")
        if not name.isprintable():
            raise UserError(f"The name of the dataset folder {name!r} holds unprintable characters; rename it.")
    return named


@contextlib.contextmanager
def _only_one(out: Path) -> Iterator[None]:
    """Lock the output folder; the kernel releases the lock when this process ends, however it ends."""
    (out / STATE).mkdir(parents=True, exist_ok=True)
    with (out / STATE / "lock").open("w") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UserError(f"Another batch is writing into {out}; wait for it, or choose another -o.") from None
        yield


def _key(path: Path, settings: Mapping[str, object]) -> str | None:
    """Checksum of all inputs of a critique; None if the data cannot be read or are too large."""
    inputs = {**settings, "name": path.name}
    try:
        for file in (path / name for name in INPUTS):
            if os.path.lexists(file):
                regular_size(file, MAX_BYTES, path)
                inputs[file.name] = file_sha256(file)
    except (OSError, FileProblem):
        return None
    return value_sha256(inputs)


def _written(folder: Path) -> dict[str, str]:
    """Checksums of the files that a critique moves into its folder last; OSError if one is missing."""
    wanted = [name for name in LAST if name != MODEL_FILE or (folder / name).exists()]
    return {name: file_sha256(folder / name) for name in wanted}


def _is_done(out: Path, name: str, key: str | None) -> bool:
    """Whether there is a complete critique of the same data, settings and code, with no file changed since."""
    try:
        mark = read_json(out / STATE / f"{name}.json")
        return key is not None and mark == {"key": key, "files": _written(out / name)}
    except (UserError, OSError):
        return False
