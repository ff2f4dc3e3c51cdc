"""The tables of docs/benchmarks.md and of the README, from the rows that the benchmarks wrote.

    python -m benchmarks.table [FOLDER]                      # prints all rows
    python -m benchmarks.table --write docs/benchmarks.md    # puts them there
    python -m benchmarks.table --short --write README.md     # six of them (SHORT)

Reads FOLDER/*.csv (results/benchmarks by default) and prints Markdown, or replaces what stands between
`<!-- benchmarks -->` and `<!-- /benchmarks -->` in a file.  The caption says processor, cores and the days on which the
files were written, the oldest and the newest.
"""

import argparse
import datetime
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from benchmarks.results import COLUMNS
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_table, write_text
from thesis_lib.foundation.kernels import processor

FOLDER = Path(__file__).resolve().parent.parent / "results/benchmarks"
BEGIN, END = "<!-- benchmarks -->", "<!-- /benchmarks -->"
# in this order; others follow by name
ORDER = ("laws", "engines", "bandwidth", "identification", "ensemble", "arcs", "critique", "hidden_effects")

# what the README shows: whole matches of "benchmark: measure"
SHORT = re.compile(
    r"laws: mirtich, batched"
    r"|identification: six laws: CPU time"
    r"|critique: com_offset_x: CPU time"
    r"|hidden_effects: .*: names it"
)


def read_rows(folder: Path, wanted: re.Pattern[str] | None = None) -> tuple[pd.DataFrame, list[datetime.date]]:
    """All rows in the table's order, and the days of their files, the oldest first.

    `wanted`: only rows whose "benchmark: measure" is a whole match.

    Raises:
        UserError: there are none.
        CorruptFileError: a file lacks a column.
    """
    files = sorted(path for path in folder.glob("*.csv") if not path.name.startswith("."))
    if not files:
        raise UserError(f"There is no benchmark in {folder}; run make bench, which writes them there.")
    files.sort(key=lambda path: (ORDER.index(path.stem) if path.stem in ORDER else len(ORDER), path.stem))
    parts, days = [], []
    for path in files:
        rows = read_table(path, COLUMNS)[COLUMNS]
        if wanted:
            names = rows["benchmark"] + ": " + rows["measure"]
            rows = rows[[wanted.fullmatch(name) is not None for name in names]]
        if len(rows):
            parts.append(rows)
            days.append(datetime.datetime.fromtimestamp(path.stat().st_mtime, tz=datetime.UTC).date())
    if not parts:
        raise UserError(f"None of the benchmarks in {folder} has a row that is shown here; run make bench.")
    return pd.concat(parts, ignore_index=True), sorted(days)


def number(value: float) -> str:
    """Three digits, thousands in full; an empty cell for what was not measured."""
    if pd.isna(value):
        return ""
    if value != 0 and abs(value) < 1e-3:
        return f"{value:.2e}"
    return f"{value:,.0f}" if abs(value) >= 1000 or value == int(value) else f"{value:.3g}"


def markdown(rows: pd.DataFrame, days: Sequence[datetime.date]) -> str:
    """The table with its caption; `days` on which it was measured, the oldest first."""
    cores, model = os.cpu_count() or 1, processor()["model"]
    when = " to ".join(dict.fromkeys((days[0].isoformat(), days[-1].isoformat())))
    lines = [
        f"Measured on {model}, {cores} core{'s' * (cores > 1)}, {when}; on one core where nothing else is "
        "said.  Ratios compare times of one run.",
        "",
        "| benchmark | measure | value | unit | note |",
        "|---|---|---|---|---|",
    ]
    for row in rows.itertuples():
        unit = "" if str(row.unit) == "1" else row.unit
        cells = [row.benchmark, row.measure, number(row.value), unit, row.note]
        texts = ["" if pd.isna(cell) else str(cell).replace("|", "\\|") for cell in cells]
        lines.append("| " + " | ".join(texts) + " |")
    return "\n".join(lines)


def replaced(text: str, table: str, name: str) -> str:
    """`text` with the table between its markers.

    Raises:
        UserError: not exactly one pair of markers stands there.
    """
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise UserError(f"{name} must hold {BEGIN} and, below it, {END}, once each; the table goes between them.")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n{table}\n{END}{after}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; 1 if there is nothing to show or nowhere to write it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.table", description="Markdown table of all benchmarks.")
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--short", action="store_true", help="only the rows that the README shows")
    parser.add_argument("--write", type=Path, metavar="FILE.md", help="replace the table in this file")
    options = parser.parse_args(arguments)
    try:
        table = markdown(*read_rows(options.folder, SHORT if options.short else None))
        if options.write is None:
            print(table)
            return 0
        if not options.write.is_file():
            raise UserError(f"There is no file {options.write} to write the table into.")
        write_text(replaced(options.write.read_text(encoding="utf-8"), table, str(options.write)), options.write)
    except UserError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
