"""The result of a claim: its status, our value beside the published one, and the table claims.csv.

| status             | when                                                                                        |
|--------------------|---------------------------------------------------------------------------------------------|
| `reproduced`       | the claim's check holds                                                                     |
| `deviates`         | it does not hold; the result says by how much, and why if the ledger knows                  |
| `data not present` | the run lacked a dataset that the claim needs: neutral                                      |
| `not decided`      | the claim says that this scale is too noisy to tell: compared and shown, neutral            |
| `error`            | nothing was compared, e.g. because a file is missing; `refuse_errors` lists all errors      |

difference = ours − published (threshold checks: ours − threshold); relative_difference = difference / abs(published
or threshold).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import FLOAT_FORMAT
from thesis_lib.ledger.format import Claim


class ClaimStatus(StrEnum):
    """Outcome of a claim (table in the module's head)."""

    REPRODUCED = "reproduced"
    DEVIATES = "deviates"
    NO_DATA = "data not present"
    UNDECIDED = "not decided"
    ERROR = "error"


@dataclass(frozen=True)
class Result:
    """One claim and what this run found.

    published, ours: as shown, '' if there is none.  std: our standard error.  Numbers are NaN where they have no
    meaning.  finding: the measurement, or what went wrong, in words.
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
        """Why the claim is not reproduced; '' if it is."""
        if self.status is ClaimStatus.REPRODUCED:
            return ""
        if self.status is ClaimStatus.DEVIATES:
            return f"{self.finding}; {self.claim.note or 'reason unknown'}"
        return self.finding


COLUMNS = (  # explained in foundation/columns.yaml
    *("id", "chapter", "location", "statement", "published", "ours", "std", "unit"),
    *("difference", "relative_difference", "status", "reason", "tolerance", "weak"),
)


def refuse_errors(results: Sequence[Result]) -> None:
    """Raise a UserError that lists the claims that could not be compared, and why."""
    errors = [f"- {r.claim.id}: {r.finding}" for r in results if r.status is ClaimStatus.ERROR]
    if errors:
        count = "1 claim" if len(errors) == 1 else f"{len(errors)} claims"
        raise UserError(f"{count} could not be compared with the thesis:\n" + "\n".join(errors))


def to_table(results: Sequence[Result]) -> pd.DataFrame:
    """The results as text cells (claims.csv)."""

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
    """How many results have each status."""
    return {status: sum(r.status is status for r in results) for status in ClaimStatus}


def summary_line(results: Sequence[Result]) -> str:
    """The number of claims, how many have each status, and how many agree where a wrong result could."""
    counts = count_statuses(results)
    parts = [
        f"{counts[ClaimStatus.REPRODUCED]} reproduced",
        f"{counts[ClaimStatus.DEVIATES]} deviate{'s' if counts[ClaimStatus.DEVIATES] == 1 else ''}",
        f"{counts[ClaimStatus.NO_DATA]} without data",
    ]
    if counts[ClaimStatus.UNDECIDED]:
        parts.append(f"{counts[ClaimStatus.UNDECIDED]} not decided at this scale")
    if counts[ClaimStatus.ERROR]:
        parts.append(f"{counts[ClaimStatus.ERROR]} could not be compared")
    line = f"{len(results)} claim{'' if len(results) == 1 else 's'}: {', '.join(parts)}."
    weak = sum(r.status is ClaimStatus.REPRODUCED and r.claim.weak is not None for r in results)
    say = "says" if weak == 1 else "say"
    return f"{line} Of those reproduced {weak} {say} little: a wrong result could agree as well." if weak else line
