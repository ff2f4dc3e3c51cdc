"""Index of a batch of critiques: batch.csv, batch.json and index.html, which links to each report.

One row a dataset, in the order given, with no times: a batch that was interrupted and went on writes the same bytes.

| column              | meaning                                                                             |
|---------------------|-------------------------------------------------------------------------------------|
| dataset             | its name, that of its folder here                                                   |
| status              | done or failed                                                                      |
| verdict             | adequate, effects or unexplained                                                    |
| effects             | effects named, joined by +; those that the data cannot tell apart joined by /       |
| base_law, final_law | law alone, and law with the effects                                                 |
| n_impacts           | impacts used                                                                        |
| base, augmented     | held-out error of the law alone and with the effects, m/s                           |
| noise_floor         | the error that a perfect model would show, m/s; empty where the noise is unknown    |
| reason              | why a dataset failed                                                                |
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from urllib.parse import quote

import pandas as pd

from thesis_lib.foundation.files import write_json, write_result, write_text
from thesis_lib.foundation.terminal import visible
from thesis_lib.pages import page, table

COLUMNS = (
    *("dataset", "status", "verdict", "effects", "base_law", "final_law"),
    *("n_impacts", "base", "augmented", "noise_floor", "reason"),
)
INDEX_FILES = ("index.html", "batch.csv", "batch.json")
SHOWN = 500  # characters of a reason; the dataset's log has all of it


def row_of_verdict(name: str, diagnosis: Mapping) -> dict:
    """The row of a dataset from its diagnosis.json."""
    error = diagnosis["error"]
    groups = ("/".join([e["name"], *e["indistinguishable_from"]]) for e in diagnosis["effects"])
    return dict.fromkeys(COLUMNS) | {
        "dataset": name,
        "status": "done",
        "verdict": diagnosis["verdict"],
        "effects": " + ".join(groups),
        "base_law": diagnosis["base_model"]["name"],
        "final_law": diagnosis.get("augmented_model", diagnosis["base_model"])["name"],
        "n_impacts": diagnosis["n_impacts"],
        **{key: error.get(key) for key in ("base", "augmented", "noise_floor")},
    }


def row_of_failure(name: str, reason: str) -> dict:
    """The row of a dataset without a verdict; the reason becomes one line."""
    text = plain(reason)
    text = text if len(text) <= SHOWN else f"{text[:SHOWN]} …"
    return dict.fromkeys(COLUMNS) | {"dataset": name, "status": "failed", "reason": text}


def plain(text: str) -> str:
    """Text on one line; what is not printable becomes visible, as names and messages may hold a stranger's words."""
    return visible(" ".join(text.split()))


def write_index(
    rows: Sequence[Mapping], out: Path, *, total: int, seed: int, effects: Sequence[str] | None
) -> None:
    """Write batch.csv, batch.json and index.html into `out`.

    Args:
        rows: of the datasets that ended; total: datasets of the batch.
        seed, effects: what the critiques were told.
    """
    write_result(pd.DataFrame(rows, columns=COLUMNS).astype({"n_impacts": "Int64"}), out / "batch.csv")
    told = {"seed": seed, "switched_on": None if effects is None else list(effects)}
    write_json({"schema": 1, "n_datasets": total, **told, "datasets": list(rows)}, out / "batch.json")
    write_text(_page(rows, total), out / "index.html")


def summary_text(rows: Sequence[Mapping], total: int) -> str:
    """100 datasets: 61 effects, 30 adequate, 4 unexplained, 5 failed."""
    counts = Counter(row["verdict"] or "failed" for row in rows)
    counts["not reached"] = total - len(rows)
    order = ("effects", "adequate", "unexplained", "failed", "not reached")
    told = ", ".join(f"{counts[name]} {name}" for name in order if counts[name])
    return f"{total} dataset{'' if total == 1 else 's'}: {told}"


def _page(rows: Sequence[Mapping], total: int) -> str:
    done = [row for row in rows if row["status"] == "done"]
    failed = [row for row in rows if row["status"] == "failed"]
    named = Counter(group for row in done for group in (row["effects"] or "").split(" + ") if group)
    effects = "; ".join(
        f"{name}: {count}" for name, count in sorted(named.items(), key=lambda x: (-x[1], x[0]))
    )
    verdicts = table(
        "Verdicts; held-out errors of the law alone and with the effects, against noise, in m/s",
        ("dataset", "verdict", "effects", "impacts", "law alone", "with effects", "noise floor"),
        [
            [
                _link(row["dataset"], f"{row['dataset']}/report.html"),
                escape(row["verdict"]),
                escape(row["effects"].replace("_", " ")),
                *(_cell(row[key]) for key in ("n_impacts", "base", "augmented", "noise_floor")),
            ]
            for row in done
        ],
        numeric=range(3, 7),
    )
    failures = table(
        "Datasets without a verdict; each links to its log",
        ("dataset", "reason"),
        [[_link(row["dataset"], f"{row['dataset']}.log"), escape(row["reason"])] for row in failed],
    )
    content = "\n".join(
        [
            f'<p class="summary">{escape(summary_text(rows, total))}.</p>',
            f"<p>Effects named: {escape(effects.replace('_', ' '))}.</p>" if effects else "",
            failures,
            verdicts,
        ]
    )
    return page(f"Critique of {total} datasets", content)


def _link(name: str, path: str) -> str:
    # "./": a name with a colon would read as a scheme
    return f'<a href="./{escape(quote(path))}">{escape(plain(name))}</a>'


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)
