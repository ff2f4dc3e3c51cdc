"""The folder of a critique is complete: a run that dies leaves an earlier critique untouched.

Everything is first written into `.<name>.part` beside the folder.  Then the old diagnosis.json, report.html and
model.json and files that this run does not make are removed, and the new files are moved in, diagnosis.json last: a
folder with diagnosis.json is complete.
"""

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

VERDICT_FILE, MODEL_FILE = "diagnosis.json", "model.json"
LAST = ("model.json", "report.html", VERDICT_FILE)  # moved in last, in this order; a mechanism has no model.json
# written by any critique beside its pictures: those of an earlier critique that this one does not make are removed
TABLES = ("comparison", "errors", "ladder", "candidates", "choices", "impacts", "budget", "flights", "models")
TABLES += ("misfit", "mechanism_residuals")
REGIONS = "where.json"
# a folder with all files of one of these belongs to a critique
MARKS = ((REGIONS, "comparison.csv", "ladder.csv"), ("misfit.csv", "mechanism_residuals.csv"))


def is_unfinished(folder: str | Path) -> bool:
    """Whether a folder holds files of a critique but not the one that is written last."""
    folder = Path(folder)
    marked = any(all((folder / name).is_file() for name in mark) for mark in MARKS)
    return marked and not (folder / VERDICT_FILE).exists()


@contextlib.contextmanager
def whole_folder(folder: str | Path) -> Iterator[Path]:
    """Yield an empty folder to write into; its files replace those of an earlier critique if the block succeeds.

    `folder` is made if needed; files that no critique writes stay.
    """
    folder = Path(folder)
    part = folder.resolve().with_name(f".{folder.resolve().name}.part")
    shutil.rmtree(part, ignore_errors=True)  # left by a run that was killed
    try:
        part.mkdir(parents=True)
        yield part
        _replace(folder, part)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _replace(folder: Path, part: Path) -> None:
    """Move the files of `part` into `folder`, and remove those of an earlier critique that it does not make."""
    from thesis_lib.figures.critique.pictures import NAMES

    new = {path.name for path in part.iterdir()}
    folder.mkdir(parents=True, exist_ok=True)
    for name in reversed(LAST):
        (folder / name).unlink(missing_ok=True)
    for path in folder.iterdir():
        of_critique = path.stem in {*NAMES, *TABLES} and path.suffix in (".csv", ".png", ".pdf")
        if path.name not in new and (of_critique or path.name == REGIONS):
            path.unlink()
    for name in (*sorted(new - set(LAST)), *(name for name in LAST if name in new)):
        (part / name).replace(folder / name)
