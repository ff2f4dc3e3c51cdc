"""results/report.html: one page with every figure of a run, what it shows, and what was found.

One file: pictures are embedded, so that it can be sent, archived and printed, and needs no network.  Captions and
findings are those of `python -m thesis_lib figures`; measured and simulated data never share a group.
"""

import base64
import struct
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from thesis_lib.foundation.errors import CorruptFileError
from thesis_lib.foundation.regular_file import read_bytes
from thesis_lib.pages import page
from thesis_lib.records.catalogue import figures, records
from thesis_lib.records.record import FOUND_HERE, Figure

TITLE = "Contact models in robotic manipulation: what the thesis computed, computed again"
CHAPTERS = {
    2: "inertia and contact forces from motion",
    3: "six impact laws against measured impacts",
    4: "learned contact models and their beliefs",
    5: "a robot plays Jenga",
}
DATASETS = {  # those that come with the project; another one is headed by its name
    "": "",
    "planar_impact": "planar_impact: measured impacts of an ellipse, as published",
    "planar_dice": "planar_dice: measured throws of a die, as published",
    "drops": "drops: simulated, whose law and parameters are known",
    "common": "",
}
READING = (
    "Results are ordered by chapter, and within a chapter by dataset. Datasets that are not present are left out. "
    "“As published” is the authors' code, which differs from the law that it is named after in four of six models; "
    "“as defined” is the law itself. Beside each picture lie its PDF and a CSV of the numbers drawn."
)
PNG_SIZE = struct.Struct(">16x2I")  # signature, length and name of the first chunk; then width and height
LARGEST = 20_000_000  # bytes of a picture
DENSITY = 180 / 96  # pixels of our pictures (savefig.dpi) to those of a page


def run_report(results: Path, findings: Iterable[Path], scale: str) -> str:
    """The page as HTML.

    Args:
        results: folder of a complete run; figures without a picture in it are left out.
        findings: files with what was found; of those beside a table, the table is listed, too.
    """
    made = [
        (figure, name)
        for figure in figures()
        for name, file in figure.files.items()
        if (results / file).is_file()
    ]
    tables = [
        path
        for path in findings
        if not path.with_suffix(".png").exists() and path.with_suffix(".csv").exists()
    ]
    chapters = sorted({figure.chapter for figure, _ in made})
    sections = [
        _section(f"chapter-{n}", _chapter_title(n), _chapter(results, n, made, tables)) for n in chapters
    ]
    critiques = sorted(path.parent for path in findings if path.stem == "verdict")
    sections.append(
        _section("critique", "The critique: which effect is missing", _critiques(results, critiques))
    )
    content = [
        _link(
            "Every number and sentence of the thesis beside ours",
            "claims.html",
            _finding(results / "claims.txt"),
        ),
        f"<p>{escape(READING)} This run was at scale <em>{escape(scale)}</em>; <code>provenance.json</code> says which "
        "code, versions and data made it.</p>",
        _contents(chapters, made),
        *sections,
    ]
    return page(TITLE, "\n".join(content))


def _contents(chapters: Sequence[int], made: Sequence[tuple[Figure, str]]) -> str:
    entries = []
    for n in chapters:
        entries.append(f'<li><a href="#chapter-{n}"><strong>{escape(_chapter_title(n))}</strong></a></li>')
        for name in dict.fromkeys(figure.name for figure, _ in made if figure.chapter == n):
            figure = records()[name]
            title = escape(figure.title)
            datasets = ", ".join(
                f'<a href="#{_anchor(figure, dataset)}">{escape(dataset)}</a>'
                for each, dataset in made
                if each is figure and dataset
            )
            links = f"{title}: {datasets}" if datasets else f'<a href="#{_anchor(figure, "")}">{title}</a>'
            entries.append(f"<li>{figure.label}: {links}</li>")
    entries.append('<li><a href="#critique"><strong>The critique</strong></a></li>')
    return f'<nav aria-label="Figures">\n<ul>{"".join(entries)}</ul>\n</nav>'


def _chapter_title(chapter: int) -> str:
    return f"Chapter {chapter}: {CHAPTERS[chapter]}"


