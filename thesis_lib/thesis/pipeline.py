"""Run the pipeline such that an interruption loses only the jobs that were running.

    python -m thesis_lib.thesis.pipeline [--scale quick|default] [--configfile FILE ...] [--cores N] [TARGET ...]

A thin runner around Snakemake, in the same terminal group, so that Ctrl-C reaches both.  Before the start it takes a
lock that the kernel releases at any exit, removes remains of a killed run (orphaned jobs, Snakemake's lock) and checks
disk space and permissions.  After a failure it reports failed jobs, the likely cause and a remedy.  The exit code is
Snakemake's, 128 + n if signal n ended it.
"""

import argparse
import fcntl
import importlib.util
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.foundation.byte_code import keep_byte_code
from thesis_lib.foundation.command_line import WRONG, not_installed
from thesis_lib.foundation.errors import UserError

STATE = Path(".snakemake")
WRITTEN = (Path(), Path("results"), Path("data"), Path("data/simulated"), STATE)  # folders into which a run writes
SCALES = {"quick": 100, "default": 250}  # MB of free disk space required: twice the size of a run
SHOWN = 5  # number of failed jobs listed
TAIL = 20_000  # bytes at the end of a log that are searched for the cause
PATIENCE = 5.0  # s, time granted to processes that are ending

FEWER = "Run fewer jobs at once (--cores 1, CORES=1 with make), or close other programs."
# last line of a traceback; for our own errors, the name is omitted
RAISED = re.compile(r"^(?:thesis_lib\.[\w.]+: (.+)|(\w[\w.]*(?:Error|Exception)\b.*))$", re.MULTILINE)
# text in a log -> cause and remedy
CAUSES = {
    r"No space left on device|Disk quota exceeded": (
        "the disk is full",
        "Free some space ('make clean' would delete all results); files are never left half-written.",
    ),
    r"File too large": ("a limit on the size of files was reached (ulimit -f)", "Raise the limit."),
    r"<Signals\.SIGKILL: 9>": (
        "a job was killed from outside (SIGKILL), which is what the system does when memory runs out",
        FEWER,
    ),
    r"MemoryError|Unable to allocate|Cannot allocate memory|std::bad_alloc": ("a job ran out of memory", FEWER),
}


def run(
    targets: Sequence[str] = (), scale: str = "default", configfiles: Sequence[str] = (), cores: int | None = None
) -> int:
    """Run `targets` (by default all) of the pipeline in the current folder and return the exit code.

    UserError if another run is active here, the disk is nearly full, or a folder cannot be written.
    """
    check_folder(SCALES[scale])
    keep_byte_code()
    lock = hold_lock()
    try:
        overlays = [*([] if scale == "default" else [f"config/{scale}.yaml"]), *configfiles]
        command = [sys.executable, "-m", "snakemake"]
        command += ["--cores", str(cores)] if cores else []
        command += ["--configfile", *overlays] if overlays else []
        command += ["--logger", "rich"] if sys.stdout.isatty() else []
        recover([*command, "--unlock", "--", *targets])
        return _snakemake([*command, "--", *targets], lock)
    finally:
        os.close(lock)


def check_folder(needed: int) -> None:
    """Raise a UserError, with folder and remedy, if `needed` MB of disk space or permissions are missing."""
    if not Path("Snakefile").is_file():
        raise UserError(f"{Path.cwd()} has no Snakefile; run this in the root folder of the repository.")
    for folder in filter(Path.is_dir, WRITTEN):
        if not os.access(folder, os.W_OK | os.X_OK):
            raise UserError(
                f"{folder.resolve()} cannot be written by this user; change its owner (an earlier run as root?) "
                "or work in a copy of the repository."
            )
        free = shutil.disk_usage(folder).free // 10**6
        if free < needed:
            raise UserError(
                f"The disk of {folder.resolve()} is nearly full: {free} MB are free, this run may need {needed} MB. "
                "Free some space and run again; nothing that is finished is lost."
            )


