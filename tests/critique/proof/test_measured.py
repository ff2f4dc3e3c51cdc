"""The stored critiques of measured sets: a row each."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from thesis_lib.critique.drops.stand_ins import StandIn
from thesis_lib.foundation.rows import STAMP
from thesis_lib.studies.proof.measured import ROWS, as_markdown, row, store


@pytest.mark.slow
def test_a_row_says_what_the_critique_says(hidden_impacts, tmp_path):
    told = row(hidden_impacts, "all", "searched")
    assert (
        (*told, *STAMP) == ROWS.columns and told["effects"] == "tangential_restitution" and told["verdict"] == "effects"
    )
    assert told["used"] == told["detected"] == 80 and told["error"] < told["base"]
    path = tmp_path / "rows.csv"
    rows = ROWS.at(path)
    store(told, rows)
    store(told | {"verdict": "adequate"}, rows)  # the same key replaces
    store(told | {"hits": "single"}, rows)
    assert list(pd.read_csv(path)["verdict"]) == ["adequate", "effects"]
    for effects in ("time_lag", "wear", "time_lag"):  # another choice by hand is another row
        store(told | {"chosen": "by hand", "effects": effects}, rows)
    assert list(pd.read_csv(path)["effects"]) == ["time_lag", "wear", *[told["effects"]] * 2]
    assert "100 % of 80 | tangential restitution | adequate" in as_markdown(rows).splitlines()[4]


def test_a_stand_in_is_marked(hidden_impacts, tmp_path):
    marked = replace(hidden_impacts)
    marked.__dict__["stand_ins"] = {"tangential_restitution": StandIn("inertia", 9.0, ())}
    told = row(marked, "all", "searched")
    assert told["effects"] == "~tangential_restitution" and told["verdict"] == "unexplained"
    rows = ROWS.at(tmp_path / "rows.csv")
    store(told, rows)
    assert "tangential restitution (a stand-in) | unexplained" in as_markdown(rows)


def test_every_stored_row_has_an_error():
    assert np.isfinite(pd.read_csv(ROWS.path)["error"]).all()
