"""A record: all that is said of one figure or table of a run, apart from how it is drawn.

Rules take the files from it, `results/report.html`, Snakemake's report and `python -m thesis_lib figures` its caption,
`claims check` its tolerances, results/columns.csv its columns.  It stands apart from the drawing function, because a
job runs again when its code changes: a caption must not draw a figure anew.

A caption says what is drawn and what to look for; it is written once, in Jinja and reStructuredText with the variable
`dataset`.  The finding, one to three sentences, is computed from tables of the run, so that it holds for every scale,
seed and dataset; a rule writes it beside the picture (figure_4_6.png, figure_4_6.txt).  Words that judge ("above",
"within") are chosen by the numbers, never typed.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import is_file, read_bytes

DROPPED = ("planar_impact", "planar_dice", "drops")  # datasets that come with the project
TRACKED = ("planar_dice", "drops")  # those of them with trajectories
THROWN = ("planar_dice",)
FOUND_HERE = "Found in this run: "
LONGEST = 10_000  # bytes of a finding


@dataclass(frozen=True)
class Job:
    """The rule that makes a figure or table.

    Attributes:
        rule: its name.
        folder: where the files lie below results; `{dataset}` stands for each dataset.
        datasets: those that come with the project and have these files; none where the folder names no dataset.
        group: heading in Snakemake's report; by default the dataset.
    """

    rule: str
    folder: str
    datasets: tuple[str, ...] = ()
    group: str | None = None


@dataclass(frozen=True)
class Tolerance:
    """How far a number may move from its stored copy: abs(ours − stored) ≤ abs + rel · abs(stored); and why."""

    reason: str
    abs: float = 0.0
    rel: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Record:
    """A file of a run that is shown, with what is said of it.

    Attributes:
        name: the file's stem.
        job: what makes it.
        title: what it shows, in one line; the caption continues it.
        caption: what is drawn and what to look for.
        finding: tables named in `reads`, in their order -> sentences.
        reads: files in the folder of this one; one that ends in .json is a dictionary.
    """

    name: str
    job: Job
    title: str
    caption: str = ""
    finding: Callable[..., str] | None = None
    reads: tuple[str, ...] = ()

    suffix = ".html"

    @property
    def chapter(self) -> int:
        """Of the thesis; 0 for what belongs to none."""
        number = re.match(r"chapter(\d+)", self.job.folder)
        return int(number[1]) if number else 0

    @property
    def short(self) -> str:
        """As asked for: number in the thesis (3-8, 5-5a), or the name where the thesis has none (paired)."""
        short = self.name.removeprefix("figure_")
        return short.replace("_", "-") if short[0].isdigit() else short

    @property
    def label(self) -> str:
        """Figure 3-8, Table 3.1, Named physics."""
        if self.short[0].isdigit():
            return f"Figure {self.short}"
        return re.sub(r"(\d) (\d)", r"\1.\2", self.short.replace("_", " ").capitalize())

    @property
    def order(self) -> tuple:
        """Sorts by chapter and number; what has none comes last in its chapter."""
        number = re.match(r"\d+-(\d+)(\w?)$", self.short)
        return (
            self.chapter,
            not number,
            int(number[1]) if number else 0,
            number[2] if number else self.short,
        )

    @property
    def file(self) -> str:
        """Path below results, with `{dataset}`."""
        return str(Path(self.job.folder, self.name + self.suffix))

    @property
    def files(self) -> dict[str, str]:
        """Dataset -> path below results; the key is "" where it is of no dataset."""
        return {name: self.file.replace("{dataset}", name) for name in self.job.datasets or ("",)}

    def found(self, folder: Path) -> str:
        """The sentences about the file in `folder`.

        Raises:
            UserError: a table is missing, or has other columns than its rule writes.
        """
        from thesis_lib.foundation.files import read_json, read_table  # late: loads pandas

        tables = [(read_json if name.endswith(".json") else read_table)(folder / name) for name in self.reads]
        assert self.finding is not None, f"{self.name} has no finding"
        try:
            return self.finding(*tables)
        except (KeyError, IndexError) as error:
            names = ", ".join(str(folder / name) for name in self.reads)
            raise UserError(
                f"{names} lack {error}, from which the finding is read; run the pipeline again."
            ) from error

    def markup(self) -> str:
        """Heading, title and caption as reStructuredText, with the variable `dataset`."""
        numbered = self.label.startswith(("Figure ", "Table "))
        of = " of the thesis" if self.label.startswith("Figure ") else ""
        whose = " ({{ dataset }})" if "{dataset}" in self.job.folder else ""
        heading = f"**{self.label}**{of}{whose}. " if numbered else ""
        return f"{heading}{self.title}. {self.caption}".strip()

    def text(self, dataset: str, results: Path | None = None) -> str:
        """The same as plain text for one dataset, a paragraph a line; with what a run found if it is in `results`."""
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
        """The same as a template of Snakemake's report, which includes what was found."""
        folder = self.job.folder.replace("{dataset}", "{{ dataset }}")
        found = f"\n\n**{FOUND_HERE.strip()}**\n\n.. include:: results/{folder}/{self.name}.txt"
        head = "{% set dataset = snakemake.wildcards.dataset %}\n" if "{dataset}" in self.job.folder else ""
        return f"{head}{self.markup()}{found if self.finding else ''}\n"


@dataclass(frozen=True, kw_only=True)
class Table(Record):
    """A table; its columns stand in foundation/columns.yaml, as those of all tables."""

    suffix = ".csv"


@dataclass(frozen=True, kw_only=True)
class Figure(Record):
    """A picture with a PDF and a CSV of the numbers drawn, of which a small copy is stored.

    Attributes:
        keys: columns compared exactly, as text; separated by spaces.
        tolerances: columns of numbers, separated by spaces, and how far they may move.
        most_rows: the copy keeps at most so many rows, evenly spaced.
        not_compared: why no copy is stored.
        columns: unit and meaning of those columns that only this figure has.
    """

    keys: str = ""
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    most_rows: int = 40
    not_compared: str = ""
    columns: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    suffix = ".png"

    @property
    def text_columns(self) -> list[str]:
        return self.keys.split()

    @property
    def number_columns(self) -> dict[str, Tolerance]:
        return {name: tolerance for names, tolerance in self.tolerances.items() for name in names.split()}
