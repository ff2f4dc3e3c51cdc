"""The headline of the proof: right verdicts by the world that made the drops, all by one state of the code.

Rows are those of `plan.headline`, whose seeds no earlier table has; with how old each table of the proof is.
"""

from collections import Counter
from pathlib import Path

import pandas as pd

from thesis_lib.critique.proof.cases import FRESH, NOTHING
from thesis_lib.critique.proof.plan import WORLDS, headline
from thesis_lib.critique.proof.results import of_table, outcomes, recovered
from thesis_lib.critique.proof.store import STORE, read_rows
from thesis_lib.foundation.markdown import table as markdown
from thesis_lib.foundation.rows import STAMP
from thesis_lib.statistics.intervals import wilson
from thesis_lib.statistics.wording import count

# heads of the columns, and the kind of datasets whose verdicts are counted
FIGURES = {
    "nothing hidden: `adequate`": NOTHING,
    "one cause, named alone": "single",
    "both of a pair, and nothing else": "pair",
    "outside the library: `unexplained`": "outside",
}
WRONG = "a wrong effect named"
COVERED = "parameter in its 95 % interval"
UNKNOWN = "not recorded"


def counts(store: Path = STORE) -> pd.DataFrame:
    """A row for each figure and world, and for all of them: figure, world, hits, n, low, high (95 %, Wilson)."""
    found, parameters = (_of_headline(table) for table in (outcomes(store), recovered(store)))
    columns = [(name, found[found["kind"] == kind], "right") for name, kind in FIGURES.items()]
    columns += [(WRONG, found.assign(wrong=found["wrong_names"] > 0), "wrong"), (COVERED, parameters, "inside")]
    rows = []
    for figure, table, measure in columns:
        for world, sources in [*WORLDS.items(), ("all", [source for of in WORLDS.values() for source in of])]:
            part = table[table["source"].isin(sources)]
            hits, n = int(part[measure].sum()), len(part)
            low, high = wilson(hits, n) if n else (float("nan"),) * 2
            rows.append({"figure": figure, "world": world, "hits": hits, "n": n, "low": low, "high": high})
    return pd.DataFrame(rows)


def _of_headline(table: pd.DataFrame) -> pd.DataFrame:
    """Those rows of `outcomes` or `recovered` that the headline counts."""
    return of_table(table[table["seed"] >= FRESH])


def as_markdown(store: Path = STORE) -> str:
    """The table of a page, and which code made its rows."""
    planned = headline()
    rows = [read_rows(source, store) for source in dict.fromkeys(case.source for case in planned)]
    made = [of[case] for case in planned for of in rows if case in of]
    if not made:
        return f"None of the {len(planned)} datasets is computed yet: `python -m thesis_lib.critique.proof run-table`."
    table = counts(store)
    worlds = list(dict.fromkeys(table["world"]))
    lines = [
        (str(figure), *(count(row["hits"], row["n"]) if row["n"] else "" for row in part.to_dict("records")))
        for figure, part in table.groupby("figure", sort=False)
    ]
    by = Counter(row.code for row in made)
    codes = ", ".join(f"{n} by `{code or UNKNOWN}`" for code, n in by.most_common())
    days = sorted({row.made for row in made})
    span = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    made_by = f"{len(made)} of {len(planned)} planned datasets, made on {span}: {codes}."
    return f"{markdown(('', *worlds), lines)}\n\n{made_by}"


def ages_as_markdown(store: Path = STORE) -> str:
    """How old each stored table of the proof is: its rows, when they were made, and whether they name their code."""
    lines = []
    for path in sorted(Path(store).glob("*.csv")):
        code, made = pd.read_csv(path, usecols=list(STAMP), keep_default_na=False)[list(STAMP)].to_numpy().T
        days = ", ".join(f"{day} ({n})" for day, n in sorted(Counter(made).items()))
        lines.append((f"`{path.stem}`", str(len(code)), days, str(sum(map(bool, code)))))
    return markdown(("table", "rows", "made", "rows that name the code that made them"), lines)
