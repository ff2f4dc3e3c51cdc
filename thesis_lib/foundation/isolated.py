"""Tasks in separate processes, so that a task that crashes, hangs or exhausts the memory ends alone.

Processes are forked from a server that has imported the heavy packages once (`forkserver`), so that a task needs no
start-up.  A process ends with its task, which frees the memory of the task.

Tasks answer in JSON.  A process ends when its parent does, however the parent ended; if memory runs out, the kernel
kills a task before the parent.
"""

import contextlib
import faulthandler
import json
import multiprocessing
import multiprocessing.connection
import multiprocessing.forkserver
import multiprocessing.resource_tracker
import os
import resource
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.terminal import VisibleStream

POLL = 0.25  # s between checks of time and memory; within it a task may exceed its limits
GRACE = 5.0  # s for a process to end after it has answered
MIB = 2**20
KILLED_FIRST = 800  # oom_score_adj, -1000 to 1000


@dataclass(frozen=True)
class Task:
    """Work for a process of its own; `arguments` are pickled, and the output of the process replaces the file `log`."""

    name: str
    arguments: tuple
    log: Path


@dataclass(frozen=True)
class ProcessResult:
    """Outcome of a task: either `result` (the return value of the work) or `failure` (the reason in words) is None.

    Times are in s; `peak_mib` is the peak of resident memory; it and `cpu_s` are None if the process was killed.
    """

    name: str
    result: dict | None
    failure: str | None
    wall_s: float
    cpu_s: float | None = None
    peak_mib: float | None = None


def run_isolated(
    work: Callable[..., dict],
    tasks: Iterable[Task],
    *,
    jobs: int,
    time_limit: float | None = None,
    memory_limit: float | None = None,
    preload: Sequence[str] = (),
) -> Generator[ProcessResult]:
    """Outcomes of `work(*task.arguments)`, in the order in which tasks end; errors of tasks are outcomes, too.

    Args:
        work: function of an importable module; returns a value that JSON can represent.
        jobs: number of processes at a time.
        time_limit, memory_limit: s of wall time and bytes of resident memory per task; None for no limit.
        preload: modules that the server imports once.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(preload))
    # Ctrl-C reaches all processes of a terminal; the tasks inherit that it is blocked, and this process ends them
    multiprocessing.resource_tracker.ensure_running()  # its start would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        multiprocessing.forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    waiting, running = deque(tasks), []
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                task = waiting.popleft()
                try:
                    running.append(_Running(context, work, task))
                except (OSError, EOFError) as error:
                    yield ProcessResult(task.name, None, f"its process could not be started: {error}", 0.0)
            multiprocessing.connection.wait([process.channel for process in running], POLL)
            for process in list(running):
                outcome = process.look(time_limit, memory_limit)
                if outcome:
                    running.remove(process)
                    yield outcome
    finally:
        for process in running:
            process.end()


class _Running:
    """A running task."""

    def __init__(self, context, work: Callable[..., dict], task: Task) -> None:
        self.task = task
        self.channel, child_end = context.Pipe(duplex=False)
        arguments = (work, task.arguments, str(task.log), child_end)
        self.process = context.Process(target=_child, args=arguments, daemon=True)
        self.process.start()
        self.start = time.monotonic()  # the first start waits for the server
        child_end.close()  # so that the end of the process ends the channel

    def look(self, time_limit: float | None, memory_limit: float | None) -> ProcessResult | None:
        """Outcome if the task has ended, or was ended here because it exceeded a limit; else None."""
        wall = time.monotonic() - self.start
        if self.channel.poll():
            try:
                answer = json.loads(self.channel.recv_bytes())
            except (EOFError, OSError):
                answer = {}
            self.process.join(GRACE)
            code = self.end()
            if answer.get("result") is None and answer.get("failure") is None:
                answer["failure"] = _exit_text(code)
            return ProcessResult(self.task.name, **{"result": None, "failure": None} | answer, wall_s=wall)
        if time_limit is not None and wall > time_limit:
            failure = f"took longer than the time limit of {time_limit:g} s"
        elif memory_limit is not None and _resident(self.process.pid) > memory_limit:
            failure = f"took more memory than the limit of {memory_limit / 1e9:g} GB"
        else:
            return None
        self.end()
        return ProcessResult(self.task.name, None, failure, wall)

    def end(self) -> int | None:
        """Kill the process if it is alive, and return its exit code (if negative, the signal that ended it)."""
        self.process.kill()
        self.process.join()
        self.channel.close()
        return self.process.exitcode


def _child(work: Callable[..., dict], arguments: tuple, log: str, channel) -> None:
    """Do the work with its output in the log; send the result or the reason of failure, time and memory."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(KILLED_FIRST))
    with Path(log).open("w", encoding="utf-8", errors="replace", buffering=1) as stream:
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
        sys.stdout = sys.stderr = VisibleStream(stream)  # logs are read on terminals, too
        faulthandler.enable(stream)
        answer = _answer(work, arguments)
        used = resource.getrusage(resource.RUSAGE_SELF)
        answer |= {"cpu_s": used.ru_utime + used.ru_stime, "peak_mib": used.ru_maxrss * 1024 / MIB}
        channel.send_bytes(json.dumps(answer).encode())


def _answer(work: Callable[..., dict], arguments: tuple) -> dict:
    try:
        return {"result": work(*arguments)}
    except UserError as error:
        print(f"error: {error}")
        return {"failure": str(error)}
    except MemoryError:
        traceback.print_exc()
        return {"failure": "ran out of memory"}
    except Exception as error:
        traceback.print_exc()
        return {"failure": f"crashed: {type(error).__name__}: {error}"}


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
    os._exit(1)


def _resident(pid: int) -> int:
    """Bytes of resident memory of a process; 0 if it has ended."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def _exit_text(code: int | None) -> str:
    """How a process without an answer ended."""
    if code is None or code >= 0:
        return f"ended without an answer (exit code {code})"
    name = signal.Signals(-code).name
    if code == -signal.SIGKILL:
        return f"was killed ({name}); most likely the machine ran out of memory: use fewer --jobs"
    return f"crashed ({name})"
