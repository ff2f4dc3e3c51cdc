"""Commands `thesis-lib tables` and `figures`, which show the results of the last run.

`tables` prints a chapter's tables in the layout of the thesis; `figures` lists figures, their files and captions, and
the commands that make them.
"""

import functools
import json
import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

from thesis_lib.foundation.command_line import Parser, command, near
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.records.catalogue import figures
from thesis_lib.thesis.records.record import Figure

TABLES = "Print a chapter's tables in the layout of the thesis, from the results of the last run."
EXAMPLES = """\
examples:
  thesis-lib tables chapter2
  thesis-lib tables chapter5 --results ../study/results | less -S
"""
CHAPTERS = ("chapter2", "chapter3", "chapter4", "chapter5")
FIGURES = """\
List the figures with their files; with a number or name, show its files, its caption, and the command that makes it.
"""
FIGURES_EXAMPLES = """\
examples:
  thesis-lib figures
  thesis-lib figures 3-8
  thesis-lib figures 3-8 --dataset planar_dice
  thesis-lib figures named_physics
  thesis-lib figures --json | jq -r '.[].files[].path'
"""
WIDTH = 100


@functools.cache
def chapters() -> dict[str, list[dict[str, str]]]:
    """Tables of each chapter in the order of printing: title, file, columns."""
    from thesis_lib.foundation.yaml_file import read_yaml

    return read_yaml(Path(__file__).with_suffix(".yaml")).content


def as_text(shown: Mapping[str, str], results: Path) -> str:
    """Text with title, table and the meaning of its columns; UserError if the table does not exist."""
    import pandas as pd

    from thesis_lib.foundation.columns import explain
    from thesis_lib.foundation.files import read_table

    path, columns = results / shown["file"], shown["columns"].split()
    if not path.is_file():
        raise UserError(f"{path} does not exist yet; create it with: snakemake --cores 2 {shown['file'].split('/')[0]}")
    table = read_table(path, columns)[columns]
    meanings = explain(path.stem, columns)
    with pd.option_context("display.width", 250, "display.max_colwidth", 60):
        body = table.to_string(index=False, na_rep="-", float_format=lambda value: f"{value:.4g}")
    lines = [
        f"  {row.column}{f' ({row.unit})' if row.unit not in ('', '1') else ''}: {row.meaning}"
        for row in meanings.itertuples()
    ]
    return "\n".join([shown["title"], "=" * len(shown["title"]), "", body, "", *lines, ""])


@command
def tables(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="thesis-lib tables", description=TABLES, epilog=EXAMPLES)
    parser.add_argument("chapter", choices=CHAPTERS, help="chapter whose tables are printed")
    parser.add_argument("--results", type=Path, default=Path("results"), help="default: %(default)s")
    args = parser.parse_args(argv)
    print("\n".join(as_text(shown, args.results) for shown in chapters()[args.chapter]), end="")
    return 0


def find_figure(asked: str) -> Figure:
    """Find a figure by number or name: 3-8, 3.8, "Figure 3-8" and figure_3_8.png are equivalent.

    UserError if there is none; the message lists similar names.
    """
    key = re.sub(r"^fig(ure|\.)?[\s_]*", "", asked.strip().lower().removesuffix(".png"))
    key = re.sub(r"[._\s-]+", "-", key)
    for figure in figures():
        if figure.short.replace("_", "-") == key:
            return figure
    names = [figure.short for figure in figures()]
    raise UserError(f"There is no figure {asked!r}{near(key, names)}\nthesis-lib figures lists them.")


def as_dictionary(figure: Figure, results: Path) -> dict:
    """Dictionary that --json prints for a figure."""
    return {
        "figure": figure.short,
        "chapter": figure.chapter,
        "title": figure.title,
        "files": [
            {"dataset": dataset or None, "path": str(results / path), "made": (results / path).is_file()}
            for dataset, path in figure.files.items()
        ],
        "caption": {dataset: figure.text(dataset, results) for dataset in figure.files},
        "command": f"snakemake --cores 2 {' '.join(f'results/{path}' for path in figure.files.values())}",
    }


def list_text(results: Path) -> str:
    """List of figures by chapter, two lines each; {a,b} in a path means a or b, as in a shell."""
    lines, chapter = [], None
    for figure in figures():
        if figure.chapter != chapter:
            chapter = figure.chapter
            lines += [*[""] * bool(lines), f"chapter {chapter}"]
        datasets = ",".join(figure.files)
        path = figure.file.replace("{dataset}", f"{{{datasets}}}" if "," in datasets else datasets)
        missing = [name for name, file in figure.files.items() if not (results / file).is_file()]
        note = f"   not made yet{': ' * bool(missing[0])}{', '.join(missing)}" if missing else ""
        lines += [f"  {figure.short:<16}{figure.title}", f"  {'':<16}{results / path}{note}"]
    return "\n".join([*lines, "\nthesis-lib figures NUMBER shows the caption and what makes it."])


def figure_text(figure: Figure, results: Path, dataset: str) -> str:
    """Text with the files and commands of one figure, and its caption for one dataset."""
    lines = []
    for path in figure.files.values():
        note = "" if (results / path).is_file() else "   not made yet"
        lines += [f"{results / path}{note}", f"    snakemake --cores 2 results/{path}"]
    lines.append("beside each picture: the same as .pdf, and its numbers as .csv")
    for text in figure.text(dataset, results).split("\n\n"):
        lines += ["", *textwrap.wrap(text, WIDTH)]
    return "\n".join(lines)


def _shown_dataset(figure: Figure, results: Path, asked: str | None) -> str:
    if asked and asked not in figure.files:
        known = ", ".join(filter(None, figure.files)) or "none, as it does not use a dataset"
        raise UserError(f"Figure {figure.short} has no dataset {asked!r}; it has {known}.")
    made = [name for name, path in figure.files.items() if (results / path).is_file()]
    return asked or (made or list(figure.files))[0]


@command
def list_figures(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="thesis-lib figures", description=FIGURES, epilog=FIGURES_EXAMPLES)
    parser.add_argument("figure", nargs="?", metavar="NUMBER", help="such as 3-8; default: list all")
    parser.add_argument("--results", type=Path, default=Path("results"), help="default: %(default)s")
    parser.add_argument("--dataset", metavar="NAME", help="dataset of the caption; default: the first with a picture")
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    args = parser.parse_args(argv)
    figure = find_figure(args.figure) if args.figure else None
    if args.json:
        entries = [as_dictionary(each, args.results) for each in ([figure] if figure else figures())]
        print(json.dumps(entries[0] if figure else entries, indent=1, ensure_ascii=False))
    elif figure:
        print(figure_text(figure, args.results, _shown_dataset(figure, args.results, args.dataset)))
    else:
        print(list_text(args.results))
    return 0
