"""The folder that a critique writes, with the same bytes from the command line, the library and the pipeline.

For drops:

    impacts.csv  comparison.csv  errors.csv  ladder.csv  budget.csv   tables, explained in foundation/columns.yaml
    where.json  diagnosis.json  model.json                            schema 1 each; model.json makes predictions
    <picture>.png .pdf .csv                                           each with the numbers drawn
    report.html                                                       one page, readable offline
    candidates.csv  choices.csv                                       effects tried, and errors with each choice of them
    models.csv                                                        laws and engines, if these are compared

With too few impacts for a verdict: impacts.csv, comparison.csv, diagnosis.json, model.json and report.html.
For a mechanism: misfit.csv, mechanism_residuals.png .pdf .csv, diagnosis.json and report.html.

The folder is always complete: a run that fails leaves an earlier critique unchanged.  All files are first written into
`.<name>.part` beside the folder.  Then the old diagnosis.json, report.html and model.json and files that this run does
not write are removed, and the new files are moved in, diagnosis.json last: a folder with diagnosis.json is complete.

The pages of all critiques have a verdict, sentences, and sections in the order of a reader's questions: how far is the
model from the measurements, where does it fail, which effect is missing, what does adding it change, what remains open,
and what could these data have shown?
"""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from thesis_lib.foundation.files import write_json, write_result, write_text
from thesis_lib.pages import page

if TYPE_CHECKING:
    from thesis_lib.critique.results.findings import Findings
    from thesis_lib.figures.style import Drawn

VERDICT_FILE, MODEL_FILE = "diagnosis.json", "model.json"
LAST = ("model.json", "report.html", VERDICT_FILE)  # moved in last, in this order; a mechanism has no model.json
# tables that critiques write beside their pictures: tables of an earlier critique that this one lacks are removed
TABLES = ("comparison", "errors", "ladder", "candidates", "choices", "impacts", "budget", "flights", "models")
TABLES += ("misfit", "mechanism_residuals")
REGIONS = "where.json"
# a folder that contains all files of one of these sets belongs to a critique
MARKS = ((REGIONS, "comparison.csv", "ladder.csv"), ("misfit.csv", "mechanism_residuals.csv"))


@dataclass(frozen=True)
class Contents:
    """Page and pictures of the findings: `page` is report.html, `images` the pictures as PNG, if already drawn."""

    page: str
    pictures: "Mapping[str, Drawn]" = field(default_factory=dict)
    images: Mapping[str, bytes] = field(default_factory=dict)


def write_critique(findings: "Findings", contents: Contents, folder: str | Path) -> None:
    """Write all files of a critique into `folder`, created if needed; files of an earlier critique are replaced.

    Files that critiques do not write are kept.
    """
    from thesis_lib.figures.style import save_figure

    folder = Path(folder)
    part = folder.resolve().with_name(f".{folder.resolve().name}.part")
    shutil.rmtree(part, ignore_errors=True)  # left by a run that was killed
    try:
        part.mkdir(parents=True)
        for name, (figure, numbers) in contents.pictures.items():
            # a picture of a table is stored with that table
            save_figure(figure, findings.tables.get(name, numbers), part / name, contents.images.get(name))
        for name, table in findings.tables.items():
            write_result(table, part / f"{name}.csv")
        if findings.regions is not None:
            write_json(findings.regions, part / REGIONS)
        if findings.model is not None:
            findings.model.save(part / MODEL_FILE)
        write_text(contents.page, part / "report.html")
        write_json(findings.diagnosis, part / VERDICT_FILE)
        _replace(folder, part)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def is_unfinished(folder: str | Path) -> bool:
    """Return whether a folder contains files of a critique but lacks the file that is written last."""
    folder = Path(folder)
    marked = any(all((folder / name).is_file() for name in mark) for mark in MARKS)
    return marked and not (folder / VERDICT_FILE).exists()


def _replace(folder: Path, part: Path) -> None:
    """Move the files of `part` into `folder`, and remove files of an earlier critique that are not in `part`."""
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


TEMPLATE = Path(__file__).with_name("skeleton.html")
WORDS = {
    "adequate": "✓ adequate: no {} is missing that these data could show",
    "effects": "+ effects found: named effects explain the misfit",
    "unexplained": "? unexplained: structure remains that no named effect explains",
}


def critique_page(
    d: Mapping,
    contents: Mapping[str, Sequence[str | Markup | None]],
    lacking: str,
    *,
    word: str = "",
    kind: str = "",
    about: str = "",
    key_numbers: Sequence[tuple[str, str, str]] = (),
    script: str = "",
) -> str:
    """Return the page of a critique.

    Args:
        d: content of diagnosis.json.
        contents: sections by title, in order: the target of links, then the parts; empty parts and sections without
            parts are omitted.
        lacking: word for a missing part of a model: effect or force.
        word: the verdict in one line, if different from `WORDS`; `about` is the text below it, and `kind` its CSS
            class if different from the verdict.
        key_numbers: name, value and note.
        script: JavaScript, run when the page has loaded.
    """
    sections = [(name, title, [part for part in parts if part]) for title, (name, *parts) in contents.items()]
    return page(
        TEMPLATE,
        f"Critique of {d['dataset']}",
        script=script,
        verdict=kind or d["verdict"],
        word=word or WORDS[d["verdict"]].format(lacking),
        sentences=d.get("summary", []),
        about=about,
        key_numbers=key_numbers,
        sections=[section for section in sections if section[2]],
    )
