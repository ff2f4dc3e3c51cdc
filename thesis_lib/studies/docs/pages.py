"""Generation of the parts of the pages in docs/ that come from the code.

A page is Markdown written by hand; only the text between the two lines

    <!-- written by python -m thesis_lib.studies.docs: NAME -->
    <!-- end of NAME -->

is generated, by `BLOCKS[NAME]`.  A page with a template in docs/templates/ (README.md, for example) is rendered
from the template with numbers from stored tables, laws, effects and columns (`templates`).
"""

import re
from collections.abc import Callable
from pathlib import Path

from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.recordings.header import RecordingHeader
from thesis_lib.foundation.errors import UserError
from thesis_lib.studies.docs import configuration
from thesis_lib.studies.docs.templates import filled
from thesis_lib.studies.proof import (
    by_contact,
    direct_fits,
    headline,
    measured,
    measured_models,
    next_drops,
    proposals,
    space,
)
from thesis_lib.studies.proof import engines as engine_proof
from thesis_lib.studies.proof.results import outcomes, recovered

BLOCKS: dict[str, Callable[[], str]] = {
    "configuration": configuration.text,
    "dataset keys": lambda: configuration.header_text(Header),
    "dataset keys in space": lambda: configuration.header_text(SpaceHeader),
    "recording keys": lambda: configuration.header_text(RecordingHeader),
    "headline": headline.as_markdown,
    "ages of the proof": headline.ages_as_markdown,
    "real contacts": lambda: by_contact.as_markdown(outcomes(), recovered(), folded=True).rstrip("\n"),
    "fits of simulated drops": lambda: direct_fits.tables()[0],
    "fits of measured drops": lambda: direct_fits.tables()[1],
    "measured sets": measured.as_markdown,
    "engines": engine_proof.as_markdown,
    "proof in space": lambda: space.as_markdown(space.FIRST),
    "proof in worlds": lambda: space.as_markdown(space.IN_WORLDS),
    "lifted sets": space.lifted_as_markdown,
    "proposals": proposals.as_markdown,
    "next experiment": next_drops.as_markdown,
    "models of measured sets": measured_models.as_markdown,
    "models of the cube": lambda: measured_models.as_markdown(planar=False),
}
_BLOCK = re.compile(
    r"(<!-- written by python -m thesis_lib\.studies\.docs: (?P<name>[^>]+) -->\n).*?(<!-- end of (?P=name) -->)", re.S
)
_BEGINS = re.compile(r"<!-- written by python -m thesis_lib\.studies\.docs: ([^>]+) -->")


def rendered(page: str, where: str) -> str:
    """The page with all blocks regenerated; UserError, which names the page as `where`, if a block is malformed."""
    names = [match["name"] for match in _BLOCK.finditer(page)]
    for name in _BEGINS.findall(page):
        if name not in BLOCKS:
            raise UserError(f"{where}: there is no block called {name!r}; the blocks are {', '.join(BLOCKS)}.")
        if name not in names:
            raise UserError(f"{where}: the block {name!r} has no end; add the line <!-- end of {name} -->.")
    return _BLOCK.sub(lambda match: f"{match[1]}\n{BLOCKS[match['name']]()}\n\n{match[3]}", page)


def stale_pages(folder: Path) -> dict[Path, str]:
    """Outdated pages of `folder` and the README beside it, with the text that they should have.

    UserError if there are no pages, a block is malformed, or the numbers of a template are not available.
    """
    pages = sorted(folder.glob("*.md"))
    if not pages:
        raise UserError(f"There are no pages in {folder}; run this in the root of the repository.")
    stale, root = {}, folder.resolve().parent
    for path in [*pages, *root.glob("README.md")]:
        page = path.read_text(encoding="utf-8")
        template = folder / "templates" / path.resolve().relative_to(root)
        text = filled(template.read_text(encoding="utf-8"), str(template)) if template.is_file() else page
        wanted = rendered(text, str(path))
        if wanted != page:
            stale[path] = wanted
    return stale
