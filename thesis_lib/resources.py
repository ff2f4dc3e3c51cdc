"""Memory and CPU time of each rule: measured, and requested from a cluster.

    python -m thesis_lib.resources                       # a table of the last run
    python -m thesis_lib.resources record --scale quick  # keep its largest jobs in config/resources.yaml

Snakemake records the use of each job in results/logs/benchmarks/, sampled every half second at first and every 30 s
later, so that the last seconds of a job are not counted; `--cpu-min` gives the CPU time of the whole run.
config/resources.yaml holds the largest job of each rule and scale; a job requests the largest of all scales times a
margin, and more after each failure.  How long a run takes is told from the mean job, or all jobs together, and from the
pace of this machine against that of the one where the scale was measured (`machine` there).
"""

import csv
import math
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import yaml
from pydantic import TypeAdapter

from thesis_lib.foundation.command_line import Parser, command
from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.foundation.files import write_text

MEASURED = Path("config/resources.yaml")
BENCHMARKS = Path("logs/benchmarks")  # below the results
KEYS = ("peak_mb", "cpu_s")  # of the largest job of a rule at a scale
MEAN = "mean_cpu_s"  # of the jobs of a rule at a scale, where these are several
MACHINE = "machine"  # what was measured of each scale as a whole: `PACE` of the machine and CPU time of all jobs
PACE, TOTAL = "pace_s", "total_cpu_s"
Measured = Mapping[str, Mapping[str, Mapping[str, float]]]  # rule, or `MACHINE` -> scale -> number by name
FORM: TypeAdapter = TypeAdapter(
    dict[str, dict[str, dict[Literal["peak_mb", "cpu_s", "mean_cpu_s", "pace_s", "total_cpu_s"], float]]]
)

MEMORY_MARGIN = 1.5  # peaks are sampled, and other data and library builds need other amounts
NESTED_MB = 400  # on a cluster each job is two more Snakemake processes of about 190 MB
SMALLEST_MB = 200  # of jobs that end before the first sample: Python, numpy and pandas
MEMORY_STEP_MB = 100
TIME_MARGIN = 4.0  # cores may be slower than the measured ones, and shared
REPEATED = 30  # times a fixed piece of work; the quickest counts: others were disturbed
START_MINUTES = 10  # reading libraries from a busy file system, and the nested Snakemakes

HEADER = """\
# The largest job of each rule: peak memory (MB) and CPU time (s), by scale; of several jobs also the mean CPU time.
# machine: CPU time of a fixed piece of work (pace_s there) where a scale was measured, and of all of its jobs.
# thesis_lib/resources.py turns the worst of the scales into what a job asks of a cluster.
# Written by `python -m thesis_lib.resources record --scale SCALE`.
"""


class Use(NamedTuple):
    """Use of the jobs of a rule: their number, CPU seconds of all and of the largest, largest peak memory in MB."""

    jobs: int
    cpu_s: float
    largest_cpu_s: float
    peak_mb: float


class Request(NamedTuple):
    """Request of a job: memory in MB, wall time in minutes."""

    mem_mb: int
    runtime: int


def request(measured: Measured, rule: str, attempt: int = 1) -> Request:
    """Request of a job of `rule`, proportional to the number of the attempt.

    For a rule without measurements the most demanding rule counts.
    """
    peak, cpu_s = (_largest(measured, rule, key) for key in KEYS)
    peak = max(peak, SMALLEST_MB)
    steps = math.ceil((MEMORY_MARGIN * peak + NESTED_MB) / MEMORY_STEP_MB)
    return Request(attempt * steps * MEMORY_STEP_MB, attempt * math.ceil(START_MINUTES + TIME_MARGIN * cpu_s / 60.0))


def slower(measured: Measured) -> dict[str, float]:
    """How many times as long work takes here as where each scale was measured."""
    here = pace_s()
    return {scale: here / of[PACE] for scale, of in measured.get(MACHINE, {}).items()}


def _largest(measured: Measured, rule: str, key: str) -> float:
    """The largest number of a rule over the scales; of all rules if it has none."""
    of_rule = [use[key] for use in measured.get(rule, {}).values() if key in use]
    of_all = (use[key] for scales in measured.values() for use in scales.values() if key in use)
    return max(of_rule or of_all, default=0.0)


def read_measured(path: str | Path = MEASURED) -> dict[str, dict[str, dict[str, float]]]:
    """Rule -> scale -> {peak_mb, cpu_s, mean_cpu_s}, each may be missing; `MACHINE` -> scale -> {pace_s, total_cpu_s}.

    UserError if the file is missing or of another form.
    """
    path = Path(path)
    if not path.is_file():
        raise UserError(f"{path} does not exist; get it back with git checkout {path}.")
    try:
        return FORM.validate_python(yaml.safe_load(path.read_text(encoding="utf-8")) or {})
    except (yaml.YAMLError, ValueError) as error:
        raise UserError(
            f"{path} must hold `rule: {{scale: {{peak_mb: …, cpu_s: …, mean_cpu_s: …}}}}` ({error}); "
            "mend it or run python -m thesis_lib.resources record."
        ) from error


def read_uses(results: str | Path) -> dict[str, Use]:
    """Use of the jobs of each rule, from the benchmarks of a run.

    UserError if there are none, CorruptFileError if one of them cannot be read.
    """
    folder = Path(results) / BENCHMARKS
    files = sorted(folder.rglob("*.tsv"))
    if not files:
        raise UserError(f"{folder} holds no benchmarks; run the pipeline first (make reproduce).")
    jobs: dict[str, list[tuple[float, float]]] = {}
    for path in files:
        rule = path.relative_to(folder).parts[0].removesuffix(".tsv")
        jobs.setdefault(rule, []).append(_read_benchmark(path))
    columns = {rule: tuple(zip(*used)) for rule, used in sorted(jobs.items())}
    return {rule: Use(len(cpu_s), sum(cpu_s), max(cpu_s), max(mb)) for rule, (cpu_s, mb) in columns.items()}


