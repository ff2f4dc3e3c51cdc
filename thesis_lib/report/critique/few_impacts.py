"""The page for datasets with too few impacts for a verdict: an estimate of restitution, and its basis."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.drops.few_impacts import FewImpacts
from thesis_lib.critique.results.findings import Findings, with_error
from thesis_lib.critique.results.titles import law_title, symbol
from thesis_lib.report.critique.folder import Contents, critique_page
from thesis_lib.report.critique.tables import comparison_table, left_out_table
from thesis_lib.report.elements import paragraph, sized, table
from thesis_lib.statistics.wording import number

MOST = 60  # impacts in the table of the page


def few_contents(few: FewImpacts, findings: Findings) -> Contents:
    """Return the page for a dataset with too few impacts for a verdict; it has no pictures."""
    d = findings.diagnosis
    of, contents = d["restitution"], _of_impacts(few, d, findings.tables) if few.laws else {}
    contents["What a verdict needs"] = ("next", paragraph(d["next_experiment"]["why"]), left_out_table(d))
    value = "unknown" if of["value"] is None else number(of["value"])
    numbers = [
        ("impacts used", f"{d['n_impacts']}", f"{d['n_trials']} trials"),
        ("restitution", value if of["std"] is None else with_error(of["value"], of["std"]), "one standard error"),
    ]
    word = "No verdict: too few impacts"
    return Contents(critique_page(d, contents, "effect", word=word, kind="none", key_numbers=numbers))


def _of_impacts(few: FewImpacts, d: Mapping, made: Mapping[str, pd.DataFrame]) -> dict[str, Sequence]:
    """Return the sections on impacts, if there is at least one impact."""
    law = d["base_model"]
    rows = [(symbol(name), sized(p)) for name, p in law["parameters"].items()]
    return {
        "Restitution and friction": (
            "numbers",
            paragraph(
                f"{law_title(law['name'])}, fitted to all impacts. Restitution is the mean over impacts and trials; "
                "its interval includes the scatter between them."
            ),
            table("Parameters [95 % interval]", ("parameter", "value"), rows, numeric=(1,)),
        ),
        "Each impact": ("impacts", _each(few)),
        "Comparison of the laws": ("laws", comparison_table(made, few.laws)),
    }


def _each(few: FewImpacts) -> Markup:
    """Return a table with the restitution of each single hit."""
    o, each, fitted = few.observations.single, few.each, few.fitted
    before = fitted.on(o).before
    speed = np.linalg.norm(before.velocity, axis=0)
    rows = [
        (
            f"{o.trial[i]}",
            f"{o.impact[i]}",
            number(float(speed[i])),
            number(epsilon) if np.isnan(std) else with_error(epsilon, std),
        )
        for i, epsilon, std in list(zip(each.rows, each.epsilon, each.std))[:MOST]
    ]
    shown = f" (the first {MOST} of {len(each.rows)})" if len(each.rows) > MOST else ""
    columns = ("trial", "impact", "speed before (m/s)", "restitution")
    return table(
        f"Restitution of each impact ± standard error due to noise alone{shown}", columns, rows, numeric=(2, 3)
    )
