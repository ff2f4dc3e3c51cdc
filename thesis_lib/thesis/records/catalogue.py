"""All records in this folder: chapter2.yaml has the records of a chapter, chapter2.py the functions they use."""

import functools
import os
import pkgutil
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

from thesis_lib.thesis.records.record import Figure, Job, Record, Tolerance, public

FOLDER = Path(__file__).parent


@functools.cache
def records() -> dict[str, Record]:
    """All records by name, in the order of the thesis; records without a number come last in their chapter.

    Raises:
        ValueError: two records have the same name.
    """
    stems = {path.stem for path in FOLDER.glob("*.yaml")} & {one.name for one in pkgutil.iter_modules([str(FOLDER)])}
    modules = {stem: import_module(f"thesis_lib.thesis.records.{stem}") for stem in stems}
    listed = [one for stem, module in modules.items() for one in _read(FOLDER / f"{stem}.yaml", module)]
    by_name = {record.name: record for record in sorted(listed, key=lambda record: record.order)}
    if len(by_name) < len(listed):
        raise ValueError("two records have the same name")
    return by_name


@functools.cache
def openings() -> dict[int, tuple[str, ...]]:
    """Names of the records that open each chapter in the report of a run; the first is the figure shown."""
    from thesis_lib.foundation.yaml_file import read_yaml  # late, as below

    opens = [read_yaml(path).content["opens"] for path in sorted(FOLDER.glob("chapter*.yaml"))]
    return {records()[names[0]].chapter: tuple(names) for names in opens}


def _read(path: Path, computing: ModuleType) -> Iterator[Record]:
    """Read the records of a file; their findings can use the names of the module `computing`."""
    from thesis_lib.foundation.yaml_file import read_yaml  # late: the command line lists its options without it

    document = read_yaml(path)
    document.refuse_repeated(path)
    content = document.content
    jobs = {rule: Job(rule, **job) for rule, job in content["jobs"].items()}
    shared = {name: Tolerance(**fields) for name, fields in content.get("tolerances", {}).items()}
    for name, fields in content["records"].items():
        reads = fields.pop("reads", [f"{name}.csv"] if "finding" in fields else [])
        of_all = {"name": name, "job": jobs[fields.pop("job")], "reads": tuple(reads), "known": public(computing)}
        if name.startswith("figure_"):
            limits = fields.pop("tolerances", {}).items()
            of_all["tolerances"] = {at: shared[to] if isinstance(to, str) else Tolerance(**to) for at, to in limits}
            yield Figure(**of_all, **fields)
        else:
            yield Record(**of_all, **fields)


def figures() -> list[Figure]:
    """Return the records of figures, in the same order."""
    return [record for record in records().values() if isinstance(record, Figure)]


def write_findings(files: Iterable[str]) -> None:
    """Write the finding of each figure or table to a text file, e.g. of figure_4_6.png to figure_4_6.txt."""
    from thesis_lib.foundation.files import write_text  # late: loads pandas, not needed to list figures

    for file in map(Path, files):
        write_text(records()[file.stem].found(file.parent) + "\n", file)


def tables_read(files: Iterable[str]) -> list[str]:
    """List the tables from which `write_findings` computes the findings in `files`."""
    tables = (path.parent / table for path in map(Path, files) for table in records()[path.stem].reads)
    return list(dict.fromkeys(map(os.path.normpath, tables)))  # Snakemake finds no rule for a/../b