def _chapter(
    results: Path, chapter: int, made: Sequence[tuple[Figure, str]], tables: Sequence[Path]
) -> list[str]:
    own = [(figure, name) for figure, name in made if figure.chapter == chapter]
    beside = [path for path in tables if path.relative_to(results).parts[0] == f"chapter{chapter}"]
    names = [path.relative_to(results).parts[1:-1] for path in beside]
    of_table = {path: name[0] if name else "" for path, name in zip(beside, names)}
    parts = []
    for dataset in dict.fromkeys([*(name for _, name in own), *of_table.values()]):
        if title := DATASETS.get(dataset, dataset):
            parts.append(f"<h3>{escape(title)}</h3>")
        parts += [_figure(results, figure, name) for figure, name in own if name == dataset]
        parts += [_table(results, path, dataset) for path in beside if of_table[path] == dataset]
    return parts


def _figure(results: Path, figure: Figure, dataset: str) -> str:
    file = results / figure.files[dataset]
    caption = figure.text(dataset, results)
    found = caption.partition(FOUND_HERE)[2]
    links = ", ".join(
        f'<a href="{escape(str(file.with_suffix(suffix).relative_to(results)))}">{word}</a>'
        for suffix, word in ((".pdf", "PDF"), (".csv", "numbers"))
    )
    return (
        f'<figure id="{_anchor(figure, dataset)}">{_image(file, f"{figure.title}. {found or caption}")}'
        f"<figcaption>{_paragraphs(figure.label, caption)}<p>{links}</p></figcaption></figure>"
    )


def _table(results: Path, path: Path, dataset: str) -> str:
    table = path.with_suffix(".csv").relative_to(results)
    record = records()[path.stem]
    link = f'<p><a href="{escape(str(table))}">{escape(str(table))}</a></p>'
    return f'<div class="table">{_paragraphs(record.label, record.text(dataset, results))}{link}</div>'


def _critiques(results: Path, folders: Iterable[Path]) -> list[str]:
    parts = []
    for folder in folders:
        verdict = _finding(folder / "verdict.txt")
        ladder = folder / "ladder.png"
        parts.append(f"<h3>{escape(folder.name)}</h3>")
        parts.append(_link("Report", str((folder / "report.html").relative_to(results)), verdict))
        if ladder.is_file():
            alt = f"{folder.name}: held-out error of the models, step by step. {verdict}"
            caption = "Held-out error of the laws and of the best one with the named effects, step by step."
            parts.append(f"<figure>{_image(ladder, alt)}<figcaption>{caption}</figcaption></figure>")
    parts.append("<h3>How often the critique is right</h3>")
    return [
        *parts,
        _link("Table", "critique/proof/summary.csv", _finding(results / "critique/proof/proof.txt")),
    ]


def _section(name: str, title: str, content: Iterable[str]) -> str:
    inner = "\n".join(content)
    return f'<section aria-labelledby="{name}">\n<h2 id="{name}">{escape(title)}</h2>\n{inner}\n</section>'


def _link(word: str, href: str, text: str) -> str:
    return f'<p>{escape(text)} <a href="{escape(href)}">{escape(word)}</a></p>'


def _paragraphs(name: str, text: str) -> str:
    """Paragraphs of a caption, its name before it where it does not begin with one; what was found is set apart."""
    named = text if text.startswith(("Figure", "Table")) else f"{name}. {text}"
    parts = [escape(part) for part in named.split("\n\n")]
    marked = f"<strong>{FOUND_HERE.strip()}</strong> "
    return "".join(f"<p>{part.replace(FOUND_HERE, marked)}</p>" for part in parts)


def _finding(path: Path) -> str:
    return read_bytes(path, LARGEST).decode("utf-8", "replace").strip()


def _image(file: Path, alt: str) -> str:
    """An embedded PNG; its size stands in its head, so that a page does not jump while it loads.

    Raises:
        CorruptFileError: it is no PNG.
    """
    content = read_bytes(file, LARGEST)
    if not content.startswith(b"\x89PNG") or len(content) < PNG_SIZE.size:
        raise CorruptFileError(f"{file} is no picture; delete it and run again.")
    width, height = (round(size / DENSITY) for size in PNG_SIZE.unpack_from(content))
    data = base64.b64encode(content).decode("ascii")
    text = escape(" ".join(alt.split()))
    return f'<img src="data:image/png;base64,{data}" alt="{text}" width="{width}" height="{height}">'


def _anchor(figure: Figure, dataset: str) -> str:
    return "-".join(filter(None, ("figure", figure.short.replace("_", "-"), dataset)))