def _read_benchmark(path: Path) -> tuple[float, float]:
    """CPU seconds and peak MB of a job; wall seconds and 0 if it ended before the first sample."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            (row,) = csv.DictReader(stream, delimiter="\t")
        if row["max_rss"] == "NA":
            return float(row["s"]), 0.0
        return float(row["cpu_time"]), float(row["max_rss"])
    except (OSError, UnicodeDecodeError, KeyError, TypeError, ValueError) as error:
        raise CorruptFileError(f"{path} is no benchmark of one job ({error}); delete it.") from error


def table(uses: Mapping[str, Use], measured: Measured) -> str:
    """For a terminal: rule, jobs, CPU seconds, peak memory and request; largest peaks first."""
    lines = [f"{'rule':22s}{'jobs':>6s}{'CPU s':>10s}{'largest':>10s}{'peak MB':>10s}{'asks MB':>10s}{'asks min':>10s}"]
    for rule, use in sorted(uses.items(), key=lambda item: (-item[1].peak_mb, item[0])):
        asked = request(measured, rule)
        peak = f"{use.peak_mb:.0f}" if use.peak_mb else "-"  # too short to be sampled
        lines.append(
            f"{rule:22s}{use.jobs:6d}{use.cpu_s:10.1f}{use.largest_cpu_s:10.1f}{peak:>10s}"
            f"{asked.mem_mb:10d}{asked.runtime:10d}"
        )
    jobs, cpu_s = sum(use.jobs for use in uses.values()), sum(use.cpu_s for use in uses.values())
    peak = max((use.peak_mb for use in uses.values()), default=0.0)
    lines.append(f"{'total':22s}{jobs:6d}{cpu_s:10.1f}{'':10s}{peak:10.0f}")
    return "\n".join(lines)


def recorded(measured: Measured, uses: Mapping[str, Use], scale: str) -> dict[str, dict]:
    """`measured` with the numbers of a scale replaced, for the rules that ran."""
    updated = {rule: dict(scales) for rule, scales in measured.items()}
    for rule, use in uses.items():
        largest = dict(zip(KEYS, (math.ceil(use.peak_mb), math.ceil(use.largest_cpu_s))))
        mean = {MEAN: math.ceil(use.cpu_s / use.jobs)} if use.jobs > 1 else {}
        updated.setdefault(rule, {})[scale] = largest | mean
    return updated


def write_measured(measured: Measured, path: str | Path = MEASURED) -> None:
    """Write the measured numbers, the machine in the first line and then a line per rule."""
    lines = []
    for rule in sorted(measured, key=lambda rule: (rule != MACHINE, rule)):
        scales = [
            f"{scale}: {{{', '.join(f'{key}: {value:.12g}' for key, value in use.items())}}}"
            for scale, use in sorted(measured[rule].items())
        ]
        lines.append(f"{rule}: {{{', '.join(scales)}}}\n")
    write_text(HEADER + "".join(lines), path)


def pace_s() -> float:
    """CPU time in s of a fixed piece of work of the kinds that most jobs consist of: steps of Python, whole arrays.

    It takes a second or two, and tells machines apart that differ by a factor of two, not by a tenth.
    """
    return min(_work() for _ in range(REPEATED))


def _work() -> float:
    import numpy as np

    begin = time.process_time()
    total = 0
    for i in range(70_000):
        total += i * i % 7
    short, long = np.linspace(0.1, 1.0, 30), np.linspace(-1.0, 0.0, 100_000)
    for _ in range(3_000):
        short = np.sqrt(short * short + 1e-3)
    for _ in range(15):
        np.exp(long).sum()
    return time.process_time() - begin


@command
def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    description = "Memory and CPU time of each rule in the last run."
    parser = Parser(prog="python -m thesis_lib.resources", description=description)
    parser.add_argument("command", nargs="?", default="show", choices=["show", "record"])
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of the results")
    parser.add_argument("--scale", choices=["quick", "default", "full"], help="scale of the run (record)")
    parser.add_argument("--measured", type=Path, default=MEASURED, help=f"what is kept ({MEASURED})")
    whole = "CPU time of a run in one piece, as its last line says (record); without: the sum of its jobs, a tenth less"
    parser.add_argument("--cpu-min", type=float, metavar="MINUTES", help=whole)
    options = parser.parse_args(argv)
    if options.command == "record" and options.scale is None:
        parser.error("record needs --scale")
    if options.cpu_min is not None and not 0.0 < options.cpu_min < math.inf:
        parser.error(f"--cpu-min must be a number of minutes above 0, not {options.cpu_min:g}")
    uses = read_uses(options.results)
    measured = read_measured(options.measured) if options.measured.exists() else {}
    if options.command == "record":
        total_s = 60.0 * options.cpu_min if options.cpu_min else sum(use.cpu_s for use in uses.values())
        measured = recorded(measured, uses, options.scale)
        measured.setdefault(MACHINE, {})[options.scale] = {PACE: round(pace_s(), 4), TOTAL: round(total_s)}
        write_measured(measured, options.measured)
    print(table(uses, measured))
    return 0


if __name__ == "__main__":
    sys.exit(main())
