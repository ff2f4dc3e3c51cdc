"""Every column of every table under results/ with its unit and meaning, from columns.yaml."""

from thesis_lib.docs.markdown import code, table
from thesis_lib.foundation.columns import meanings

HEAD = ("column", "unit", "meaning")


def text() -> str:
    """Columns with the same meaning everywhere, then those of single tables."""
    everywhere, tables = meanings()
    parts = ["## In every table", table(HEAD, _rows(everywhere)), "## In one table only"]
    for name in sorted(tables):
        parts += [f"### `{name}.csv`", table(HEAD, _rows(tables[name]))]
    return "\n\n".join(parts)


def _rows(columns: dict[str, list[str]]) -> list[tuple[str, str, str]]:
    return [(code(name), unit, meaning) for name, (unit, meaning) in sorted(columns.items())]
