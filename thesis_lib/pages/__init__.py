"""One frame and one style for every page that is written: critique, index of a batch, claims ledger.

A page is one file: it needs no network, and equal content gives equal bytes.  Text is readable without its script; a
policy in the head lets the browser run that script and no other, and load nothing from anywhere.
"""

import base64
import hashlib
from collections.abc import Collection, Iterable, Sequence
from html import escape
from pathlib import Path

FOLDER = Path(__file__).parent
SHEET = FOLDER / "page.css"


def page(title: str, content: str, *, script: str = "", kind: str = "") -> str:
    """A whole HTML document.

    Args:
        title: of page and window, as plain text.
        content: HTML of what is on the page.
        script: JavaScript, run when all is read.
        kind: a class for the page: `wide` for tables of many columns.
    """
    name = escape(title)
    code = f"<script>{script}</script>\n" if script else ""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    allowed = f"script-src 'sha256-{digest}'; " if script else ""
    policy = f"default-src 'none'; {allowed}style-src 'unsafe-inline'; img-src data:; form-action 'none'"
    attribute = f' class="{kind}"' if kind else ""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f"<title>{name}</title>\n<style>\n{SHEET.read_text(encoding='utf-8')}</style>\n</head>\n<body{attribute}>\n"
        '<a class="skip" href="#main">Skip to the content</a>\n'
        f'<header><h1>{name}</h1></header>\n<main id="main">\n{content}\n</main>\n'
        f"{code}</body>\n</html>\n"
    )


def table(
    caption: str, columns: Sequence[str], rows: Iterable[Sequence[str]], numeric: Collection[int] = ()
) -> str:
    """A table of cells that are HTML already, in a frame that scrolls by itself; '' where there are no rows.

    The first cell of a row heads it; `numeric` columns are set to the right.
    """
    kinds = [' class="number"' if i in numeric else "" for i in range(len(columns))]
    head = "".join(f'<th scope="col"{kind}>{escape(name)}</th>' for name, kind in zip(columns, kinds))
    body = []
    for first, *rest in rows:
        cells = "".join(f"<td{kind}>{cell}</td>" for cell, kind in zip(rest, kinds[1:]))
        body.append(f'<tr><th scope="row">{first}</th>{cells}</tr>')
    if not body:
        return ""
    lines = "\n".join(body)
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">\n<table>\n'
        f"<caption>{escape(caption)}</caption>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{lines}\n</tbody>\n</table>\n</div>"
    )
