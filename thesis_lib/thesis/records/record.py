"""A record: title, caption, finding and rules of the stored copy of one figure or table, separate from its drawing.

Rules use its file names; `results/report.html`, Snakemake's report and `thesis-lib figures` its caption;
`claims check` its tolerances; results/columns.csv its columns.  It is separate from the drawing function, because a job
runs again when its code changes: a new caption must not redraw a figure.

A caption describes the picture and its main features, in Jinja and reStructuredText with the variable `dataset`.  The
finding, one to three sentences, is also a Jinja template, filled from tables of the run, so it holds for every
scale, seed and dataset; a rule writes it beside the picture (figure_4_6.png, figure_4_6.txt).  Comparing words
("above", "within") follow from the numbers.  A template can use the tables in `reads` by name, the functions of `rows`,
of `statistics.wording`, and of the module of its chapter.
"""

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import is_file, read_bytes

if TYPE_CHECKING:
    import jinja2

FOUND_HERE = "Found in this run: "
LONGEST = 10_000  # bytes of a finding


@dataclass(frozen=True)
class Job:
    """The Snakemake rule that makes a figure or table.

    Attributes:
        rule: its name.
        folder: folder of the files below results; `{dataset}` is replaced by each dataset.
        datasets: datasets of the project that have these files; empty if the folder names no dataset.
        group: heading in Snakemake's report; by default the dataset.
    """

    rule: str
    folder: str
    datasets: tuple[str, ...] = ()
    group: str | None = None


@dataclass(frozen=True)
class Tolerance:
    """Allowed deviation of a number from its stored copy, abs(ours − stored) ≤ abs + rel · abs(stored), with reason."""

    reason: str
    abs: float = 0.0
    rel: float = 0.0


@functools.cache
def sentences() -> "jinja2.Environment":
    """Jinja environment of findings: functions of `rows` and `statistics.wording` (the latter also as filters)."""
    import jinja2  # late, as numpy in the following: the command line lists its options without them

    from thesis_lib.statistics import wording
    from thesis_lib.thesis.records import rows

    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, extensions=["jinja2.ext.do"]
    )
    environment.globals.update(public(wording) | public(rows))
    environment.filters.update({"as": wording.formatted} | public(wording))
    return environment


def public(module: ModuleType) -> dict[str, Any]:
    """Return the public names of a module, with their values."""
    return {name: value for name, value in vars(module).items() if not name.startswith("_")}


