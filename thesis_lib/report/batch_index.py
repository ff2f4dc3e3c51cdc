"""Index of a batch of critiques: batch.csv, batch.json and index.html, which links to each report.

One row per dataset, in the order of the command, without times: a batch that was interrupted and resumed writes the
same bytes.  foundation/columns.yaml explains the columns.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import pandas as pd
from markupsafe import Markup

from thesis_lib.foundation.files import write_json, write_result, write_text
from thesis_lib.foundation.terminal import visible
from thesis_lib.pages import element, page

COLUMNS = (
    *("dataset", "status", "verdict", "effects", "base_law", "final_law"),
    *("n_impacts", "base", "augmented", "noise_floor", "reason", "mechanism", "unit"),
)
INDEX_FILES = ("index.html", "batch.csv", "batch.json")
TEMPLATE = Path(__file__).with_name("batch_index.html")
NO_VERDICT = "too few impacts"
SHOWN = 500  # characters shown of a reason; the log of the dataset contains the full text


def row_of_verdict(name: str, diagnosis: Mapping) -> dict:
    """Return the row of a dataset, from its diagnosis.json."""
    groups = ("/".join([e["name"], *e["indistinguishable_from"]]) for e in diagnosis["effects"])
    base = diagnosis["base_model"]
    row = dict.fromkeys(COLUMNS) | {"dataset": name, "status": "done", "effects": " + ".join(groups)}
    row |= {"base_law": base["name"], "final_law": diagnosis.get("augmented_model", base)["name"]}
    row |= {key: diagnosis.get(key) for key in ("verdict", "n_impacts", "mechanism")}
    return row | {key: diagnosis["error"].get(key) for key in ("base", "augmented", "noise_floor", "unit")}


def row_of_failure(name: str, reason: str) -> dict:
    """Return the row of a dataset without a verdict; the reason becomes one line."""
    text = plain(reason)
    text = text if len(text) <= SHOWN else f"{text[:SHOWN]} …"
    return dict.fromkeys(COLUMNS) | {"dataset": name, "status": "failed", "reason": text}


def plain(text: str) -> str:
    """Return text as one line with unprintable characters made visible, because names and messages are not trusted."""
    return visible(" ".join(text.split()))


def write_index(rows: Sequence[Mapping], out: Path, *, total: int, seed: int, effects: Sequence[str] | None) -> None:
    """Write batch.csv, batch.json and index.html into `out`, from the rows of the finished among `total` datasets."""
    write_result(pd.DataFrame(rows, columns=COLUMNS).astype({"n_impacts": "Int64"}), out / "batch.csv")
    options = {"seed": seed, "switched_on": None if effects is None else list(effects)}
    write_json({"schema": 1, "n_datasets": total, **options, "datasets": list(rows)}, out / "batch.json")
    write_text(_page(rows, total), out / "index.html")


def summary_text(rows: Sequence[Mapping], total: int) -> str:
    """Return a summary such as "100 datasets: 61 effects, 30 adequate, 4 unexplained, 5 failed"."""
    counts = Counter(_word(row) for row in rows)
    counts["not reached"] = total - len(rows)
    order = ("effects", "adequate", "unexplained", NO_VERDICT, "failed", "not reached")
    verdicts = ", ".join(f"{counts[name]} {name}" for name in order if counts[name])
    return f"{total} dataset{'' if total == 1 else 's'}: {verdicts}"


def _word(row: Mapping) -> str:
    """Return the verdict, or the reason why there is none."""
    return row["verdict"] or ("failed" if row["status"] == "failed" else NO_VERDICT)


def _page(rows: Sequence[Mapping], total: int) -> str:
    done = [row for row in rows if row["status"] == "done"]
    named = Counter(group for row in done for group in (row["effects"] or "").split(" + ") if group)
    ranked = sorted(named.items(), key=lambda x: (-x[1], x[0]))
    return page(
        TEMPLATE,
        f"Critique of {total} datasets",
        summary=summary_text(rows, total),
        effects="; ".join(f"{name}: {count}" for name, count in ranked).replace("_", " "),
        drops=[_cells(row, "n_impacts") for row in done if row["mechanism"] is None],
        mechanisms=[_cells(row, "mechanism") for row in done if row["mechanism"] is not None],
        failed=[
            (_link(row["dataset"], f"{row['dataset']}.log"), row["reason"]) for row in rows if row["status"] == "failed"
        ],
    )


def _cells(row: Mapping, what: str) -> tuple[str, ...]:
    """Return the cells of a dataset with a verdict; the first cell links to its report."""
    values = (row[key] for key in (what, "base", "augmented", "noise_floor"))
    numbers = ("" if x is None else f"{x:.3g}" if isinstance(x, float) else str(x) for x in values)
    link = _link(row["dataset"], f"{row['dataset']}/report.html")
    return link, _word(row), row["effects"].replace("_", " "), *numbers


def _link(name: str, path: str) -> Markup:
    return element("link", f"./{quote(path)}", plain(name))  # "./": else a name with a colon is read as a scheme
