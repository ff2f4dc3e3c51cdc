"""results/claims.html: the ledger as a readable page, without network or script, that prints in black and white."""

from collections.abc import Sequence
from pathlib import Path

from thesis_lib.foundation.files import write_text
from thesis_lib.ledger.checks import Interval, Threshold, Within
from thesis_lib.ledger.result import ClaimStatus, Result, count_statuses, summary_line
from thesis_lib.pages import page

TEMPLATE = Path(__file__).with_name("page.html")
SIGNS = {
    ClaimStatus.REPRODUCED: "✓",
    ClaimStatus.DEVIATES: "≠",
    ClaimStatus.NO_DATA: "○",
    ClaimStatus.UNDECIDED: "~",
    ClaimStatus.ERROR: "!",
}
CLASSES = dict(zip(SIGNS, ("reproduced", "deviates", "no-data", "undecided", "error")))


def render_page(results: Sequence[Result], scale: str = "") -> str:
    """The ledger as one self-contained HTML page, by chapter and in the ledger's order; `scale` is shown if given."""
    chapters = []
    for number in sorted({result.claim.chapter for result in results}):
        group = [result for result in results if result.claim.chapter == number]
        look = [result for result in group if result.status in (ClaimStatus.DEVIATES, ClaimStatus.ERROR)]
        rows = [_cells(result) for result in group]
        chapters.append({"number": number, "summary": summary_line(group), "look": look, "rows": rows})
    return page(
        TEMPLATE,
        "Claims ledger: what the thesis states, and what this program finds",
        kind="wide",
        summary=summary_line(results),
        counts=count_statuses(results),
        scale=scale,
        chapters=chapters,
        signs=SIGNS,
        classes=CLASSES,
    )


def write_page(results: Sequence[Result], path: str | Path, scale: str = "") -> None:
    """Write `render_page` to a file, atomically."""
    write_text(render_page(results, scale), path)


def _cells(result: Result) -> dict:
    """The row of a claim: numbers with units, their difference, and the reason."""
    claim = result.claim
    unit = "" if claim.unit == "1" else f" {claim.unit}"
    numeric = result.difference == result.difference  # NaN if the claim is not a number
    value = f"{float(result.ours):.4g}{unit}" if numeric else result.ours
    if result.std == result.std:
        value += f" ± {result.std:.2g}"
    difference = f"{result.difference:+.3g}{unit}" if numeric else ""
    if result.relative_difference == result.relative_difference:
        difference += f" ({100 * result.relative_difference:+.3g}\u00a0%)"
    published = result.published + unit * isinstance(claim.check, Within | Interval | Threshold)
    reason = result.reason
    if numeric and result.status is ClaimStatus.DEVIATES:
        reason = claim.note or "reason unknown"  # the difference has its own column
    return {
        "claim": claim,
        "status": result.status,
        "published": published,
        "ours": value or "–",
        "difference": difference or "–",
        "reason": reason,
        "weak": claim.weak if result.status is ClaimStatus.REPRODUCED else None,
    }
