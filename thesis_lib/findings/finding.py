"""A finding: one to three sentences that a run's own tables say about a figure, for its caption.

A caption says what is drawn and what to look for; it is written once.  The finding is computed, so that it holds for
every scale, seed and dataset: the rules write it beside the picture (figure_4_6.png, figure_4_6.txt), the report
includes it in the caption, and `python -m thesis_lib figures 4-6` prints it.  Words that judge ("above", "within") are
chosen by the numbers, never typed.
"""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_json, read_table, write_text


@dataclass(frozen=True)
class Finding:
    """What is said of one figure or table.

    Attributes:
        tables: files that it is read from, in the folder of the figure; one that ends in .json is a dictionary.
        sentence: tables in the same order -> plain text.
    """

    tables: tuple[str, ...]
    sentence: "Callable[..., str]"

    def read(self, folder: Path) -> str:
        """The sentences about the figure in `folder`.

        Raises:
            UserError: a table is missing, or has other columns than its rule writes.
        """
        read = [(read_json if name.endswith(".json") else read_table)(folder / name) for name in self.tables]
        try:
            return self.sentence(*read)
        except (KeyError, IndexError) as error:
            names = ", ".join(str(folder / name) for name in self.tables)
            raise UserError(
                f"{names} lack {error}, from which the finding is read; run the pipeline again."
            ) from error


def write_findings(findings: Mapping[str, Finding], files: Iterable[str]) -> None:
    """Write what is said of figure_4_6.png to figure_4_6.txt beside it, for each of `files`."""
    for file in map(Path, files):
        write_text(findings[file.stem].read(file.parent) + "\n", file)


def read_from(findings: Mapping[str, Finding], files: Iterable[str]) -> list[str]:
    """The tables from which `write_findings` reads what it writes to `files`."""
    tables = (path.parent / table for path in map(Path, files) for table in findings[path.stem].tables)
    return list(dict.fromkeys(map(os.path.normpath, tables)))  # Snakemake knows no rule that makes a/../b
