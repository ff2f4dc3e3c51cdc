"""Results of claims, with status, our value and the published value; the table claims.csv and the page claims.html.

| status             | condition                                                                                   |
|--------------------|---------------------------------------------------------------------------------------------|
| `reproduced`       | the claim's check holds                                                                     |
| `deviates`         | it does not hold; the result states by how much, and why if the ledger gives a reason       |
| `data not present` | the run did not have a dataset that the claim needs: neutral                                |
| `not decided`      | too much noise, in our data or (if the claim states it) at this scale: shown, neutral       |
| `error`            | no comparison was possible, e.g. because a file is missing; `refuse_errors` lists all errors |

difference = ours − published (threshold checks: ours − threshold); relative_difference = difference / abs(published
or threshold).

The page is readable without network or script, also in black and white.  Its script adds a search and filters.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import FLOAT_FORMAT, write_text
from thesis_lib.pages import page
from thesis_lib.statistics.wording import MINUS, number
from thesis_lib.thesis.ledger.checks import Interval, Threshold, Within
from thesis_lib.thesis.ledger.format import CUBE, Claim


class ClaimStatus(StrEnum):
    """Status of a claim (see the module's table)."""

    REPRODUCED = "reproduced"
    DEVIATES = "deviates"
    NO_DATA = "data not present"
    UNDECIDED = "not decided"
    ERROR = "error"


@dataclass(frozen=True)
class Result:
    """A claim and its result in this run.

    published, ours: as shown, '' if there is no value.  std: our standard error.  Numbers are NaN where they have no
    meaning.  finding: the comparison, or the error, in words.
    """

    claim: Claim
    status: ClaimStatus
    published: str = ""
    ours: str = ""
    std: float = math.nan
    difference: float = math.nan
    relative_difference: float = math.nan
    finding: str = ""

    @property
    def reason(self) -> str:
        """Reason why the claim is not reproduced; '' if it is."""
        if self.status is ClaimStatus.REPRODUCED:
            return ""
        if self.status is ClaimStatus.DEVIATES:
            return f"{self.finding}; {self.claim.note or 'reason unknown'}"
        if self.status is ClaimStatus.UNDECIDED and self.claim.note and self.finding != self.claim.quick:
            return f"{self.finding}; {self.claim.note}"
        return self.finding


TEMPLATE = Path(__file__).with_name("page.html")
SCRIPT = Path(__file__).with_name("filter.js")
SIGNS = {
    ClaimStatus.REPRODUCED: "✓",
    ClaimStatus.DEVIATES: "≠",
    ClaimStatus.NO_DATA: "○",
    ClaimStatus.UNDECIDED: "~",
    ClaimStatus.ERROR: "!",
}
CLASSES = dict(zip(SIGNS, ("reproduced", "deviates", "no-data", "undecided", "error")))
COLUMNS = (  # defined in foundation/columns.yaml
    *("id", "chapter", "location", "statement", "published", "ours", "std", "unit"),
    *("difference", "relative_difference", "status", "reason", "tolerance", "weak"),
)


def refuse_errors(results: Sequence[Result]) -> None:
    """Raise a UserError that lists the claims that could not be compared, with reasons, if there are any."""
    errors = [f"- {r.claim.id}: {r.finding}" for r in results if r.status is ClaimStatus.ERROR]
    if errors:
        count = "1 claim" if len(errors) == 1 else f"{len(errors)} claims"
        raise UserError(f"{count} could not be compared with the thesis:\n" + "\n".join(errors))


def to_table(results: Sequence[Result]) -> pd.DataFrame:
    """Table of the results as text cells (claims.csv)."""

    def exact(value: float) -> str:
        return "" if math.isnan(value) else FLOAT_FORMAT % value

    rows = [
        (
            *(r.claim.id, str(r.claim.chapter), r.claim.location, r.claim.statement),
            *(r.published, r.ours, exact(r.std), r.claim.unit),
            *(exact(r.difference), exact(r.relative_difference), str(r.status)),
            *(r.reason, r.claim.check.text(), r.claim.weak or ""),
        )
        for r in results
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS), dtype=object)


def count_statuses(results: Sequence[Result]) -> dict[ClaimStatus, int]:
    """Count the results of each status."""
    return {status: sum(r.status is status for r in results) for status in ClaimStatus}


