"""Common parts of the reports of all critiques: verdict, sentences, and sections in the order of a reader's questions.

How far is the model from the measurements, where does it fail, which effect is missing, what does adding it change,
what remains open, and what could these data have shown?
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from markupsafe import Markup

from thesis_lib.pages import page

TEMPLATE = Path(__file__).with_name("skeleton.html")
Sections = Sequence[tuple[str, str, Sequence[Markup]]]  # name (target of links), title and content


def critique_page(
    d: Mapping,
    sections: Sections,
    word: str,
    *,
    kind: str = "",
    about: str = "",
    key_numbers: Sequence[tuple[str, str, str]] = (),
    script: str = "",
) -> str:
    """The page of a critique.

    Args:
        d: content of diagnosis.json.
        sections: in order; empty parts and empty sections are left out.
        word: the verdict in one line; `about` is the text below it, and `kind` its CSS class if not its own name.
        key_numbers: name, value and note.
        script: JavaScript, run when the page has loaded.
    """
    filled = [(name, title, [part for part in parts if part]) for name, title, parts in sections]
    return page(
        TEMPLATE,
        f"Critique of {d['dataset']}",
        script=script,
        verdict=kind or d["verdict"],
        word=word,
        sentences=d.get("summary", []),
        about=about,
        key_numbers=key_numbers,
        sections=[section for section in filled if section[2]],
    )
