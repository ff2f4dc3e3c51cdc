"""Pages of a run: results/report.html with the main findings, and a page for each chapter with all its figures.

Pictures are embedded, so a page can be sent, archived and printed, and needs no network.  Captions and findings
are the same as in `thesis-lib figures`; measured and simulated data are never in the same group.
"""

import base64
import struct
from collections.abc import Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from markupsafe import Markup

from thesis_lib.foundation.errors import CorruptFileError
from thesis_lib.foundation.regular_file import read_bytes
from thesis_lib.pages import element, page
from thesis_lib.thesis.records.catalogue import figures, openings, records
from thesis_lib.thesis.records.record import FOUND_HERE, Figure, Record

TEMPLATE, CHAPTER = (Path(__file__).with_name(name) for name in ("run.html", "chapter.html"))
TITLE = "Contact models in robotic manipulation: what the thesis computed, computed again"
CHAPTERS = {
    2: "inertia and contact forces from motion",
    3: "six impact laws against measured impacts",
    4: "learned contact models and their beliefs",
    5: "a robot plays Jenga",
}
DATASETS = {  # titles of the project's datasets; for any other, the title is its name
    "": "",
    "planar_impact": "planar_impact: measured impacts of an ellipse, as published",
    "planar_dice": "planar_dice: measured throws of a die, as published",
    "contactnets_cube": "contactnets_cube: measured tosses of a cube in space, as published",
    "drops": "drops: simulated, whose law and parameters are known",
    "common": "",
}
PNG_SIZE = struct.Struct(">16x2I")  # signature, length and name of the first chunk; then width and height
LARGEST = 20_000_000  # bytes of a picture
DENSITY = 180 / 96  # ratio of pixels of our pictures (savefig.dpi) and of a page


def run_report(results: Path, findings: Sequence[Path], scale: str, absent: Sequence[str] = ()) -> str:
    """Render the opening page of a complete run, with the main findings of each chapter, as HTML.

    `results`: folder of the run.  `findings`: files with findings.  `absent`: datasets that this run did not have.
    """
    made = _made(results)
    numbers = sorted({figure.chapter for figure, _ in made} & set(CHAPTERS))
    return page(
        TEMPLATE,
        TITLE,
        absent=absent,
        scale=scale,
        chapters=[_opening(results, made, findings, n) for n in numbers],
        claims=_finding(results / "claims.txt"),
        critiques=[_critique(results, path) for path in sorted(findings) if path.stem == "verdict"],
        proof=_finding(results / "critique/proof/proof.txt"),
    )


def chapter_report(
    results: Path, findings: Sequence[Path], scale: str, absent: Sequence[str] = (), *, chapter: int
) -> str:
    """Render the page of a chapter with all its figures; it can be made before other chapters are complete.

    `findings` are from this chapter; other arguments as in `run_report`.  Figures without a picture in `results`
    are left out; tables with a finding but without a picture are listed as well.
    """
    made = [(figure, name) for figure, name in _made(results) if figure.chapter == chapter]
    tables = [path for path in findings if not path.with_suffix(".png").exists() and path.with_suffix(".csv").exists()]
    # a figure and the anchors of its pictures, by dataset
    contents = [
        (figure, {dataset: _anchor(figure, dataset) for _, dataset in of_figure})
        for figure, of_figure in groupby(made, key=itemgetter(0))
    ]
    shown = {"contents": contents, "groups": _groups(results, made, tables)}
    return page(CHAPTER, _title(chapter), absent=absent, scale=scale, found_here=FOUND_HERE, **shown)


def _made(results: Path) -> list[tuple[Figure, str]]:
    """List the figures that have a picture, with their dataset."""
    return [(figure, name) for figure in figures() for name, file in figure.files.items() if (results / file).is_file()]