def summary_line(results: Sequence[Result]) -> str:
    """Sentence with the number of claims, of each status, and of claims whose agreement is weak evidence."""
    counts = count_statuses(results)
    parts = [
        f"{counts[ClaimStatus.REPRODUCED]} reproduced",
        f"{counts[ClaimStatus.DEVIATES]} deviate{'s' if counts[ClaimStatus.DEVIATES] == 1 else ''}",
        f"{counts[ClaimStatus.NO_DATA]} without data",
    ]
    if counts[ClaimStatus.UNDECIDED]:
        parts.append(f"{counts[ClaimStatus.UNDECIDED]} not decided")
    if counts[ClaimStatus.ERROR]:
        parts.append(f"{counts[ClaimStatus.ERROR]} could not be compared")
    line = f"{len(results)} claim{'' if len(results) == 1 else 's'}: {', '.join(parts)}."
    weak = sum(r.status is ClaimStatus.REPRODUCED and r.claim.weak is not None for r in results)
    if not weak:
        return line
    are = "is" if weak == 1 else "are"
    return f"{line} Of those reproduced, {weak} {are} weak evidence: a wrong result could agree as well."


def decided_line(results: Sequence[Result]) -> str:
    """Sentence with the numbers of the thesis's statements that these results decide and leave open, with reasons."""
    ours = [r for r in results if r.claim.chapter != CUBE]
    counts = count_statuses(ours)
    weak = sum(r.status is ClaimStatus.REPRODUCED and r.claim.weak is not None for r in ours)
    hold, fail = counts[ClaimStatus.REPRODUCED] - weak, counts[ClaimStatus.DEVIATES]
    reasons = {
        "a wrong result could agree as well with": weak,
        "noise hides": counts[ClaimStatus.UNDECIDED],
        "data are missing for": counts[ClaimStatus.NO_DATA],
        "an error stopped": counts[ClaimStatus.ERROR],
    }
    why = ", ".join(f"{reason} {count}" for reason, count in reasons.items() if count)
    line = f"Of {len(ours)} statements of the thesis these results confirm {hold} and contradict {fail}."
    return f"{line} {len(ours) - hold - fail} stay open: {why}." if why else line


def render_page(results: Sequence[Result], scale: str = "") -> str:
    """Render the ledger as one self-contained HTML page; `scale` is shown if given.

    Claims are in the ledger's order by chapter, except that claims whose agreement is weak evidence come last.
    """
    chapters = []
    for chapter in sorted({result.claim.chapter for result in results}):
        group = [result for result in results if result.claim.chapter == chapter]
        look = [result for result in group if result.status in (ClaimStatus.DEVIATES, ClaimStatus.ERROR)]
        rows = [_cells(result) for result in group]
        title = "The measured cube" if chapter == CUBE else f"Chapter {chapter}"
        chapters.append({"title": title, "summary": summary_line(group), "look": look, "rows": rows})
    return page(
        TEMPLATE,
        "Claims ledger: what the thesis states, and what this program finds",
        kind="wide",
        script=SCRIPT.read_text(encoding="utf-8"),
        summary=summary_line(results),
        decided=decided_line(results),
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
    """Row of a claim: numbers with units, their difference, and the reason."""
    claim = result.claim
    unit = "" if claim.unit == "1" else f" {claim.unit}"
    numeric = result.difference == result.difference  # NaN if the claim is not a number
    value, published = result.ours, result.published
    if numeric:
        with_std = f" ± {_shown(result.std, 2)}" if result.std == result.std else ""
        value = f"{_shown(float(value), 4)}{with_std}{unit}"
    if isinstance(claim.check, Within | Interval | Threshold):
        published = published.translate(MINUS) + unit
    reason, weak = result.reason, claim.weak if result.status is ClaimStatus.REPRODUCED else None
    if numeric and result.status is ClaimStatus.DEVIATES:
        reason = claim.note or "reason unknown"  # the difference has its own column
    return {
        "claim": claim,
        "status": result.status,
        "published": published,
        "ours": value or "–",
        "difference": _difference(result, unit) if numeric else "–",
        "reason": reason,
        "weak": weak,
        "says_little": weak is not None,
    }


def _difference(result: Result, unit: str) -> str:
    """Difference of a number, as its check compares; in per cent only for a relative tolerance or a deviation."""
    check, difference = result.claim.check, result.difference
    if isinstance(check, Threshold):
        return f"{_shown(abs(difference))}{unit} {'above' if difference > 0.0 else 'below'} {check.threshold:g}{unit}"
    text = f"{_signed(difference)}{unit}"
    is_relative = check.kind == "rel" or result.status is ClaimStatus.DEVIATES
    if not is_relative or math.isnan(result.relative_difference):
        return text
    return f"{text} ({_signed(100 * result.relative_difference)}\u00a0%)"


def _shown(value: float, digits: int = 3) -> str:
    """Number with few digits, and without an exponent that is hard to read."""
    text = f"{value:.{digits}g}"
    return number(value, digits) if "e" in text else text.translate(MINUS)


def _signed(value: float) -> str:
    return f"{'−' if value < 0.0 else '+'}{_shown(abs(value))}"
