"""CPU time of one critique on one core: 300 drops, from trajectories to report.

    python -m benchmarks.critique [--drops 300] [--hidden com_offset_x] [--quick] [-o FILE.csv]

Counts user and system time of `python -m thesis_lib critique` as a whole, start-up and pictures included.
"""

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.results import Results, benchmark_parser

ROOT = Path(__file__).resolve().parent.parent


def measure(hidden: str, drops: int) -> dict[str, float | str]:
    """CPU seconds of the critique of an example with a hidden cause, and what it says.

    Raises:
        RuntimeError: a command failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        data, out = f"{folder}/example", f"{folder}/critique"
        _run("datasets", "example", "-o", data, "--hidden", hidden, "--drops", str(drops))
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        _run("critique", data, "-o", out, "-q")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        diagnosis = json.loads(Path(out, "diagnosis.json").read_text(encoding="utf-8"))
    return {
        "cpu_s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1),
        "n_impacts": diagnosis["n_impacts"],
        "verdict": diagnosis["verdict"],
        "effects": ", ".join(effect["name"] for effect in diagnosis["effects"]),
    }


def _run(*arguments: str) -> None:
    command = [sys.executable, "-m", "thesis_lib", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr[-3000:]}")


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser("critique", "CPU time of one critique on one core.")
    parser.add_argument("--drops", type=int, default=300)
    parser.add_argument("--hidden", nargs="+", default=["com_offset_x"], metavar="CAUSE")
    options = parser.parse_args(arguments)
    if options.quick:
        options.hidden, options.drops = ["nothing"], 30
    results = Results("critique")
    print(f"{'hidden':24s}{'drops':>6s}{'impacts':>9s}{'CPU s':>8s}  verdict")
    for hidden in options.hidden:
        found = measure(hidden, options.drops)
        said = f"{found['verdict']} {found['effects']}"
        print(f"{hidden:24s}{options.drops:6d}{found['n_impacts']:9d}{found['cpu_s']:8.1f}  {said}")
        note = f"{options.drops} drops, from files to report; says: {said.strip()}"
        results.add(f"{hidden}: CPU time", found["cpu_s"], "s", note)
    results.write(options.out)


if __name__ == "__main__":
    main()
