"""The critique's verdict on a dataset, how often it is right where the truth is known, and how many claims hold."""

from collections.abc import Mapping

from thesis_lib.records.rows import DataFrame, Row, counted, share
from thesis_lib.statistics.wording import interval, listed, side, times

PROVEN = {  # figure and source in summary.csv of the proof: where the effect was hidden
    ("one effect, named alone or in its group, laws injected, 150 drops", "law"): "with its own law injected",
    ("the same, mechanisms, 150 drops", "mechanism + drake"): "with its cause in our own integration or in Drake",
    ("both effects of a pair", "all"): "with two hidden at once, both of them",
}
QUIET = "nothing hidden, verdict adequate, per source"
OUTSIDE = ("outside the library: unexplained", "mechanism + drake")
REPRODUCED, DEVIATES = "reproduced", "deviates"
OTHERS = {"data not present": "without the data", "not decided": "not decided at this scale"}


def verdict(diagnosis: Mapping) -> str:
    """The verdict in the words of every other place, and how the error stands to the noise."""
    if diagnosis["verdict"] is None:
        return " ".join(diagnosis["summary"])
    error = diagnosis["error"]
    now, (low, high), floor = error["augmented"], error["augmented_interval"], error["noise_floor"]
    beside = "and the noise is not known"
    if floor:
        apart = side(low, high, floor, ("apart", "", "apart"))
        beside = f"{times(now / floor)} the noise floor" if apart else "not told apart from the noise floor"
    return " ".join([*diagnosis["headline"], f"The held-out error is {interval(now, low, high, 'm/s')}, {beside}."])


def proof(summary: DataFrame) -> str:
    """Shares of hidden effects named right, of clean data found adequate, and of unknown causes left unexplained."""
    rows = {(row["figure"], row["source"]): row for _, row in summary.iterrows() if row["n"] > 0}
    sentences = []
    named = [f"{_right(rows[key])} {hidden}" for key, hidden in PROVEN.items() if key in rows]
    if named:
        sentences.append(f"A hidden effect is named right in {'; '.join(named)}.")
    quiet = [row for (figure, _), row in rows.items() if figure == QUIET]
    if quiet:
        least = min(quiet, key=lambda row: (row["measured"], row["low"]))
        sentences.append(f"With nothing hidden, no source has fewer than {_right(least)} found adequate.")
    if OUTSIDE in rows:
        sentences.append(f"A cause that the library does not hold is left unexplained in {_right(rows[OUTSIDE])}.")
    return " ".join(sentences) or "No result of the proof is stored."


def _right(row: Row) -> str:
    return f"{share(row, 'measured')} of {counted(row['n'], 'dataset')}"


def counted_claims(table: DataFrame) -> str:
    """Claims by status, and how many of those compared each chapter reproduces."""
    number = {status: int((table["status"] == status).sum()) for status in (REPRODUCED, DEVIATES, *OTHERS)}
    compared = table[table["status"].isin([REPRODUCED, DEVIATES])]
    chapters = [
        f"{int((rows['status'] == REPRODUCED).sum())} of {len(rows)} in chapter {chapter}"
        for chapter, rows in compared.groupby("chapter")
    ]
    parts = [f"{number[REPRODUCED]} reproduced", f"{number[DEVIATES]} deviating"]
    parts += [f"{number[status]} {words}" for status, words in OTHERS.items() if number[status]]
    sentence = f"Of {counted(len(table), 'claim')}: {', '.join(parts)}."
    return sentence + (f" Of those compared, reproduced are {listed(chapters)}." if chapters else "")