def hold_lock() -> int:
    """Lock this folder and return the file descriptor; the kernel releases the lock when its holders have ended.

    UserError if another run holds it (the message names it), or if the file system has no locks.
    """
    STATE.mkdir(exist_ok=True)
    lock = os.open(STATE / "pipeline.lock", os.O_RDWR | os.O_CREAT, 0o644)
    end = time.monotonic() + PATIENCE  # the holder may be a killed run whose processes are about to end
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        except BlockingIOError:
            if time.monotonic() > end:
                runner = os.pread(lock, 20, 0).decode()
                os.close(lock)
                raise UserError(_at_work([p.pid for p in _processes()[0]] or [runner])) from None
            time.sleep(0.1)
        except OSError as error:
            os.close(lock)
            raise UserError(
                f"The file system of {Path.cwd()} has no file locks ({error.strerror}), so two runs could interfere; "
                "work in a copy on a local disk, or call snakemake yourself."
            ) from error
    os.ftruncate(lock, 0)
    os.pwrite(lock, str(os.getpid()).encode(), 0)
    return lock


def recover(unlock: Sequence[str]) -> None:
    """Remove the remains of a killed run: jobs that still run, then Snakemake's lock (command `unlock`).

    UserError if a Snakemake is active here, or its lock cannot be released.
    """
    snakemakes, orphans = _processes()
    locked = any((STATE / "locks").glob("*.lock"))
    if locked and snakemakes:
        raise UserError(_at_work([p.pid for p in snakemakes]))
    if orphans:
        _end(orphans)
    if locked:
        done = subprocess.run(unlock, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode:
            raise UserError(
                "Snakemake's lock of a killed run cannot be released; fix the problem it reports, or delete "
                f"{STATE / 'locks'}:\n{done.stdout.strip()}"
            )
    if orphans or locked:
        jobs = f"; {len(orphans)} of its processes were still running and have been ended" if orphans else ""
        _say(f"An earlier run was killed{jobs}. No finished job is lost; the run continues from there.")


def _at_work(processes: Sequence) -> str:
    numbers = " ".join(map(str, processes))
    return (
        f"Another run is at work in {Path.cwd()} (process {numbers}). Wait for it, or end it with 'kill {numbers}' "
        "(it lets running jobs finish), then run again."
    )


def _processes() -> tuple[list, list]:
    """Find Snakemakes in this folder, and processes of its jobs without a Snakemake among their ancestors."""
    import psutil  # imported late, for users of the library who never run the pipeline

    here, uid, runner = str(Path.cwd()), os.getuid(), os.getpid()
    snakemakes, jobs = [], []
    for process in psutil.process_iter():
        try:
            if process.uids().real != uid or process.pid == runner or process.cwd() != here:
                continue
            words = process.cmdline()
        except psutil.Error:  # the process has ended, or may not be inspected
            continue
        if not words or not re.match(r"python|(ba)?sh$|snakemake", Path(words[0]).name):
            continue  # an editor that shows a script is not a job
        begins = [Path(word).name for word in words[:2]]
        if any(".snakemake/scripts/" in word for word in words):
            jobs.append(process)
        elif "snakemake" in begins or ["-m", "snakemake"] in [words[i : i + 2] for i in range(1, 4)]:
            snakemakes.append(process)
    orphans = []
    for job in jobs:
        try:
            if not set(job.parents()) & set(snakemakes):
                orphans += [job, *job.children(recursive=True)]
        except psutil.Error:
            continue
    return snakemakes, list(dict.fromkeys(orphans))


def _end(processes: list) -> None:
    import psutil

    for process in processes:
        process.terminate()  # psutil also compares start times, so a reused process number is not affected
    for process in psutil.wait_procs(processes, timeout=PATIENCE)[1]:
        process.kill()
    if alive := psutil.wait_procs(processes, timeout=PATIENCE)[1]:
        raise UserError(
            f"Jobs of a killed run cannot be ended (processes {', '.join(str(p.pid) for p in alive)}); "
            "end them, then run again."
        )


def _snakemake(command: Sequence[str], lock: int) -> int:
    """Run Snakemake, explain its failure, and return its exit code."""
    received: list[int] = []
    children: list[subprocess.Popen] = []

    def on_signal(number: int, _frame: object) -> None:
        received.append(number)
        if number == signal.SIGTERM:  # unlike Ctrl-C, it reaches only one process
            for child in children:
                child.terminate()

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    started = time.time()
    try:
        # Snakemake shares the lock, so killing this runner alone does not allow a second run
        children.append(subprocess.Popen(command, pass_fds=(lock,)))
        code = children[0].wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if code:
        _say(explain(code, latest_log(started), bool(received)))
    return code if code >= 0 else 128 - code


def latest_log(since: float) -> str:
    """End of Snakemake's latest log since that time (s since the epoch); empty if there is none."""
    logs = [path for path in (STATE / "log").glob("*.snakemake.log") if path.stat().st_mtime >= since - 1.0]
    return _tail(max(logs), 10**7) if logs else ""  # names are times


def explain(code: int, log: str, interrupted: bool = False) -> str:
    """Message on the reason why Snakemake stopped, and on the remedy; `code` is its exit code."""
    failed = [
        (rule, (re.search(r"^    log: (\S+)", block, re.MULTILINE) or ["", ""])[1])
        for rule, block in re.findall(r"^Error in rule (\w+):\n((?:    .*\n?)+)", log, re.MULTILINE)
    ]
    lines = ["Interrupted." if interrupted else "The pipeline has stopped."]
    again = "Nothing that was finished is lost. To go on:"  # the cause may not recur
    if not interrupted:
        for rule, path in failed[:SHOWN]:
            lines.append(f"  failed: {rule}" + (f", log: {path}" if path else ""))
            if path and (raised := RAISED.findall(_tail(Path(path), TAIL))):
                lines.append(f"    {''.join(raised[-1])}")
        if len(failed) > SHOWN:
            lines.append(f"  failed: {len(failed) - SHOWN} more")
        texts = "\n".join([log, *(_tail(Path(path), TAIL) for _, path in failed if path)])
        cause = next((known for pattern, known in CAUSES.items() if re.search(pattern, texts)), None)
        if shutil.disk_usage(".").free < 10**6:  # in this case even the logs may be incomplete
            cause = next(iter(CAUSES.values()))
        if cause:
            lines += [f"  cause: {cause[0]}", f"  remedy: {cause[1]}"]
        elif code == -signal.SIGKILL:
            lines.append("  cause: Snakemake itself was killed from outside (SIGKILL); perhaps memory ran out")
        elif failed:
            lines.append(
                "The same command would fail there again. Follow the error message; if it names nothing that you can "
                "change, this is a bug of the program: please report it with that log."
            )
            again = "Nothing that was finished is lost. Then:"
        else:
            lines.append("  No job has failed; Snakemake's message above states the problem.")
            again = "Nothing that was finished is lost. Once it is fixed:"
    return "\n".join([*lines, f"{again} {_same_command()}"])


def _tail(path: Path, size: int) -> str:
    try:
        with path.open("rb") as stream:
            stream.seek(max(path.stat().st_size - size, 0))
            return stream.read().decode(errors="replace")
    except OSError:
        return ""


def _same_command() -> str:
    if "MAKELEVEL" in os.environ:
        return "the same make command again"
    return shlex.join(["python", "-m", "thesis_lib.thesis.pipeline", *sys.argv[1:]])


def _say(text: str) -> None:
    print(f"\n{text}", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    description = "Run the pipeline; an interrupted run continues where it stopped."
    parser = argparse.ArgumentParser(prog="python -m thesis_lib.thesis.pipeline", description=description)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="rules or files; default: all")
    parser.add_argument("--scale", choices=SCALES, default="default", help="size of the studies; if omitted: default")
    parser.add_argument("--configfile", action="append", default=[], metavar="FILE", help="overlay with your settings")
    parser.add_argument("--cores", type=int, metavar="N", help="parallel jobs; default: 2 (profiles/default)")
    options = parser.parse_args(arguments)
    for package in ("snakemake", "psutil"):
        if importlib.util.find_spec(package) is None:
            print(f"error: {not_installed(package)}", file=sys.stderr)
            return WRONG
    try:
        return run(options.targets, options.scale, options.configfile, options.cores)
    except UserError as error:
        _say(str(error))
        return 1
    except KeyboardInterrupt:
        _say("Interrupted before any job was started.")
        return 128 + signal.SIGINT


if __name__ == "__main__":
    sys.exit(main())
