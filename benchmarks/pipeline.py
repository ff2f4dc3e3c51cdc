"""CPU time of the pipeline: a fresh copy of the checkout runs a target with two cores.

    python -m benchmarks.pipeline [TARGET] [--scale quick default] [-o FILE.json]

Counts user and system time of Snakemake and of all its jobs.  Nothing is reused: the copy has no results.
"""

import argparse
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

from thesis_lib.config import read_config
from thesis_lib.files import write_json

ROOT = Path(__file__).resolve().parent.parent
COPIED = ("Snakefile", "environment.txt", "config", "profiles", "thesis_lib", "workflow")


def measure(target: str, scale: str) -> dict[str, float]:
    """CPU and wall seconds and the number of jobs of one fresh run.

    Raises:
        RuntimeError: the run failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        for name in COPIED:
            source = ROOT / name
            copy = shutil.copytree if source.is_dir() else shutil.copy2
            copy(source, Path(folder) / name)
        found = [str((ROOT / path).resolve()) for path in read_config(ROOT / "config/config.yaml").measured]
        overlay = Path(folder) / "benchmark.yaml"
        overlay.write_text(yaml.safe_dump({"measured": found}))
        files = [overlay] if scale == "default" else [Path(folder) / f"config/{scale}.yaml", overlay]
        command = [
            sys.executable,
            "-m",
            "snakemake",
            target,
            "--cores",
            "2",
            "--configfile",
            *map(str, files),
        ]
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
        if done.returncode:
            raise RuntimeError(f"snakemake {target} at scale {scale} failed:\n{done.stderr[-3000:]}")
        jobs = len(list((Path(folder) / ".snakemake/metadata").iterdir()))
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"cpu_s": round(cpu, 1), "wall_s": round(wall, 1), "outputs": jobs}


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.pipeline",
        description="CPU time of a target in a fresh copy, on two cores.",
    )
    parser.add_argument("target", nargs="?", default="chapter3", help="rule (chapter3)")
    parser.add_argument(
        "--scale", nargs="+", default=["quick", "default"], choices=["quick", "default", "full"]
    )
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="write the figures as JSON")
    options = parser.parse_args(arguments)
    results = {}
    print(f"{'target':14s}{'scale':>9s}{'CPU s':>9s}{'wall s':>9s}")
    for scale in options.scale:
        results[scale] = measure(options.target, scale)
        print(f"{options.target:14s}{scale:>9s}{results[scale]['cpu_s']:9.1f}{results[scale]['wall_s']:9.1f}")
    if options.output:
        write_json({"target": options.target, "scales": results}, options.output)


if __name__ == "__main__":
    main()
