"""Kill the pipeline at random moments, let it go on, and compare with a run that nobody disturbed.

    python -m tests.workflow.interruption [--kills 20] [--seed 0] [--cores 2] [--targets TARGET ...]

A copy of the pipeline runs `one_minute.yaml` once in peace.  In a second copy it is stopped again and again, in turn
in each of the ways of `WAYS`, at moments that are uniform over the duration of the first run, and started again by
the same command.  After each stop every file under its final name must hold the very bytes of the undisturbed run,
every result of a finished job must still be there untouched, and the runner must have said what happened; at the
end all results must be equal.  A disk is filled where a small tmpfs can be mounted (Linux, root); elsewhere a limit
on the size of files takes its place.
"""

import argparse
import base64
import contextlib
import json
import os
import re
import resource
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

OVERLAY = "one_minute.yaml"
TARGETS = ("chapter3", "chapter4", "critique", "ch2_schematics")
RESULTS = ("results", "data/simulated")
DISK = 400  # MB of the tmpfs; more than the runner asks to be free
LIMIT = 600.0  # s until a run counts as hung
POLL = 0.1  # s


def results(folder: Path) -> dict[str, bytes]:
    """Every file of the results, hidden ones too, logs excepted: name -> content."""
    found = {}
    for top in RESULTS:
        for path in sorted((folder / top).rglob("*")):
            name = path.relative_to(folder).as_posix()
            if not name.startswith("results/logs/"):
                with contextlib.suppress(
                    FileNotFoundError, IsADirectoryError
                ):  # an orphan renames it just now
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


class Run:
    """One start of the pipeline in a group of its own, as a terminal would start it."""

    def __init__(self, folder: Path, targets: Sequence[str], cores: int):
        self.output = Path(f"{folder}.{time.monotonic_ns()}.output")
        environment = {
            k: v for k, v in os.environ.items() if not k.startswith(("PYTHONPATH", "SNAKEMAKE", "MAKE"))
        }
        command = [
            sys.executable,
            "-m",
            "thesis_lib.pipeline",
            "--cores",
            str(cores),
            "--configfile",
            OVERLAY,
        ]
        self.folder, self.start = folder, time.monotonic()
        with self.output.open("w") as stream:
            self.process = subprocess.Popen(
                [*command, *targets],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_as_in_a_terminal,
            )

    def jobs(self) -> list[psutil.Process]:
        """Processes of its jobs, not those of an earlier run that live on."""
        found = []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error, ProcessLookupError):
                if os.getpgid(process.pid) == self.process.pid and _job(process):
                    found.append(process)
        return found

    def snakemake(self) -> list[psutil.Process]:
        with contextlib.suppress(psutil.Error):
            return psutil.Process(self.process.pid).children()
        return []

    def wait(self, until: Callable[[], bool] = lambda: False, seconds: float = LIMIT) -> bool:
        """Wait until the run has ended (False), or `until` says so or `seconds` have passed (True)."""
        end = time.monotonic() + seconds
        while self.process.poll() is None:
            if until() or time.monotonic() >= end:
                return True
            time.sleep(POLL)
        return False

    def wait_for_job(self) -> bool:
        return self.wait(lambda: bool(self.jobs()))

    def end(self) -> int:
        """Wait for the runner and return its exit code.

        Raises:
            RuntimeError: it hangs.
        """
        if self.wait():
            os.killpg(self.process.pid, signal.SIGKILL)
            raise RuntimeError(f"the run hangs:\n{self.text()[-3000:]}")
        return self.process.returncode

    def text(self) -> str:
        return self.output.read_text(encoding="utf-8", errors="replace")


def _as_in_a_terminal() -> None:
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)  # ignored under nohup and by jobs in the background


def _job(process: psutil.Process) -> str | None:
    match = re.search(r"\.snakemake/scripts/tmp\w+\.(\w+)\.py", " ".join(process.cmdline()))
    return match and match[1]


# ways to stop a run; each returns when the run has ended


def kill_group(run: Run) -> None:
    os.killpg(run.process.pid, signal.SIGKILL)


def kill_snakemake(run: Run) -> None:
    run.wait(lambda: bool(run.snakemake()))
    for process in run.snakemake():
        process.kill()
    run.end()


def interrupt(run: Run) -> None:
    os.killpg(run.process.pid, signal.SIGINT)
    run.end()


def hang_up(run: Run) -> None:
    os.killpg(run.process.pid, signal.SIGHUP)


def kill_job(run: Run) -> None:
    for job in run.jobs()[:1]:
        job.kill()
    run.end()


def fill_disk(run: Run) -> None:
    if not os.path.ismount(run.folder):
        for process in [*run.jobs(), *run.snakemake()]:
            with contextlib.suppress(ProcessLookupError):
                resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (0, 0))
        run.end()
        return
    with (run.folder / "ballast").open("wb", buffering=0) as stream, contextlib.suppress(OSError):
        while True:
            stream.write(bytes(2**16))
    try:
        run.end()
        again = Run(run.folder, (), 1)  # with a disk that is still full
        assert again.end() == 1 and "nearly full" in again.text(), again.text()
    finally:
        (run.folder / "ballast").unlink()


