"""One input read in a forked process with bounds, and watched for what a reader must not do.

The process keeps its address space within `MEMORY` of what its imports need, may not write outside its output folder
(its own folder is compared before and after; Python's audit events tell of the rest), start programs, open sockets or
unpickle, and is killed when it hangs.  One program of our own may be started, which bounds itself: `PROGRAM`.
"""

import contextlib
import faulthandler
import io
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path

from thesis_lib.datasets.sources.motion_capture import own_process
from thesis_lib.foundation.errors import UserError

MEMORY = 1 << 30  # bytes above the imports
# s of processor time for one input: the worst takes 3.4 s on idle cores, and three times as much on busy ones
CPU_LIMIT = 20.0
WALL_LIMIT = 60.0  # s
WORKING = 0.1  # s of processor time; a reader that gets less within `WALL_LIMIT` waits, such as for a pipe
SECRET = "SECRET-a5c1"  # stands in a file outside the input folder: must not come back in a message
ACCEPTED, REFUSED, FAILED = "accepted", "refused", "failed"

FORBIDDEN = {
    *("os.system", "os.exec", "os.posix_spawn", "os.fork", "subprocess.Popen", "pty.spawn"),
    *("socket.connect", "socket.bind", "urllib.Request", "pickle.find_class", "ctypes.dlopen"),
}
STARTED = [sys.executable, "-P", own_process.__file__]
WRITES = {
    *("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod", "os.chown"),
    *("os.utime", "shutil.rmtree", "shutil.move", "shutil.copyfile", "shutil.copytree", "tempfile.mkstemp"),
}


@dataclass(frozen=True)
class Outcome:
    """What became of one input: accepted, refused or failed; message; processor time (s); memory (bytes)."""

    status: str
    message: str
    seconds: float = 0.0
    memory: int = 0


@dataclass(frozen=True)
class Task:
    """`place` fills an input folder; `read` (input folder, output folder) reads it.

    contained: nothing outside the input folder may come back in a message.
    """

    place: Callable[[Path, Path], None]
    read: Callable[[Path, Path], None]
    contained: bool = True


class _Watch:
    """Collects forbidden audit events while it is on."""

    def __init__(self) -> None:
        self.on, self.out, self.seen = False, "", []
        sys.addaudithook(self._event)

    def _event(self, event: str, arguments: tuple) -> None:
        if not self.on:
            return
        if event == "subprocess.Popen" and list(arguments[1])[:3] == STARTED:
            return
        if event in FORBIDDEN:
            self.seen.append(f"{event}{arguments!r}"[:200])
        elif event in WRITES or (event == "open" and _writes(arguments)):
            path = _absolute(arguments[0])
            allowed = (self.out, os.devnull) if self.out else (os.devnull,)
            if path and not path.startswith(allowed) and not path.endswith(".pyc"):
                self.seen.append(f"{event} {path}"[:200])


def _absolute(path: object) -> str:
    """Absolute path without following links; "" for anything but a path, such as a file that is open already."""
    return str(Path.cwd() / os.fsdecode(path)) if isinstance(path, str | bytes | os.PathLike) else ""


def _writes(arguments: tuple) -> bool:
    _, mode, flags = arguments
    if isinstance(mode, str):
        return any(letter in mode for letter in "wax+")
    return bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC))


def _memory(peak: str) -> int:
    """A line of /proc/self/status in bytes."""
    text = Path("/proc/self/status").read_text()
    return int(text.split(f"{peak}:")[1].split()[0]) * 1024


