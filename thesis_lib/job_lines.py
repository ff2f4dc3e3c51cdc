"""Print how long the pipeline will take, and a line for each job that ends, for logs, where Snakemake shows neither.

    81 jobs, about 9 min of CPU on this machine: about 5 min on 2 cores
    [12/81] ch2_programs: Chapter 2: equations 2.12 to 2.14, wheel; 72 s of CPU in 48 s, about 3 min left

All is read from Snakemake's log below .snakemake/log.  The time left is the measured time of the unfinished jobs
(config/resources.yaml), scaled by the pace of this machine and then of this run so far.
"""

import contextlib
import re
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

from thesis_lib.foundation.progress import duration

LOGS = Path(".snakemake/log")
EVERY = 1.0  # s between two looks at the log
UNMEASURED = 1.0  # CPU s of a job that was never measured, such as a target without a command
TRUST = 30.0  # CPU s of finished jobs from which on their pace counts more than the measured one


class JobLines:
    """Reads Snakemake's log piece by piece and reports the jobs that have ended.

    `cpu_s` maps a rule to the CPU time expected of one job in s.
    """

    def __init__(self, cpu_s: Mapping[str, float]):
        self._cpu_s = cpu_s
        self._in_table = False
        self._left: Counter[str] = Counter()  # jobs of each rule that have not ended
        self._names: dict[str, str] = {}  # job number -> its message, or its wildcards
        self._job, self._total, self._ended, self._cores = "", 0, 0, 1
        self._measured = 0.0  # CPU time that was expected of the ended jobs, s

    def read(self, text: str, cpu: float, wall: float) -> list[str]:
        """What to print of the jobs that ended in `text`, further whole lines of the log.

        `cpu` and `wall` are the CPU time of the ended jobs and the wall time of the run so far, in s.
        """
        return [said for line in text.splitlines() if (said := self._read_line(line, cpu, wall))]

    def _read_line(self, line: str, cpu: float, wall: float) -> str:
        if self._in_table:
            if row := re.fullmatch(r"(\w+) +(\d+)", line):
                self._in_table = row[1] != "total"
                if self._in_table:
                    self._left[row[1]] = int(row[2])
                else:
                    self._total = int(row[2])
                    return self._start()
        elif re.fullmatch(r"job +count", line):
            self._in_table, self._ended = True, 0
            self._left.clear()
        elif cores := re.match(r"Provided cores: (\d+)", line):
            self._cores = int(cores[1])
        elif job := re.match(r"Job (\d+): (.*)", line):
            self._names[job[1]] = job[2]
        elif job := re.match(r"    jobid: (\d+)", line):
            self._job = job[1]
        elif wildcards := re.match(r"    wildcards: (.*)", line):
            self._names.setdefault(self._job, wildcards[1])
        elif job := re.match(r"Finished jobid: (\d+) \(Rule: (\w+)\)", line):
            return self._end(job[1], job[2], cpu, wall)
        return ""

    def _start(self) -> str:
        measured = sum(n * self._cpu_s.get(rule, UNMEASURED) for rule, n in self._left.items())
        jobs, cores = (f"{n} {noun}{'s' * (n > 1)}" for n, noun in ((self._total, "job"), (self._cores, "core")))
        alone = duration(measured / self._cores)
        return f"{jobs}, about {duration(measured)} of CPU on this machine: about {alone} on {cores}"

    def _end(self, job: str, rule: str, cpu: float, wall: float) -> str:
        self._ended += 1
        self._left[rule] -= 1
        self._measured += self._cpu_s.get(rule, UNMEASURED)
        name = f"{rule}: {self._names[job]}" if job in self._names else rule
        measured_left = sum(n * self._cpu_s.get(rule, UNMEASURED) for rule, n in self._left.items())
        pace = (cpu + TRUST) / (self._measured + TRUST)
        rest = f", about {duration(pace * measured_left / self._cores)} left" if measured_left > 0.0 else ""
        return f"[{self._ended}/{self._total}] {name}; {duration(cpu)} of CPU in {duration(wall)}{rest}"


@contextlib.contextmanager
def printed_jobs(cpu_s: Mapping[str, float]) -> Iterator[None]:
    """While Snakemake runs as a child of this process, print a line for each job that ends."""
    old, over = set(LOGS.glob("*.log")), threading.Event()
    thread = threading.Thread(target=_follow, args=(JobLines(cpu_s), old, over), daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _follow(lines: JobLines, old: set[Path], over: threading.Event) -> None:
    """Print new text of the log that is not among the `old` ones, until `over`."""
    start, cpu, position, log, last = time.monotonic(), 0.0, 0, None, False
    while not last:
        last = over.wait(EVERY)
        log = log or max(set(LOGS.glob("*.log")) - old, default=None)
        if log is None:
            continue
        with log.open("rb") as stream:
            stream.seek(position)
            text = stream.read()
        text = text[: text.rfind(b"\n") + 1]
        position += len(text)
        cpu = max(cpu, _cpu_of_children())
        for line in lines.read(text.decode(errors="replace"), cpu, time.monotonic() - start):
            print(line, flush=True)


def _cpu_of_children() -> float:
    """CPU time of Snakemake and of its jobs that have ended, s."""
    import psutil  # late, for users of the library who never run the pipeline

    total = 0.0
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # it has ended
            total += sum(child.cpu_times()[:4])
    return total
