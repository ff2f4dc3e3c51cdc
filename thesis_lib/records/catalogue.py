"""All records, found in the modules of this folder; no other list exists."""

import functools
import os
import pkgutil
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

from thesis_lib.records.record import Figure, Record


@functools.cache
def records() -> dict[str, Record]:
    """Records by name, in the order of the thesis; those without a number come last in their chapter.

    Raises:
        ValueError: two records have the same name.
    """
    names = [module.name for module in pkgutil.iter_modules([str(Path(__file__).parent)])]
    modules = [import_module(f"thesis_lib.records.{name}") for name in names if name != "catalogue"]
    listed = {id(value): value for module in modules for value in vars(module).values() if isinstance(value, Record)}
    by_name = {record.name: record for record in sorted(listed.values(), key=lambda record: record.order)}
    if len(by_name) < len(listed):
        raise ValueError("two records have the same name")
    return by_name


def figures() -> list[Figure]:
    """The records of figures, in the same order."""
    return [record for record in records().values() if isinstance(record, Figure)]


def write_findings(files: Iterable[str]) -> None:
    """Write the finding of each figure or table, e.g. of figure_4_6.png to figure_4_6.txt beside it."""
    from thesis_lib.foundation.files import write_text  # late: loads pandas, not needed to list figures

    for file in map(Path, files):
        write_text(records()[file.stem].found(file.parent) + "\n", file)


def tables_read(files: Iterable[str]) -> list[str]:
    """The tables from which `write_findings` computes the findings in `files`."""
    tables = (path.parent / table for path in map(Path, files) for table in records()[path.stem].reads)
    return list(dict.fromkeys(map(os.path.normpath, tables)))  # Snakemake finds no rule for a/../b
