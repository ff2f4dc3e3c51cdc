"""What a clone of the pipeline has after its first command, copied to another folder; what a run wrote there."""

import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("Snakefile", "environment.txt", "config", "profiles", "thesis_lib", "workflow")


def copy_pipeline(to: Path, *more: str) -> Path:
    """Copy the pipeline, without data and results, into the folder `to`, with `more` files and folders."""
    to.mkdir(parents=True, exist_ok=True)
    for name in (*PARTS, *more):
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, to / name, ignore=shutil.ignore_patterns("*.png"))
        else:
            shutil.copy2(ROOT / name, to / name)
    return to


def bytes_in(folder: Path) -> dict[str, bytes]:
    """Every file below a folder: name -> content."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
