"""One frame, style and set of elements for every HTML page: critique, batch, run, claims ledger.

Pages are Jinja2 templates beside the code that fills them; content is escaped unless it is `Markup` already.
`page.html` is the frame that each extends, `elements.html` holds its parts.

A page is one file: it needs no network, and equal content gives equal bytes.  Text is readable without its script; a
policy in the head lets the browser run only that script, and load nothing.
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
    """A whole HTML document.

    Args:
        template: extends pages/page.html; `content` are its variables.
        title: of page and window, as plain text.
        script: JavaScript, run when the page has loaded.
        kind: CSS class of the page: `wide` for tables of many columns.
    """
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    allowed = f"script-src 'sha256-{digest}'; " if script else ""
    policy = f"default-src 'none'; {allowed}style-src 'unsafe-inline'; img-src data:; form-action 'none'"
    style = SHEET.read_text(encoding="utf-8")
    return render(template, title=title, script=script, kind=kind, policy=policy, style=style, **content)


def render(template: Path, **content: Any) -> Markup:
    """A template filled with its content, as HTML that is not escaped again."""
    return Markup(_environment().get_template(template.relative_to(FOLDER.parent).as_posix()).render(**content))


def element(name: str, *content: Any) -> Markup:
    """The macro `name` of elements.html applied to its arguments, as HTML that is not escaped again."""
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
