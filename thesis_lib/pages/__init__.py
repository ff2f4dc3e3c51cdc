"""One frame and one style for every page that is written: critique, index of a batch, claims ledger.

A page is one file: it needs no network, and equal content gives equal bytes.  Text is readable without its script; a
policy in the head lets the browser run that script and no other, and load nothing from anywhere.
"""

import base64
import hashlib
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
