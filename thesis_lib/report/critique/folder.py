"""The folder that a critique writes: the same bytes from the command line and from the pipeline.

    impacts.csv  comparison.csv  errors.csv  ladder.csv  budget.csv   tables, explained in foundation/columns.yaml
    where.json  diagnosis.json  model.json                            schema 1 each; model.json predicts
    <picture>.png .pdf .csv                                           with the numbers drawn
    report.html                                                       one page, readable offline

All is written into a folder beside it first, `.<name>.part`, so that a run that dies leaves an earlier one as it was.
Then the old diagnosis.json, model.json and report.html are taken away, with what this run does not make, the new files
are moved in, and diagnosis.json last: a folder that has one is whole.
"""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from thesis_lib.critique.drops.criticise import Critique, criticise
from thesis_lib.critique.drops.questions.where import where
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.critique.results.saved_model import save_model, saved
from thesis_lib.critique.results.tables import tables
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.foundation.files import write_json, write_result, write_text
from thesis_lib.foundation.randomness import generator

VERDICT_FILE = "diagnosis.json"
LAST = ("model.json", "report.html", VERDICT_FILE)  # moved in last, in this order
# all that any critique writes: what an earlier one made and this one does not is taken away
TABLES = ("comparison", "errors", "ladder", "impacts", "budget", "flights")


def is_unfinished(folder: str | Path) -> bool:
    """Whether a folder holds files of a critique but not the one that is written last."""
    folder = Path(folder)
    return not (folder / VERDICT_FILE).exists() and all(
        (folder / name).is_file() for name in ("where.json", "comparison.csv", "ladder.csv")
    )


def critique_folder(
    dataset: Dataset,
    folder: str | Path,
    seed: int,
    *,
    effects: Sequence[str] | None = None,
    settings: CritiqueSettings | None = None,
    arcs: ArcSettings | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> dict:
    """Criticise a dataset, write everything into `folder`, and return the content of diagnosis.json.

    Args:
        dataset: measured drops.
        folder: made if needed; files of an earlier critique are replaced.
        seed: of the configuration; the stream derives from it and from the dataset's content.
        effects: switched on instead of the automatic choice; None lets the data choose, () allows none.
        settings, arcs: thresholds, and detection of impacts.
        say: told what is being done.

    Raises:
        UserError: the dataset is too small, or an effect is unknown or cannot be tested with it.
    """
    rng = generator(seed, "critique", dataset.digest())
    found = criticise(dataset, rng=rng, settings=settings, arcs=arcs, effects=effects, say=say)
    say("writing tables, pictures and report")
    return write_critique(found, folder, rng)


def write_critique(critique: Critique, folder: str | Path, rng: np.random.Generator) -> dict:
    """Write all files of a critique into `folder` and return the content of diagnosis.json."""
    # pictures and page are drawn from what is found here: nothing of the critique needs them
    from thesis_lib.figures.critique.pictures import NAMES, pictures
    from thesis_lib.figures.style import save_figure
    from thesis_lib.report.critique.page import report_html

    folder = Path(folder)
    regions = where(critique, rng)
    made = tables(critique, rng)
    content = diagnosis(critique, rng, made["ladder"])
    drawn = pictures(critique, made, regions)
    page = report_html(critique, content, regions, made, drawn)

    part = folder.resolve().with_name(f".{folder.resolve().name}.part")
    shutil.rmtree(part, ignore_errors=True)  # of a run that was killed
    try:
        part.mkdir(parents=True)
        for name, (figure, numbers) in drawn.items():
            # a picture of a table has that table beside it
            save_figure(figure, made.get(name, numbers), part / name)
        for name, table in made.items():
            write_result(table, part / f"{name}.csv")
        write_json(regions, part / "where.json")
        final = critique.ladder[-1][1]
        save_model(saved(final, critique.observations.rig, critique.dataset), part / "model.json")
        write_text(page, part / "report.html")
        write_json(content, part / VERDICT_FILE)
        _replace(folder, part, {*NAMES, *TABLES})
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return content


def _replace(folder: Path, part: Path, stems: set[str]) -> None:
    """Move the files of `part` into `folder`, and take away those of an earlier critique that it does not make."""
    new = {path.name for path in part.iterdir()}
    folder.mkdir(parents=True, exist_ok=True)
    for name in reversed(LAST):
        (folder / name).unlink(missing_ok=True)
    for path in folder.iterdir():
        if path.name not in new and path.stem in stems and path.suffix in (".csv", ".png", ".pdf"):
            path.unlink()
    for name in (*sorted(new - set(LAST)), *LAST):
        (part / name).replace(folder / name)