def _listing(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def examine(task: Task, names: tuple[str, ...], root: Path, watch: _Watch, started: Callable[[], None]) -> Outcome:
    """Read one input in this process; `names`: one of them must stand in a refusal."""
    shutil.rmtree(root, ignore_errors=True)
    folder, out = root / "input", root / "out"
    for made in (folder, out, root / "cwd"):
        made.mkdir(parents=True)
    secret = root / "secret.txt"
    secret.write_text(f"{SECRET},{SECRET}\n{SECRET}: 1\n")
    os.chdir(root / "cwd")
    task.place(folder, secret)
    before = _listing(root)
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts again from here
    base = _memory("VmRSS")
    tempfile.tempdir = str(out)
    started()
    watch.seen, watch.out, watch.on = [], str(out), True
    begin, status, message = time.process_time(), ACCEPTED, ""
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            task.read(folder, out)
    except UserError as error:
        status, message = REFUSED, str(error)
    except BaseException:
        status, message = FAILED, traceback.format_exc(limit=-4)
    watch.on = False
    seconds, memory = time.process_time() - begin, _memory("VmHWM") - base
    stray = {path for path in _listing(root) - before if not path.startswith("out")}
    if watch.seen or stray:
        status, message = FAILED, f"forbidden: {sorted(stray)} {watch.seen[:5]}"
    elif status == REFUSED and not any(name in message for name in names):
        status, message = FAILED, f"names no file: {message[:500]}"
    elif task.contained and SECRET in message:
        status, message = FAILED, f"tells what stands outside the folder: {message[:500]}"
    elif status == REFUSED and len(message) > 100_000:
        status, message = FAILED, f"a message of {len(message):,} characters"
    elif seconds > CPU_LIMIT:
        status, message = FAILED, f"took {seconds:.1f} s"
    return Outcome(status, message, seconds, memory)


def _serve(pipe: Connection, root: Path, make: Callable[[int], tuple[Task, tuple[str, ...]]]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    faulthandler.disable()  # the pool tells a crash
    resource.setrlimit(resource.RLIMIT_AS, (_memory("VmSize") + MEMORY, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # what C code says
    watch = _Watch()
    while (index := pipe.recv()) is not None:
        task, names = make(index)
        pipe.send(examine(task, names, root, watch, lambda: pipe.send(None)))


class Pool:
    """Processes that live on from input to input, and are replaced when they hang or crash.

    Args:
        make: index -> task and the names of which a refusal must hold one; runs in the process, so that nothing but
            numbers goes to it.
        root: scratch folder.
        say: is told the progress.
    """

    def __init__(
        self,
        make: Callable[[int], tuple[Task, tuple[str, ...]]],
        root: Path,
        jobs: int = 1,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self.make, self.root, self.say = make, root, say
        self.workers = [self._fork(i) for i in range(jobs)]

    def _fork(self, i: int) -> dict:
        ours, theirs = Pipe()
        pid = os.fork()
        if pid == 0:
            try:
                ours.close()
                _serve(theirs, self.root / f"worker{i}", self.make)
            finally:
                os._exit(0)
        theirs.close()
        return {"number": i, "pid": pid, "pipe": ours, "index": None}

    def run(self, indices: range) -> "list[tuple[int, Outcome]]":
        """Outcome of each index, in the order in which they are done."""
        waiting, done = iter(indices), []
        busy = [worker for worker in self.workers if self._next(worker, waiting)]
        while busy:
            ready = wait([worker["pipe"] for worker in busy], timeout=1.0)
            for worker in list(busy):
                outcome = self._outcome(worker, worker["pipe"] in ready)
                if outcome is None:
                    continue
                done.append((worker["index"], outcome))
                if self.say and len(done) % 500 == 0:
                    self.say(f"{len(done)} of {len(indices)} inputs")
                if not self._next(worker, waiting):
                    busy.remove(worker)
        return done

    def _next(self, worker: dict, waiting) -> bool:
        worker["index"] = next(waiting, None)
        worker["since"], worker["cpu"] = time.monotonic(), _cpu(worker["pid"])
        if worker["index"] is None:
            return False
        worker["pipe"].send(worker["index"])
        return True

    def _outcome(self, worker: dict, ready: bool) -> Outcome | None:
        if ready:
            try:
                answer = worker["pipe"].recv()
            except (EOFError, ConnectionResetError):
                _, code = os.waitpid(worker["pid"], 0)
                worker |= {**self._fork(worker["number"]), "index": worker["index"]}
                return Outcome(FAILED, f"crashed: {os.waitstatus_to_exitcode(code)}")
            if answer is None:  # the input lies there and is being read from now on
                worker["since"], worker["cpu"] = time.monotonic(), _cpu(worker["pid"])
            return answer
        used = _cpu(worker["pid"]) - worker["cpu"]
        waits = time.monotonic() - worker["since"] > WALL_LIMIT and used < WORKING
        if used < 2 * CPU_LIMIT and not waits:
            return None
        os.kill(worker["pid"], signal.SIGKILL)
        os.waitpid(worker["pid"], 0)
        worker |= {**self._fork(worker["number"]), "index": worker["index"]}
        return Outcome(FAILED, "hangs", used)

    def close(self) -> None:
        """End the processes."""
        for worker in self.workers:
            worker["pipe"].send(None)
            os.waitpid(worker["pid"], 0)


def _cpu(pid: int) -> float:
    """Processor time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
