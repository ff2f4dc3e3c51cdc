"""How many statements of the thesis a run reproduces."""

from typing import TYPE_CHECKING

from thesis_lib.records.record import Job, Record
from thesis_lib.records.rows import counted
from thesis_lib.statistics.wording import listed

if TYPE_CHECKING:
    import pandas as pd

REPRODUCED, DEVIATES, NO_DATA = "reproduced", "deviates", "data not present"


def claims(table: "pd.DataFrame") -> str:
    """Claims by status, and how many of those compared each chapter reproduces."""
    number = {status: int((table["status"] == status).sum()) for status in (REPRODUCED, DEVIATES, NO_DATA)}
    compared = table[table["status"].isin([REPRODUCED, DEVIATES])]
    chapters = [
        f"{int((rows['status'] == REPRODUCED).sum())} of {len(rows)} in chapter {chapter}"
        for chapter, rows in compared.groupby("chapter")
    ]
    sentence = f"Of {counted(len(table), 'claim')}: {number[REPRODUCED]} reproduced, {number[DEVIATES]} deviating"
    sentence += f", {number[NO_DATA]} without the data." if number[NO_DATA] else "."
    return sentence + (f" Of those compared, reproduced are {listed(chapters)}." if chapters else "")


CLAIMS = Record(
    name="claims",
    job=Job("claims", ""),
    title="What the thesis states against what this run finds",
    caption="Number by number and sentence by sentence: reproduced, deviates (by how much, and why if that is "
    "known), or data not present.",
    finding=claims,
    reads=("claims.csv",),
)