def starve_job(run: Run) -> None:
    for job in run.jobs()[:1]:
        with contextlib.suppress(ProcessLookupError):
            resource.prlimit(job.pid, resource.RLIMIT_AS, (2**20, 2**20))
    run.end()


@dataclass(frozen=True)
class Way:
    name: str
    stop: Callable[[Run], None]
    needs_job: bool = False  # strikes a job, so waits for one
    says: str = ""  # what the runner must say if it fails


WAYS = (
    Way("kill -9 of all", kill_group),
    Way("kill -9 of one job", kill_job, needs_job=True, says="killed from outside"),
    Way("Ctrl-C", interrupt, says="Interrupted"),
    Way("kill -9 of Snakemake", kill_snakemake, says="Snakemake itself was killed"),
    Way("full disk", fill_disk, needs_job=True, says="disk is full|size of files"),
    Way("terminal closed", hang_up),
    Way("out of memory", starve_job, needs_job=True, says="out of memory|killed from outside|has stopped"),
)


@dataclass
class Kill:
    """One interruption, as told in the table."""

    moment: float  # s of the undisturbed run
    way: str
    running: tuple[str, ...]
    code: int = 0  # of the runner that was stopped
    recovery: float = np.nan  # s from the next start to its first job
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
        jobs = len(
            set(
                re.findall(
                    r"Finished jobid: (\d+)", next((self.calm / ".snakemake/log").iterdir()).read_text()
                )
            )
        )
        print(f"undisturbed: {self.duration:.0f} s, {jobs} jobs, {len(self.expected)} files", flush=True)

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
        at, redo, before, used = (
            0.0,
            0.0,
            {},
            0,
        )  # position in the undisturbed run, s of work to be done again
        for moment, way in zip(moments, ways):
            run = self.start()
            if at < self.until_job:
                alive = run.wait(seconds=moment)
            else:
                alive = run.wait_for_job()
                self.went_on(run)
                alive = alive and run.wait(seconds=moment - at + redo)
            if alive and way.needs_job:
                alive = run.wait_for_job()
            if not alive:  # it was faster than the undisturbed run
                self.complete(run, before)
                return used
            redo, used = self.strike(run, way, moment, before), used + 1
            at, before = moment, finished(self.folder)
        run = self.start()
        run.wait_for_job()
        self.went_on(run)
        self.complete(run, before)
        return used

    def went_on(self, run: Run) -> None:
        if self.kills and np.isnan(self.kills[-1].recovery):
            self.kills[-1].recovery = time.monotonic() - run.start

    def strike(self, run: Run, way: Way, moment: float, before: dict[str, int]) -> float:
        """Stop the run, check what it leaves, and return for how long (s) the jobs it lost had been running."""
        ages, running = [0.0], []
        for job in run.jobs():
            with contextlib.suppress(psutil.Error):
                running.append(_job(job) or "?")
                ages.append(time.time() - job.create_time())
        kill = Kill(moment, way.name, tuple(sorted(running)))
        self.kills.append(kill)
        way.stop(run)
        kill.code = code = run.end()
        if code and running and way.says and not re.search(way.says, run.text()):
            kill.faults.append(f"not said: {way.says!r} in\n{run.text()[-3000:]}")
        kill.faults += self.compare(complete=False) + self.untouched(before)
        print(
            f"{len(self.kills):3d}  {moment:5.1f} s  {way.name:22s} {', '.join(running) or 'no job':50s} exit {code}",
            *kill.faults,
            sep="\n     ",
            flush=True,
        )
        self.faults += kill.faults
        return max(ages)

    def untouched(self, before: dict[str, int]) -> list[str]:
        """Results of finished jobs that were made again or lost."""
        now = {name: path.stat().st_mtime_ns for name in before if (path := self.folder / name).exists()}
        return [
            f"{name} was finished and is lost" for name, changed in before.items() if now.get(name) != changed
        ]

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

    def table(self) -> str:
        rows = ["moment (s)  way                     to first job (s)  jobs lost  running"]
        for kill in self.kills:
            rows.append(
                f"{kill.moment:10.1f}  {kill.way:22s} {kill.recovery:17.1f} {len(kill.running):10d}  "
                f"{', '.join(kill.running) or '-'}"
            )
        return "\n".join(rows)


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
        print(
            "a full disk is",
            f"a tmpfs of {DISK} MB" if mounted else "a limit on the size of files",
            flush=True,
        )
        done.prepare(done.folder)
        stack.callback(_end_all, top)
        left = [ways[i % len(ways)] for i in range(kills)]
        while left:
            left = left[done.round(left) :]
        stopped = {kill.way for kill in done.kills if kill.code}
        done.faults += [f"{way} never stopped a run" for way in {kill.way for kill in done.kills} - stopped]
    return done


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.workflow.interruption", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--targets", nargs="+", default=TARGETS)
    parser.add_argument("--ways", nargs="+", choices=[way.name for way in WAYS], help="only these, in turn")
    options = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))  # so that the disk is unmounted
    ways = [way for way in WAYS if way.name in (options.ways or [way.name])]
    done = study(options.kills, options.seed, options.targets, options.cores, ways)
    print(f"\n{done.table()}\n\n{len(done.faults)} faults")
    return bool(done.faults)


if __name__ == "__main__":
    sys.exit(main())
