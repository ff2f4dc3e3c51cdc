"""The pipeline started as a terminal would start it, and the ways to stop it."""

import contextlib
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

OVERLAY = "one_minute.yaml"
LIMIT = 600.0  # s until a run counts as hung
POLL = 0.1  # s


class Run:
    """One start of the pipeline in a group of its own, as a terminal would start it."""

    def __init__(self, folder: Path, targets: Sequence[str], cores: int):
        self.output = Path(f"{folder}.{time.monotonic_ns()}.output")
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHONPATH", "SNAKEMAKE", "MAKE"))}
        command = [sys.executable, "-m", "thesis_lib.thesis.pipeline", "--cores", str(cores)]
        self.folder, self.start = folder, time.monotonic()
        with self.output.open("w") as stream:
            self.process = subprocess.Popen(
                [*command, "--configfile", OVERLAY, *targets],
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
                if os.getpgid(process.pid) == self.process.pid and job_of(process):
                    found.append(process)
        return found

    def snakemake(self) -> list[psutil.Process]:
        """Snakemake itself, once the runner has started it."""
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
        """Wait until a job runs (True), or the run has ended (False)."""
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
        """What the run has said."""
        return self.output.read_text(encoding="utf-8", errors="replace")


def _as_in_a_terminal() -> None:
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)  # ignored under nohup and by jobs in the background


def job_of(process: psutil.Process) -> str | None:
    """Rule (name of the script) of a job's process; None for any other process."""
    match = re.search(r"\.snakemake/scripts/tmp\w+\.(\w+)\.py", " ".join(process.cmdline()))
    return match and match[1]


# --- ways; `Run.end` waits for what they have stopped ---


def kill_group(run: Run) -> None:
    os.killpg(run.process.pid, signal.SIGKILL)


def kill_snakemake(run: Run) -> None:
    run.wait(lambda: bool(run.snakemake()))
    for process in run.snakemake():
        process.kill()


def interrupt(run: Run) -> None:
    os.killpg(run.process.pid, signal.SIGINT)


def hang_up(run: Run) -> None:
    os.killpg(run.process.pid, signal.SIGHUP)


def kill_job(run: Run) -> None:
    for job in run.jobs()[:1]:
        job.kill()


def fill_disk(run: Run) -> None:
    if not os.path.ismount(run.folder):
        for process in [*run.jobs(), *run.snakemake()]:
            with contextlib.suppress(ProcessLookupError):
                resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (0, 0))
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


@dataclass(frozen=True)
class Way:
    """A way to stop a run, and what is expected of it."""

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
