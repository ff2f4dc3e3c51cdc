"""Kill the pipeline at random moments, let it go on, and compare with a run that nobody disturbed.

    python -m tests.workflow.interruption [--kills 20] [--seed 0] [--cores 2] [--targets TARGET ...]

A copy of the pipeline runs `one_minute.yaml` once in peace.  In a second copy it is stopped again and again, in turn
in each of the ways of `ways_to_stop.py`, at moments that are uniform over the duration of the first run, and started
again by the same command.  After each stop every file under its final name must hold the very bytes of the undisturbed
run, every result of a finished job must still be there untouched, and the runner must have said what happened; at the
end all results must be equal.  A disk is filled where a small tmpfs can be mounted (Linux, root); elsewhere a limit on
the size of files takes its place.
"""

import argparse
import base64
import contextlib
import json
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil

from tests.workflow.pipeline_copy import ROOT, copy_pipeline
from tests.workflow.ways_to_stop import OVERLAY, WAYS, Run, Way, job_of

TARGETS = ("chapter3", "chapter4", "critique", "ch2_schematics")
RESULTS = ("results", "data/simulated")
DISK = 400  # MB of the tmpfs; more than the runner asks to be free


def results(folder: Path) -> dict[str, bytes]:
    """Every file of the results, hidden ones too, logs excepted: name -> content."""
    found = {}
    for top in RESULTS:
        for path in sorted((folder / top).rglob("*")):
            name = path.relative_to(folder).as_posix()
            if not name.startswith("results/logs/"):
                # an orphan may rename it just now
                with contextlib.suppress(FileNotFoundError, IsADirectoryError):
                    found[name] = path.read_bytes()
    return found


def unreadable(folder: Path) -> list[str]:
    """Results that the program of their kind cannot read."""
    import pandas as pd
    import yaml
    from matplotlib.image import imread

    readers: dict[str, Callable[[Path], object]] = {
        ".csv": pd.read_csv,
        ".json": lambda path: json.loads(path.read_text(encoding="utf-8")),
        ".yaml": lambda path: yaml.safe_load(path.read_text(encoding="utf-8")),
        ".png": imread,
        ".pdf": lambda path: re.search(rb"\A%PDF(?s:.*)%%EOF\s*\Z", path.read_bytes())[0],
        ".html": lambda path: path.read_text(encoding="utf-8").rindex("</html>"),
        ".txt": lambda path: path.read_text(encoding="utf-8").rindex(".\n"),  # a finding ends with a sentence
    }
    bad = []
    for name in results(folder):
        try:
            readers[Path(name).suffix](folder / name)
        except Exception as error:
            bad.append(f"{name}: {error!r}")
    return bad


def finished(folder: Path) -> dict[str, int]:
    """Outputs of jobs that Snakemake has recorded as finished: name -> time of change (ns)."""

    def names(kind: str) -> set[str]:
        top = folder / ".snakemake" / kind
        keys = ("".join(p.relative_to(top).parts).replace("@", "") for p in top.rglob("*") if p.is_file())
        return {base64.urlsafe_b64decode(key).decode() for key in keys}

    done = names("metadata") - names("incomplete")
    return {name: (folder / name).stat().st_mtime_ns for name in done if (folder / name).exists()}


@dataclass
class Kill:
    """One interruption: its way, the exit code of the runner that was stopped, and what was wrong after it."""

    way: str
    code: int
    faults: list[str] = field(default_factory=list)


@contextlib.contextmanager
def small_disk(folder: Path) -> Iterator[bool]:
    """Mount a tmpfs at `folder` where that is allowed; yields whether it was."""
    folder.mkdir()
    mounted = not subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={DISK}m", "tmpfs", str(folder)], capture_output=True
    ).returncode
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], check=True)


