"""Common parts of the reports of all critiques: verdict, sentences, and sections in the order of a reader's questions.

How far is the model from the measurements, where does it fail, which effect is missing, what does adding it change,
what remains open, and what could these data have shown?
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from markupsafe import Markup

from thesis_lib.pages import page

TEMPLATE = Path(__file__).with_name("skeleton.html")
WORDS = {
    "adequate": "✓ adequate: no {} is missing that these data could show",
    "effects": "+ effects found: named effects explain what was missing",
    "unexplained": "? unexplained: structure remains that no named effect explains",
}


def critique_page(
    d: Mapping,
    contents: Mapping[str, Sequence[str | Markup | None]],
    lacking: str,
    *,
    word: str = "",
    kind: str = "",
    about: str = "",
    key_numbers: Sequence[tuple[str, str, str]] = (),
    script: str = "",
) -> str:
    """The page of a critique.

    Args:
        d: content of diagnosis.json.
        contents: sections by title, in order: the target of links, then the parts; empty parts are left out, and
            sections without parts.
        lacking: what a model may lack: effect or force.
        word: the verdict in one line, if not that of `WORDS`; `about` is the text below it, and `kind` its CSS class if
            not its own name.
        key_numbers: name, value and note.
        script: JavaScript, run when the page has loaded.
    """
    sections = [(name, title, [part for part in parts if part]) for title, (name, *parts) in contents.items()]
    return page(
        TEMPLATE,
        f"Critique of {d['dataset']}",
        script=script,
        verdict=kind or d["verdict"],
        word=word or WORDS[d["verdict"]].format(lacking),
        sentences=d.get("summary", []),
        about=about,
        key_numbers=key_numbers,
        sections=[section for section in sections if section[2]],
    )
