"""Print a chapter's tables as the thesis lays them out, from the results of the last run.

python -m thesis_lib tables chapter2 [--results results]
"""

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path

from thesis_lib.foundation.command_line import Parser, command
from thesis_lib.foundation.errors import UserError

EXAMPLES = """\
examples:
  python -m thesis_lib tables chapter2
  python -m thesis_lib tables chapter5 --results ../study/results | less -S
"""


CHAPTERS = ("chapter2", "chapter3", "chapter4", "chapter5")


@functools.cache
def chapters() -> dict[str, list[dict[str, str]]]:
    """The tables of each chapter, in the order in which they are printed: title, file, columns."""
    from thesis_lib.foundation.yaml_file import read_yaml

    return read_yaml(Path(__file__).with_suffix(".yaml")).content


def as_text(shown: Mapping[str, str], results: Path) -> str:
    """Title, table and the meaning of its columns; UserError if the table has not been written."""
    import pandas as pd

    from thesis_lib.foundation.columns import explain
    from thesis_lib.foundation.files import read_table

    path, columns = results / shown["file"], shown["columns"].split()
    if not path.is_file():
        raise UserError(f"{path} does not exist yet; make it with: snakemake --cores 2 {shown['file'].split('/')[0]}")
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
def main(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="python -m thesis_lib tables", description=(__doc__ or "").splitlines()[0], epilog=EXAMPLES)
    parser.add_argument("chapter", choices=CHAPTERS, help="whose tables")
    parser.add_argument("--results", type=Path, default=Path("results"), help="default: %(default)s")
    args = parser.parse_args(argv)
    print("\n".join(as_text(shown, args.results) for shown in chapters()[args.chapter]), end="")
    return 0
