"""The folder that a critique writes (design 3.2): the same bytes from the command line and from the pipeline.

    impacts.csv  comparison.csv  errors.csv  ladder.csv  budget.csv   tables, explained in thesis_lib/columns.py
    where.json  diagnosis.json  model.json                            schema 1 each; model.json predicts
    <picture>.png .pdf .csv                                           with the numbers drawn
    report.html                                                       one page, readable offline

diagnosis.json is written last and taken away first, so that a folder that has one is whole.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from thesis_lib.columns import explain, write_result
from thesis_lib.critique.criticise import Critique, criticise
from thesis_lib.critique.diagnosis import diagnosis
from thesis_lib.critique.saved_model import save_model, saved
from thesis_lib.critique.settings import CritiqueSettings
from thesis_lib.critique.tables import tables
from thesis_lib.critique.where import where
from thesis_lib.datasets.dataset import Dataset
from thesis_lib.datasets.samples import ArcSettings
from thesis_lib.files import write_json, write_text
from thesis_lib.randomness import generator

VERDICT_FILE = "diagnosis.json"


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
    from thesis_lib.critique.report import report_html
    from thesis_lib.figures.critique_pictures import pictures
    from thesis_lib.figures.style import save_figure

    folder = Path(folder)
    # all that can fail is computed before anything of an earlier critique is touched
    regions = where(critique, rng)
    made = tables(critique, rng)
    content = diagnosis(critique, rng)
    drawn = pictures(critique, made, regions)
    page = report_html(critique, content, regions, made, drawn)
    for name, (_, numbers) in drawn.items():
        explain(name, numbers.columns)

    folder.mkdir(parents=True, exist_ok=True)
    (folder / VERDICT_FILE).unlink(missing_ok=True)
    for name, (figure, numbers) in drawn.items():
        # a picture of a table has that table beside it
        save_figure(figure, made.get(name, numbers), folder / name)
    for name, table in made.items():
        write_result(table, folder / f"{name}.csv")
    write_json(regions, folder / "where.json")
    save_model(
        saved(critique.ladder[-1][1], critique.observations.rig, critique.dataset), folder / "model.json"
    )
    write_text(page, folder / "report.html")
    write_json(content, folder / VERDICT_FILE)
    return content