@dataclass(frozen=True, kw_only=True)
class Record:
    """A figure, table or page of a run, with its text.

    Attributes:
        name: the file's stem.
        job: the rule that makes it.
        title: one line, continued by the caption.
        caption: description of the picture and of its main features.
        finding: template of sentences; empty if there is none.
        known: functions and values for the template, by name.
        reads: files in the same folder; those that end in .json are read as dictionaries.
        suffix: suffix of the file.
    """

    name: str
    job: Job
    title: str
    caption: str = ""
    finding: str = ""
    known: Mapping[str, Any] = field(default_factory=dict)
    reads: tuple[str, ...] = ()
    suffix: str = ".csv"

    @property
    def chapter(self) -> int:
        """Chapter of the thesis; 0 if it belongs to none."""
        number = re.match(r"chapter(\d+)", self.job.folder)
        return int(number[1]) if number else 0

    @property
    def short(self) -> str:
        """Short name: the number in the thesis (3-8, 5-5a), or the name if there is none (paired)."""
        short = self.name.removeprefix("figure_")
        return short.replace("_", "-") if short[0].isdigit() else short

    @property
    def label(self) -> str:
        """Label, as in Figure 3-8, Table 3.1, Named physics."""
        if self.short[0].isdigit():
            return f"Figure {self.short}"
        return re.sub(r"(\d) (\d)", r"\1.\2", self.short.replace("_", " ").capitalize())

    @property
    def order(self) -> tuple:
        """Key that sorts by chapter and number; records without a number come last in their chapter."""
        number = re.match(r"\d+-(\d+)(\w?)$", self.short)
        return (self.chapter, not number, int(number[1]) if number else 0, number[2] if number else self.short)

    @property
    def file(self) -> str:
        """Path below results, with `{dataset}`."""
        return str(Path(self.job.folder, self.name + self.suffix))

    @property
    def files(self) -> dict[str, str]:
        """Path below results of each dataset; the only key is "" if there are no datasets."""
        return {name: self.file.replace("{dataset}", name) for name in self.job.datasets or ("",)}

    def said(self, *tables: Any) -> str:
        """Return the finding, filled in from tables (or dictionaries) in the order of `reads`."""
        named = dict(zip((Path(name).stem for name in self.reads), tables, strict=True))
        text = sentences().from_string(self.finding).render({**self.known, **named})
        return re.sub(r"[ \n]+", " ", text).strip()  # no-break spaces stay

    def found(self, folder: Path) -> str:
        """Return the finding, computed from the tables in `folder`.

        Raises:
            UserError: a table is missing, or lacks a column or row.
        """
        from jinja2 import UndefinedError

        from thesis_lib.foundation.files import read_json, read_table  # late: loads pandas

        tables = [(read_json if name.endswith(".json") else read_table)(folder / name) for name in self.reads]
        try:
            return self.said(*tables)
        except (KeyError, IndexError, UndefinedError) as error:
            names = ", ".join(str(folder / name) for name in self.reads)
            raise UserError(f"{names} lack {error}, from which the finding is read; run the pipeline again.") from error

    def markup(self) -> str:
        """Return heading, title and caption as reStructuredText, with the variable `dataset`."""
        numbered = self.label.startswith(("Figure ", "Table "))
        of = " of the thesis" if self.label.startswith("Figure ") else ""
        whose = " ({{ dataset }})" if "{dataset}" in self.job.folder else ""
        heading = f"**{self.label}**{of}{whose}. " if numbered else ""
        return f"{heading}{self.title}. {self.caption}".strip()

    def text(self, dataset: str, results: Path | None = None) -> str:
        """Return the same as plain text for one dataset, with the finding of the run if it is in `results`."""
        import jinja2

        text = jinja2.Template(self.markup(), undefined=jinja2.StrictUndefined).render(dataset=dataset)
        paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", text) if part.strip()]
        paragraphs = [re.sub(r"(\*\*?|``?)(\S(?:.*?\S)?)\1", r"\2", part) for part in paragraphs]
        finding = results and Path(results, self.file.replace("{dataset}", dataset)).with_suffix(".txt")
        if self.finding and finding and is_file(finding):
            sentences = read_bytes(finding, LONGEST).decode("utf-8", "replace")
            paragraphs.append(FOUND_HERE + " ".join(sentences.split()))
        return "\n\n".join(paragraphs)

    def report_caption(self) -> str:
        """Return the same as a template of Snakemake's report, including the finding."""
        folder = self.job.folder.replace("{dataset}", "{{ dataset }}")
        section = f"\n\n**{FOUND_HERE.strip()}**\n\n.. include:: results/{folder}/{self.name}.txt"
        head = "{% set dataset = snakemake.wildcards.dataset %}\n" if "{dataset}" in self.job.folder else ""
        return f"{head}{self.markup()}{section if self.finding else ''}\n"


@dataclass(frozen=True, kw_only=True)
class Figure(Record):
    """A picture with a PDF and a CSV of the numbers drawn; a small copy of the CSV is stored.

    Attributes:
        keys: columns compared exactly, as text; separated by spaces.
        tolerances: columns of numbers, separated by spaces, with their tolerances.
        most_rows: the copy keeps at most this many rows, evenly spaced.
        not_compared: reason why no copy is stored.
        columns: unit and meaning of the columns that only this figure has.
    """

    keys: str = ""
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    most_rows: int = 40
    not_compared: str = ""
    columns: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    suffix: str = ".png"

    @property
    def text_columns(self) -> list[str]:
        return self.keys.split()

    @property
    def number_columns(self) -> dict[str, Tolerance]:
        return {name: tolerance for names, tolerance in self.tolerances.items() for name in names.split()}