class Study:
    """An undisturbed run in `top`/calm, then stops in `top`/disturbed."""

    def __init__(self, top: Path, targets: Sequence[str], cores: int, rng: np.random.Generator):
        self.targets, self.cores, self.rng = targets, cores, rng
        self.calm, self.folder = top / "calm", top / "disturbed"
        self.source = copy_pipeline(top / "source")  # once: somebody may be editing the original
        shutil.copy2(ROOT / "tests/workflow" / OVERLAY, self.source)
        self.kills: list[Kill] = []
        self.faults: list[str] = []

    def prepare(self, folder: Path) -> None:
        """Fill the folder with the same copy of the pipeline as the other."""
        shutil.copytree(self.source, folder, dirs_exist_ok=True)

    def start(self) -> Run:
        return Run(self.folder, self.targets, self.cores)

    def undisturbed(self) -> None:
        self.prepare(self.calm)
        run = Run(self.calm, self.targets, self.cores)
        run.wait_for_job()
        self.until_job = time.monotonic() - run.start
        if run.end():
            raise RuntimeError(f"the undisturbed run failed:\n{run.text()[-3000:]}")
        self.duration = time.monotonic() - run.start
        self.expected = results(self.calm)
        self.faults += unreadable(self.calm)
        (log,) = (self.calm / ".snakemake/log").iterdir()
        jobs = set(re.findall(r"Finished jobid: (\d+)", log.read_text()))
        print(f"undisturbed: {self.duration:.0f} s, {len(jobs)} jobs, {len(self.expected)} files", flush=True)

    def compare(self, complete: bool) -> list[str]:
        """What differs from the undisturbed run; files may be missing or half-made (.part) unless `complete`."""
        found, faults = results(self.folder), []
        for name, content in found.items():
            if name not in self.expected and (complete or ".part" not in name):
                faults.append(f"{name} is in excess")
            elif name in self.expected and content != self.expected[name]:
                faults.append(f"{name} differs")
        if complete:
            faults += [f"{name} is missing" for name in set(self.expected) - set(found)]
        return faults

    def round(self, ways: Sequence[Way]) -> int:
        """Stop one passage through the pipeline in these ways, as many as it takes; how many were used."""
        moments = np.sort(self.rng.uniform(0, self.duration, len(ways)))
        at = redo = 0.0  # position in the undisturbed run, work to be done again (s of it)
        before, used = {}, 0
        for moment, way in zip(moments, ways):
            run = self.start()
            if at < self.until_job:
                alive = run.wait(seconds=moment)
            else:
                alive = run.wait_for_job() and run.wait(seconds=moment - at + redo)
            if alive and way.needs_job:
                alive = run.wait_for_job()
            if not alive:  # it was faster than the undisturbed run
                self.complete(run, before)
                return used
            redo, used = self.strike(run, way, moment, before), used + 1
            at, before = moment, finished(self.folder)
        self.complete(self.start(), before)
        return used

    def strike(self, run: Run, way: Way, moment: float, before: dict[str, int]) -> float:
        """Stop the run, check what it leaves, and return for how long (s) the jobs it lost had been running."""
        ages, running = [0.0], []
        for job in run.jobs():
            with contextlib.suppress(psutil.Error):
                running.append(job_of(job) or "?")
                ages.append(time.time() - job.create_time())
        way.stop(run)
        code = run.end()
        kill = Kill(way.name, code)
        self.kills.append(kill)
        if code and running and way.says and not re.search(way.says, run.text()):
            kill.faults.append(f"not said: {way.says!r} in\n{run.text()[-3000:]}")
        kill.faults += self.compare(complete=False) + self.untouched(before)
        jobs = ", ".join(sorted(running)) or "no job"
        print(
            f"{len(self.kills):3d}  {moment:5.1f} s  {way.name:22s} {jobs:50s} exit {code}",
            *kill.faults,
            sep="\n     ",
            flush=True,
        )
        self.faults += kill.faults
        return max(ages)

    def untouched(self, before: dict[str, int]) -> list[str]:
        """Results of finished jobs that were made again or lost."""
        now = {name: path.stat().st_mtime_ns for name in before if (path := self.folder / name).exists()}
        return [f"{name} was finished and is lost" for name, changed in before.items() if now.get(name) != changed]

    def complete(self, run: Run, before: dict[str, int]) -> None:
        """Let a run end, compare with the undisturbed one, and clear away what it made."""
        code = run.end()
        faults = self.compare(complete=True) + self.untouched(before)
        if code:
            faults.append(f"exit code {code}:\n{run.text()[-3000:]}")
        print(
            f"     went to its end: {len(self.expected)} files " + ("DIFFER" if faults else "equal"),
            *faults,
            sep="\n     ",
            flush=True,
        )
        self.faults += faults
        for name in ("results", "data", ".snakemake"):
            shutil.rmtree(self.folder / name, ignore_errors=True)


def _end_all(top: Path) -> None:
    """End whatever still runs in a folder below `top`."""
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            if process.cwd().startswith(str(top)):
                process.kill()


def study(kills: int, seed: int, targets: Sequence[str], cores: int = 2, ways: Sequence[Way] = WAYS) -> Study:
    """Stop the pipeline `kills` times; `faults` of what is returned must be empty."""
    rng = np.random.default_rng(seed)
    with contextlib.ExitStack() as stack:
        top = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="interruption"))).resolve()
        done = Study(top, targets, cores, rng)
        done.undisturbed()
        mounted = stack.enter_context(small_disk(done.folder))
        disk = f"a tmpfs of {DISK} MB" if mounted else "a limit on the size of files"
        print(f"a full disk is {disk}", flush=True)
        done.prepare(done.folder)
        stack.callback(_end_all, top)
        left = [ways[i % len(ways)] for i in range(kills)]
        while left:
            left = left[done.round(left) :]
        stopped = {kill.way for kill in done.kills if kill.code}
        done.faults += [f"{way} never stopped a run" for way in {kill.way for kill in done.kills} - stopped]
    return done


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.workflow.interruption", description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--targets", nargs="+", default=TARGETS)
    parser.add_argument("--ways", nargs="+", choices=[way.name for way in WAYS], help="only these, in turn")
    options = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))  # so that the disk is unmounted
    ways = [way for way in WAYS if way.name in (options.ways or [way.name])]
    done = study(options.kills, options.seed, options.targets, options.cores, ways)
    print(*done.faults, f"{len(done.faults)} faults", sep="\n")
    return bool(done.faults)


if __name__ == "__main__":
    sys.exit(main())
