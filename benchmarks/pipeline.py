"""Cost of the pipeline beyond its jobs: a fresh copy of the checkout runs a target on two cores.

    python -m benchmarks.pipeline [TARGET] [--scale default] [--quick] [-o FILE.csv]

- overhead: CPU time of the Snakemake process itself (reading the rules, the graph, scheduling, checksums) over that of
  all its jobs together (their start-up included), as the kernel counts both;
- time to finish over the least that two cores allow, which is the longer of the critical path (the longest chain of
  jobs of which each needs the one before) and half of the sum, by start and end of each job in Snakemake's records.

Nothing is reused: the copy has no results.  The records of this checkout, if it has any, give sum and critical path of
what was run last, whatever that was.
"""

import base64
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from benchmarks.results import Results, benchmark_parser
from tests.workflow.pipeline_copy import ROOT, copy_pipeline
from thesis_lib.thesis.config import read_config

CORES = 2
RUNS = (("chapter3", "default"), ("all", "quick"))
SMALL = "datasets_present"  # one short job, for --quick
# Snakemake as its command runs it; at its end it writes what it used itself, and what its jobs used
MEASURED = """
import atexit, json, resource, sys
from pathlib import Path

def write():
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    Path("cpu.json").write_text(json.dumps([one.ru_utime + one.ru_stime for one in used]))

atexit.register(write)
from snakemake.cli import main
main()
"""


@dataclass(frozen=True)
class Job:
    """One job of a finished run: start and end in s, files read and written."""

    rule: str
    start: float
    end: float
    inputs: frozenset[str]
    outputs: frozenset[str]

    @property
    def seconds(self) -> float:
        """How long it took."""
        return self.end - self.start


def read_jobs(folder: Path) -> list[Job]:
    """The jobs in a working directory's .snakemake/metadata, which has a record for each output."""
    records: dict[tuple, list[tuple[str, Mapping]]] = {}
    for path in sorted((folder / ".snakemake/metadata").rglob("*")):
        if path.is_file():
            record = json.loads(path.read_text(encoding="utf-8"))
            # long names are cut into folders, each marked with @ but the last
            name = "".join(path.relative_to(folder / ".snakemake/metadata").parts).replace("@", "")
            output = base64.urlsafe_b64decode(name).decode()
            # several outputs of a job differ in nothing else that would tell it from other jobs of its rule
            records.setdefault((record["rule"], tuple(record["log"])), []).append((output, record))
    jobs = []
    for (rule, _), own in records.items():
        latest = max(record["endtime"] for _, record in own)
        jobs.append(
            Job(
                rule,
                min(record["starttime"] for _, record in own if record["endtime"] > latest - 1.0),
                latest,
                frozenset(name for _, record in own for name in record["input"]),
                frozenset(output for output, _ in own),
            )
        )
    return jobs


def critical_path(jobs: list[Job]) -> float:
    """Seconds of the longest chain of jobs of which each reads what the one before wrote."""
    maker = {output: i for i, job in enumerate(jobs) for output in job.outputs}
    done: dict[int, float] = {}

    def finish(i: int) -> float:
        if i not in done:
            before = {maker[name] for name in jobs[i].inputs if name in maker}
            done[i] = jobs[i].seconds + max((finish(k) for k in before), default=0.0)
        return done[i]

    return max((finish(i) for i in range(len(jobs))), default=0.0)


def least_time(jobs: list[Job], cores: int) -> float:
    """Seconds below which no schedule of these jobs on so many cores can get."""
    return max(critical_path(jobs), sum(job.seconds for job in jobs) / cores)


def measure(target: str, scale: str, results: Results) -> None:
    """Run a target in a fresh copy; print and add CPU time, overhead and time to finish.

    Raises:
        RuntimeError: the run failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy_pipeline(Path(folder))
        found = [str((ROOT / path).resolve()) for path in read_config(ROOT / "config/config.yaml").measured]
        overlay = Path(folder) / "benchmark.yaml"
        overlay.write_text(yaml.safe_dump({"measured": found}))
        files = [overlay] if scale == "default" else [Path(folder) / f"config/{scale}.yaml", overlay]
        arguments = [target, "--cores", str(CORES), "--configfile", *map(str, files)]
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        done = subprocess.run([sys.executable, "-c", MEASURED, *arguments], cwd=folder, capture_output=True, text=True)
        after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
        if done.returncode:
            raise RuntimeError(f"snakemake {target} at scale {scale} failed:\n{done.stderr[-3000:]}")
        own, in_jobs = json.loads(Path(folder, "cpu.json").read_text())
        jobs = read_jobs(Path(folder))
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    least, name = least_time(jobs, CORES), f"{target}, {scale}"
    note = "Snakemake's own over that of its jobs; asked for: below 0.05"
    results.add(f"{name}: CPU time of all", cpu, "s", f"{len(jobs)} jobs")
    results.add(f"{name}: CPU overhead", own / in_jobs, "1", note)
    results.add(f"{name}: time to finish", wall, "s", f"{CORES} cores")
    results.add(f"{name}: critical path", critical_path(jobs), "s")
    results.add(f"{name}: time to finish over the least", wall / least, "1", f"least on {CORES} cores {least:.1f} s")
    print(f"{name}: {len(jobs)} jobs, {cpu:.1f} CPU s; Snakemake {own:.1f}, {own / in_jobs:.1%} of the jobs'")
    print(f"  {wall:.1f} s to finish, {wall / least:.2f} of the least {least:.1f} s")


def stored(results: Results) -> None:
    """Print and add sum and critical path of the jobs on record here."""
    jobs = read_jobs(ROOT)
    if not jobs:
        return
    total, path = sum(job.seconds for job in jobs), critical_path(jobs)
    note = f"{len(jobs)} jobs as last run here"
    results.add("jobs on record: sum", total, "s", note)
    results.add("jobs on record: critical path", path, "s", note)
    print(f"{note}: sum {total:.0f} s, critical path {path:.0f} s")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser(
        "pipeline", "CPU time of a target in a fresh copy, on two cores, against that of its jobs."
    )
    parser.add_argument("target", nargs="?", help="rule (chapter3 at scale default, then all at scale quick)")
    parser.add_argument("--scale", default="default", choices=["quick", "default"], help="of the target")
    options = parser.parse_args(arguments)
    runs = ((options.target, options.scale),) if options.target else RUNS
    results = Results("pipeline")
    for target, scale in ((SMALL, "quick"),) if options.quick else runs:
        measure(target, scale, results)
    stored(results)
    results.write(options.out)


if __name__ == "__main__":
    main()