def _opening(results: Path, made: Sequence[tuple[Figure, str]], findings: Sequence[Path], n: int) -> dict:
    """Summary of a chapter: its main findings, each from the first dataset that has it, and one picture."""
    opening, places = [records()[name] for name in openings()[n]], dict.fromkeys(findings)
    said = []
    for record in opening:
        files = {name: Path(results, file).with_suffix(".txt") for name, file in record.files.items()}
        dataset = next((name for name, path in files.items() if path in places), None)
        if dataset is not None:
            to = f"#{_anchor(record, dataset)}" if (record, dataset) in made else ""
            said.append((f"{record.label}, {dataset}" if dataset else record.label, to, _finding(files[dataset])))
    pictures = [(figure, name) for figure, name in made if figure is opening[0]]
    return {
        "number": n,
        "title": _title(n),
        "page": f"report_chapter{n}.html",
        "findings": said,
        "pictures": [{"of": figure, **_figure(results, figure, name)} for figure, name in pictures[:1]],
        "figures": sum(figure.chapter == n for figure, _ in made),
    }


def _title(n: int) -> str:
    return f"Chapter {n}: {CHAPTERS[n]}"


def _groups(
    results: Path, made: Sequence[tuple[Figure, str]], tables: Sequence[Path]
) -> list[tuple[str, list[dict], list[dict]]]:
    """Group a chapter by dataset: title, figures and tables of each."""
    of_table = {path: "".join(path.relative_to(results).parts[1:-1][:1]) for path in tables}
    return [
        (
            DATASETS.get(dataset, dataset),
            [_figure(results, figure, name) for figure, name in made if name == dataset],
            [
                {
                    "caption": _paragraphs(record.label, record.text(dataset, results)),
                    "file": str(path.with_suffix(".csv").relative_to(results)),
                }
                for path in tables
                if of_table[path] == dataset and (record := records()[path.stem])
            ],
        )
        for dataset in dict.fromkeys([*(name for _, name in made), *of_table.values()])
    ]


def _figure(results: Path, figure: Figure, dataset: str) -> dict:
    file, caption = results / figure.files[dataset], figure.text(dataset, results)
    stem = file.relative_to(results).with_suffix("")
    finding = caption.partition(FOUND_HERE)[2]
    return {
        "anchor": _anchor(figure, dataset),
        "image": _image(file, f"{figure.title}. {finding or caption}"),
        "caption": _paragraphs(figure.label, caption),
        "links": [(f"{stem}.pdf", "PDF"), (f"{stem}.csv", "numbers")],
    }


def _critique(results: Path, path: Path) -> dict:
    verdict, folder, ladder = _finding(path), path.parent, path.with_name("ladder.png")
    alt = f"{folder.name}: held-out error of the models, step by step. {verdict}"
    image = _image(ladder, alt) if ladder.is_file() else None
    report = str((folder / "report.html").relative_to(results))
    return {"name": folder.name, "verdict": verdict, "report": report, "ladder": image}


def _paragraphs(name: str, text: str) -> list[str]:
    """Paragraphs of a caption, preceded by its name unless it begins with one."""
    named = text if text.startswith(("Figure", "Table")) else f"{name}. {text}"
    return named.split("\n\n")


def _finding(path: Path) -> str:
    return read_bytes(path, LARGEST).decode("utf-8", "replace").strip()


def _image(file: Path, alt: str) -> Markup:
    """Embed a PNG with its size, so that the page does not shift while loading; CorruptFileError for other files."""
    content = read_bytes(file, LARGEST)
    if not content.startswith(b"\x89PNG") or len(content) < PNG_SIZE.size:
        raise CorruptFileError(f"{file} is not a picture; delete it and run again.")
    width, height = (round(size / DENSITY) for size in PNG_SIZE.unpack_from(content))
    return element("image", base64.b64encode(content).decode("ascii"), " ".join(alt.split()), width, height)


def _anchor(figure: Record, dataset: str) -> str:
    return "-".join(filter(None, ("figure", figure.short.replace("_", "-"), dataset)))
