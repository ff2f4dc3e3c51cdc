"""How many statements of the thesis a run reproduces."""

from typing import TYPE_CHECKING

from thesis_lib.findings.finding import Finding
from thesis_lib.findings.rows import counted
from thesis_lib.findings.wording import listing

if TYPE_CHECKING:
    import pandas as pd

REPRODUCED, DEVIATES, NO_DATA = "reproduced", "deviates", "data not present"


def claims(table: "pd.DataFrame") -> str:
    """Claims by status, and of those compared how many each chapter reproduces."""
    number = {status: int((table["status"] == status).sum()) for status in (REPRODUCED, DEVIATES, NO_DATA)}
    compared = table[table["status"].isin([REPRODUCED, DEVIATES])]
    chapters = [
        f"{int((own['status'] == REPRODUCED).sum())} of {len(own)} in chapter {chapter}"
        for chapter, own in compared.groupby("chapter")
    ]
    told = f"Of {counted(len(table), 'claim')}: {number[REPRODUCED]} reproduced, {number[DEVIATES]} deviating"
    told += f", {number[NO_DATA]} without the data." if number[NO_DATA] else "."
    return told + (f" Of those compared, reproduced are {listing(chapters)}." if chapters else "")


FINDINGS = {"claims": Finding(("claims.csv",), claims)}
