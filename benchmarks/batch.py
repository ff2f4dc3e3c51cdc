"""Critique of many datasets as a batch: throughput, memory, and bad datasets inserted on purpose.

    python -m benchmarks.batch [--datasets 100] [--drops 300] [--jobs N] [--keep DIR] [--quick] [-o FILE.csv]

Datasets are drops with compliant contact in which one cause in turn is hidden, or nothing, each with its own seed.
Five bad ones stand among them: a table that cannot be read, a body that never falls, a process that the kernel kills,
one that takes memory without end, and one that never ends.  The last three need work that misbehaves (`work`), as no
data are known that do this to the critique.

CPU seconds are those of all processes but the server's imports (2 s once).  Memory is resident memory; that of a
dataset's process counts pages that it shares with the server.  With --keep an interrupted benchmark goes on, and counts
what it did itself.
"""

import os
import resource
import shutil
import signal
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.results import Results, benchmark_parser
from thesis_lib.commands.batch import criticise_folder, run_batch
from thesis_lib.foundation.isolated import MIB

FIRST_SEED = 500  # a development seed of the proof
BAD = ("unreadable", "never_falls", "killed", "greedy", "endless")
MEMORY = 2e9  # bytes a dataset
COMPARED = 10  # datasets at either end of the batch


def work(path: str, folder: str, seed: int, effects: Sequence[str] | None) -> dict:
    """Criticise a dataset, or misbehave if its name says so."""
    match Path(path).name:
        case "bad_killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "bad_greedy":
            taken = []
            while True:
                taken.append(b"\x01" * 10_000_000)
        case "bad_endless":
            time.sleep(1e6)
    return criticise_folder(path, folder, seed, effects)


def write_datasets(folder: Path, count: int, drops: int) -> tuple[list[Path], dict]:
    """Datasets, the bad ones spread among them, and the case of each good one by its name; present ones are kept."""
    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.studies.proof.cases import Case, make, truths

    names = truths("mechanism")
    paths, cases = [], {}
    for i in range(count):
        case = Case("mechanism", names[i % len(names)], FIRST_SEED + i, drops)
        path = folder / f"{i:03d}_{case.truth}"
        cases[path.name] = case
        paths.append(path)
        if not (path / "dataset.yaml").is_file():
            dataset, _ = make(case)
            part = write_dataset(dataset, folder / f".{path.name}")
            part.replace(path)
    for i, kind in enumerate(BAD):
        path = folder / f"bad_{kind}"
        shutil.copytree(paths[0], path, dirs_exist_ok=True)
        if kind == "unreadable":
            (path / "trajectories.csv").write_text("trial,t,x,y,theta\n0,0.0,zero,")
        if kind == "never_falls":
            rows = "".join(f"{trial},{k / 250},0,0.03,0\n" for trial in range(20) for k in range(50))
            (path / "trajectories.csv").write_text("trial,t,x,y,theta\n" + rows)
        paths.insert(round((i + 0.5) * count / len(BAD)) + i, path)
    return paths, cases


def measure(folder: Path, count: int, drops: int, jobs: int, time_limit: float) -> Results:
    """Run the batch, and once more to see what is skipped; prints each dataset as it ends."""
    paths, cases = write_datasets(folder / "data", count, drops)
    parent: list[float] = []

    def say(text: str) -> None:
        print(text, flush=True)
        parent.append(_resident())

    limits = {"jobs": jobs, "time_limit": time_limit, "memory_limit": MEMORY, "work": work}
    start, cpu = time.monotonic(), time.process_time()
    batch = run_batch(paths, folder / "out", 0, say=say, **limits)
    wall, cpu = time.monotonic() - start, time.process_time() - cpu
    good = [one for one in batch.finished if one.name in cases and one.failure is None]
    failed = {row["dataset"] for row in batch.failed}
    again = time.process_time()
    skipped = len(
        run_batch(sorted(set(paths) - {folder / "data" / name for name in failed}), folder / "out", 0).skipped
    )
    again = time.process_time() - again

    results = Results("batch")
    add = results.add
    add("datasets with a verdict", count - len(failed & set(cases)), note=f"of {count}, {drops} drops each")
    add("bad datasets listed with a reason", len(failed - set(cases)), note=f"of {len(BAD)} inserted")
    add("right answers", sum(_is_right(row, cases) for row in batch.rows), note=f"of {count}: cause named, or adequate")
    if good:
        seconds = sum(one.cpu_s for one in good)
        add("datasets per CPU minute", 60.0 * len(good) / (seconds + cpu), "1/min", f"{jobs} at a time")
        add("CPU time a dataset", seconds / len(good), "s")
        add("CPU time of the parent a dataset", cpu / len(good), "s", "reading, checksums and index")
        add("wall time", wall, "s", f"{len(good)} datasets, machine as busy as it was")
        n = min(COMPARED, len(good) // 2)
        for name, values in (("dataset's process", [one.peak_mib for one in good]), ("parent", parent)):
            add(f"peak memory, {name}", max(values), "MiB")
            if n:
                first, last = np.mean(values[:n]), np.mean(values[-n:])
                add(f"mean memory, {name}, first {n}", first, "MiB")
                add(f"mean memory, {name}, last {n}", last, "MiB", f"{100.0 * (last / first - 1.0):+.1f} %")
    add("skipped when run again", skipped, note=f"in {again:.1f} CPU s")
    return results


def _is_right(row: dict, cases: dict) -> bool:
    from thesis_lib.studies.proof.results import is_right
    from thesis_lib.studies.proof.store import groups_of

    case = cases.get(row["dataset"])
    if case is None or row["status"] == "failed":
        return False
    return is_right(case, row["verdict"], groups_of(row["effects"]))


def _resident() -> float:
    """Resident memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / MIB


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser("batch", "Throughput and memory of the critique of many datasets.")
    parser.add_argument("--datasets", type=int, default=100, help="good ones; default: %(default)s")
    parser.add_argument("--drops", type=int, default=300, help="of each; default: %(default)s")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="default: number of cores")
    parser.add_argument("--time-limit", type=float, default=900.0, help="s a dataset; default: %(default)g")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="folder for data and results, to look at and to go on")
    options = parser.parse_args(arguments)
    if options.quick:
        options.datasets, options.drops, options.time_limit = 2, 40, min(options.time_limit, 120.0)
    with tempfile.TemporaryDirectory() as folder:
        place = options.keep or Path(folder)
        results = measure(place, options.datasets, options.drops, options.jobs, options.time_limit)
    print()
    for row in results.rows:
        unit = "" if row["unit"] == "1" else row["unit"]
        print(f"{row['measure']:44s}{row['value']:>10g} {unit:6s} {row['note']}")
    results.write(options.out)


if __name__ == "__main__":
    main()
