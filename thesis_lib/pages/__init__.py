"""Frame, style and elements shared by all HTML pages: critique, batch, run, claims ledger.

Pages are Jinja2 templates beside the code that fills them; content is escaped unless it is already `Markup`.
`page.html` is the frame that all pages extend, `elements.html` contains their parts.

A page is one file: it needs no network, and equal content gives equal bytes.  Text is readable without the script; a
policy in the head allows the browser to run only this script, and to load nothing.
"""

import base64
import functools
import hashlib
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

FOLDER = Path(__file__).parent
SHEET = FOLDER / "page.css"


def page(template: Path, title: str, *, script: str = "", kind: str = "", **content: Any) -> str:
    """Return a whole HTML document.

    Args:
        template: extends pages/page.html; `content` are its variables.
        title: title of page and window, as plain text.
        script: JavaScript, run when the page has loaded.
        kind: CSS class of the page: `wide` for tables of many columns.
    """
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    allowed = f"script-src 'sha256-{digest}'; " if script else ""
    policy = f"default-src 'none'; {allowed}style-src 'unsafe-inline'; img-src data:; form-action 'none'"
    style = SHEET.read_text(encoding="utf-8")
    return render(template, title=title, script=script, kind=kind, policy=policy, style=style, **content)


def render(template: Path, **content: Any) -> Markup:
    """Return a template filled with its content, as HTML that is not escaped again."""
    return Markup(_environment().get_template(template.relative_to(FOLDER.parent).as_posix()).render(**content))


def element(name: str, *content: Any) -> Markup:
    """Apply the macro `name` of elements.html to its arguments; return HTML that is not escaped again."""
    return getattr(_environment().get_template("pages/elements.html").module, name)(*content)


@functools.cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(FOLDER.parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
