"""The part of report.html that answers which model is right about the object: laws and engines side by side."""

import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.engines.words import bounded_text, model_sentences, row_title
from thesis_lib.critique.results.titles import effect_title
from thesis_lib.report.elements import interval, paragraph, plus_minus, table
from thesis_lib.statistics.wording import listed, number

CAPTION = (
    "Every model fitted to the training trials and judged on the others: held-out error (m/s) with its 95 % interval, "
    "friction and restitution (at 1 m/s) with ± half the 95 % interval, duration of a central contact at 1 m/s. An "
    "engine at its defaults is not fitted: it has the contact that it gives to who asks for none. Below it, the same "
    "with the friction that suits the training trials best"
)


def models(found: pd.DataFrame) -> Markup:
    """What the table says, and the table; `found` is that of `compare_models`."""
    rows = []
    for row in found.to_dict("records"):
        lacks = listed([effect_title(name) for name in str(row["lacks"]).split(" + ")]) if row["lacks"] else ""
        lasting = f"{1e3 * row['contact_time']:.3g} ms" if pd.notna(row["contact_time"]) else "–"
        pairs = [
            bounded_text(row, name, 3) if row[f"{name}_bound"] else plus_minus(row[name], row[f"{name}_std"])
            for name in ("mu", "epsilon")
        ]
        error = (number(row["error"]), interval(row["error_low"], row["error_high"]))
        rows.append((row_title(row), str(row["effects"]), *error, *pairs, lasting, lacks or "–"))
    columns = ("model", "named effects", "error", "95 % interval", "μ", "ε", "contact", "cannot have")
    return paragraph(*model_sentences(found)) + table(CAPTION, columns, rows, numeric=(2, 4, 5, 6))
