"""Words for the share of correct verdicts of the critique where the truth is known, and for statuses of claims."""

from thesis_lib.thesis.records.rows import DataFrame, Row, counted, share

PROVEN = {  # figure and source in summary.csv of the proof: where the effect was hidden
    ("one effect, named alone or in its group, laws injected, 150 drops", "law"): "with its own law injected",
    ("the same, mechanisms, 150 drops", "mechanism + drake"): "with its cause in our own integration or in Drake",
    ("both effects of a pair", "all"): "with two hidden at once, both of them",
}
QUIET = "nothing hidden, verdict adequate, per source"
OUTSIDE = ("outside the library: unexplained", "mechanism + drake")
OTHERS = {"data not present": "without the data", "not decided": "not decided at this scale"}


def shares_right(summary: DataFrame) -> str:
    """Sentences on shares of hidden effects identified, clean data found adequate, unknown causes left unexplained."""
    rows = {(row["figure"], row["source"]): row for _, row in summary.iterrows() if row["n"] > 0}
    sentences = []
    named = [f"{_right(rows[key])} {hidden}" for key, hidden in PROVEN.items() if key in rows]
    if named:
        sentences.append(f"A hidden effect is named right in {'; '.join(named)}.")
    quiet = [row for (figure, _), row in rows.items() if figure == QUIET]
    if quiet:
        least = min(quiet, key=lambda row: (row["measured"], row["low"]))
        sentences.append(f"With nothing hidden, at least {_right(least)} of each source are found adequate.")
    if OUTSIDE in rows:
        sentences.append(f"A cause that the library does not hold is left unexplained in {_right(rows[OUTSIDE])}.")
    return " ".join(sentences) or "No result of the proof is stored."


def _right(row: Row) -> str:
    return f"{share(row, 'measured')} of {counted(row['n'], 'dataset')}"
