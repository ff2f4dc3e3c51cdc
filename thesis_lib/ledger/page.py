"""results/claims.html: the ledger as a person reads it.

The page needs no network and no script.  Statuses are told by word and sign, with colour only as a help, and it prints
in black and white.
"""

from collections.abc import Sequence
from html import escape
from itertools import groupby
from pathlib import Path

from thesis_lib.foundation.files import write_text
from thesis_lib.ledger.result import Result, Status, count_statuses, summary_line
from thesis_lib.pages import page

SIGNS = {Status.REPRODUCED: "✓", Status.DEVIATES: "≠", Status.NO_DATA: "○", Status.ERROR: "!"}
CLASSES = {
    Status.REPRODUCED: "reproduced",
    Status.DEVIATES: "deviates",
    Status.NO_DATA: "no-data",
    Status.ERROR: "error",
}
HEADINGS = {  # heading: class that sets the column's width
    "Where": "where",
    "What is claimed": "claim",
    "Published": "value",
    "Ours": "value",
    "Difference": "difference",
    "Status": "found",
}


def render_page(results: Sequence[Result], scale: str = "") -> str:
    """The whole ledger as one self-contained HTML page, by chapter and in the ledger's order.

    Args:
        scale: shown in the introduction if given.
    """
    at_scale = f" This run was at scale <em>{escape(scale)}</em>." if scale else ""
    chapters = [_chapter(number, list(group)) for number, group in _by_chapter(results)]
    content = "\n".join(
        [
            f'<p class="summary">{escape(summary_line(results))}</p>',
            _bar(results),
            f"<p>Each row is one statement of the thesis beside our own result.{at_scale} A deviation is not a "
            "failure: it is what an honest repetition found, with the reason where it is known.</p>",
            _legend(),
            *chapters,
        ]
    )
    return page("Claims ledger: what the thesis states, and what this program finds", content, kind="wide")


def write_page(results: Sequence[Result], path: str | Path, scale: str = "") -> None:
    """Write `render_page` to a file, atomically."""
    write_text(render_page(results, scale), path)


def _by_chapter(results: Sequence[Result]) -> list[tuple[int, list[Result]]]:
    ordered = sorted(results, key=lambda r: r.claim.chapter)  # stable: the ledger's order within a chapter
    return [(number, list(group)) for number, group in groupby(ordered, key=lambda r: r.claim.chapter)]


def _bar(results: Sequence[Result]) -> str:
    parts = "".join(
        f'<span class="{CLASSES[status]}" style="flex: {count}"></span>'
        for status, count in count_statuses(results).items()
        if count
    )
    return f'<div class="bar" aria-hidden="true">{parts}</div>'


def _legend() -> str:
    meanings = {
        Status.REPRODUCED: "our value agrees within the tolerance stated beside it",
        Status.DEVIATES: "it does not; by how much, and why if known, stands beside it",
        Status.NO_DATA: "the measurements behind it were not at hand in this run; nothing is said",
        Status.ERROR: "our value is missing or not a number; this run is incomplete",
    }
    rows = [
        f'<dt class="{CLASSES[status]}">{SIGNS[status]} {escape(str(status))}</dt><dd>{escape(text)}</dd>'
        for status, text in meanings.items()
    ]
    return f'<dl class="legend">{"".join(rows)}</dl>'


def _chapter(number: int, results: list[Result]) -> str:
    head = "".join(f'<th scope="col" class="{kind}">{name}</th>' for name, kind in HEADINGS.items())
    deviating = [r for r in results if r.status in (Status.DEVIATES, Status.ERROR)]
    links = "".join(
        f'<li><a href="#{escape(r.claim.id)}">{SIGNS[r.status]} {escape(r.claim.location)}'
        f'<span class="id">{_breakable(r.claim.id)}</span></a></li>'
        for r in deviating
    )
    look = f'<p>To look at:</p>\n<ul class="look">{links}</ul>\n' if links else ""
    body = "\n".join(_row(result) for result in results)
    return (
        f"<section>\n<h2>Chapter {number}</h2>\n{look}"
        f'<div class="scroll" tabindex="0" role="region" aria-label="Claims of chapter {number}"><table>\n'
        f"<caption>{escape(summary_line(results))}</caption>\n"
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table></div>\n</section>"
    )


def _row(result: Result) -> str:
    claim, kind = result.claim, CLASSES[result.status]
    unit = "" if claim.unit == "1" else f" {claim.unit}"
    numeric = result.difference == result.difference  # NaN where the claim is no number
    ours = f"{float(result.ours):.4g}{unit}" if numeric else result.ours
    if result.std == result.std:
        ours += f" ± {result.std:.2g}"
    difference = f"{result.difference:+.3g}{unit}" if numeric else ""
    if result.relative_difference == result.relative_difference:
        difference += f" ({100 * result.relative_difference:+.3g}\u00a0%)"
    published = f"{result.published}{unit}" if numeric or _is_number(result.published) else result.published
    reason = result.reason
    if numeric and result.status is Status.DEVIATES:
        reason = claim.note or "reason unknown"  # by how much stands in its own column
    detail = f'<span class="detail">{escape(reason)}</span>' if reason else ""
    return (
        f'<tr id="{escape(claim.id)}"><th scope="row">{escape(claim.location)}</th>'
        f'<td>{escape(claim.statement)}<span class="id">{escape(claim.id)}</span></td>'
        f'<td class="number">{_breakable(published)}</td><td class="number">{_breakable(ours or "–")}</td>'
        f'<td class="number">{escape(difference or "–")}</td>'
        f'<td class="status {kind}"><span class="mark">{SIGNS[result.status]} {escape(str(result.status))}</span>'
        f'{detail}<span class="detail">Check: {escape(claim.check.text())}</span></td></tr>'
    )


def _breakable(text: str) -> str:
    """Escaped text that may be broken after an underscore, as names of laws are long."""
    return escape(text).replace("_", "_<wbr>")


def _is_number(text: str) -> bool:
    try:
        float(text.removeprefix("> ").removeprefix("< "))
    except ValueError:
        return False
    return True
