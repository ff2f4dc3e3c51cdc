"""Small pieces of Markdown: tables, links to DOIs, and the docstring of a module as part of a page."""

import ast
import inspect
import re
from collections.abc import Iterable, Sequence
from types import ModuleType

DOI = re.compile(r"doi:? ?(10\.\d{4,}/[^\s,;]*[^\s,;.)])")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Markdown table; cells may contain any text without line breaks."""
    lines = [_row(head), "|" + "---|" * len(head), *map(_row, rows)]
    return "\n".join(lines)


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def code(text: str) -> str:
    """Text set as code; an empty text stays empty."""
    return f"`{text}`" if text else ""


def with_links(text: str) -> str:
    """Text with its DOIs as links."""
    return DOI.sub(lambda match: f"[doi:{match[1]}](https://doi.org/{match[1]})", text)


def docstring(module: ModuleType) -> str:
    """The docstring of a module as Markdown; its equations must be indented, its tables already Markdown."""
    # from the source: a docstring is absent under python -OO
    text = ast.get_docstring(ast.parse(inspect.getsource(module))) or ""
    # Markdown reads an indented line as an equation only after an empty line
    return with_links(re.sub(r"^(\S.*)\n(?= {4})", r"\1\n\n", text, flags=re.M))
