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


def job_lines(log: str, cpu_s: Mapping[str, float], cpu: float, wall: float) -> list[str]:
    """What the log of a run says so far: how many jobs there are, and a line for each that has ended.

    `cpu_s` maps a rule to the CPU time expected of one job; `cpu` and `wall` are the CPU time of the ended jobs and the
    wall time of the run so far, in s.
    """
    lines = []
    for run in re.split(r"^job +count\n", log, flags=re.MULTILINE)[1:]:
        table = run.partition("\n\n")[0]
        left = Counter({rule: int(n) for rule, n in re.findall(r"^(\w+) +(\d+)$", table, re.MULTILINE)})
        if not (total := left.pop("total", 0)):  # the table is still being written
            break
        cores = int((re.search(r"^Provided cores: (\d+)", log, re.MULTILINE) or ["", "1"])[1])
        names = dict(re.findall(r"^    jobid: (\d+)\n(?:    .*\n)*?    wildcards: (.*)", run, re.MULTILINE))
        names |= dict(re.findall(r"^Job (\d+): (.*)", run, re.MULTILINE))
        whole = rest = _expected(left, cpu_s)
        jobs, on = (f"{n} {noun}{'s' * (n > 1)}" for n, noun in ((total, "job"), (cores, "core")))
        lines.append(f"{jobs}, about {duration(whole)} of CPU on this machine: about {duration(whole / cores)} on {on}")
        for i, (job, rule) in enumerate(re.findall(r"^Finished jobid: (\d+) \(Rule: (\w+)\)", run, re.MULTILINE), 1):
            left[rule] -= 1
            rest = _expected(left, cpu_s)
            pace = (cpu + TRUST) / (whole - rest + TRUST)
            then = f", about {duration(pace * rest / cores)} left" if rest > 0.0 else ""
            name = f"{rule}: {names[job]}" if job in names else rule
            lines.append(f"[{i}/{total}] {name}; {duration(cpu)} of CPU in {duration(wall)}{then}")
    return lines


def _expected(jobs: Mapping[str, int], cpu_s: Mapping[str, float]) -> float:
    return sum(n * cpu_s.get(rule, UNMEASURED) for rule, n in jobs.items())


@contextlib.contextmanager
def printed_jobs(cpu_s: Mapping[str, float]) -> Iterator[None]:
    """While Snakemake runs as a child of this process, print a line for each job that ends."""
    old, over = set(LOGS.glob("*.log")), threading.Event()
    thread = threading.Thread(target=_follow, args=(cpu_s, old, over), daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _follow(cpu_s: Mapping[str, float], old: set[Path], over: threading.Event) -> None:
    """Print the lines of the log that is not among the `old` ones, until `over`."""
    start, cpu, shown, last = time.monotonic(), 0.0, 0, False
    while not last:
        last = over.wait(EVERY)
        cpu = max(cpu, _cpu_of_children())
        for log in set(LOGS.glob("*.log")) - old:
            text = log.read_text(encoding="utf-8", errors="replace").rpartition("\n")[0]
            lines = job_lines(text, cpu_s, cpu, time.monotonic() - start)
            for line in lines[shown:]:
                print(line, flush=True)
            shown = len(lines)


def _cpu_of_children() -> float:
    """CPU time of Snakemake and of its jobs that have ended, s."""
    import psutil  # late, for users of the library who never run the pipeline

    total = 0.0
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # it has ended
            total += sum(child.cpu_times()[:4])
    return total
