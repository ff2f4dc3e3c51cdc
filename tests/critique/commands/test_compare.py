"""Two critiques side by side: like is compared with like, and what cannot be compared is said."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.commands.comparison import ALONE, compare, comparison_text, is_run, read_run
from thesis_lib.foundation.errors import UserError


def parameter(value: float, std: float = 0.01, unit: str = "1") -> dict:
    return {"value": value, "std": std, "unit": unit}


def run(law: str, mu: float, effects: tuple[str, ...] = ()) -> dict:
    own = {"mu": parameter(mu), "epsilon": parameter(0.6)}
    return {
        "schema": 1,
        "verdict": "effects" if effects else "adequate",
        "base_model": {"name": law, "parameters": own},
        "augmented_model": {"name": law, "parameters": own},
        "effects": [{"name": name, "parameters": {"phi": parameter(0.05, unit="rad")}} for name in effects],
        "error": {"base": 0.03, "augmented": 0.01, "noise_floor": 0.01, "irb_bound": 0.005},
        "laws": {
            name: {"parameters": {"mu": parameter(more + mu), "epsilon": parameter(0.6)}, "error": error, "unit": "m/s"}
            for name, more, error in (("mirtich", 0.15, 0.03), ("whittaker", 0.25, 0.04))
        },
    }


def rows(a: dict, b: dict) -> pd.DataFrame:
    return compare(a, b).set_index("quantity")


def test_runs_of_one_law_without_effects_need_no_further_rows():
    a, b = run("mirtich", 0.1), run("mirtich", 0.2)
    table = rows(a, b)
    assert table.loc["mu", "sigmas"] == pytest.approx(0.1 / np.hypot(0.01, 0.01))
    assert not table.index.str.contains(ALONE, regex=False).any()
    text = comparison_text(compare(a, b), "before", "after")
    assert "Different by more than 3 standard errors: mu." in text and "differ:" not in text


def test_friction_of_different_laws_is_not_compared_but_that_of_each_law_is():
    a, b = run("mirtich", 0.1), run("whittaker", 0.3)
    tilted, other = run("mirtich", 0.1, ("surface_tilt",)), run("mirtich", 0.3, ("surface_tilt",))
    other["augmented_model"] = {**other["augmented_model"], "name": "whittaker"}
    for one, two in ((a, b), (tilted, other)):
        table = rows(one, two)
        assert pd.isna(table.loc["mu", "sigmas"]) and pd.isna(table.loc["mu", "difference"])
        for law in ("mirtich", "whittaker")[: 2 if one is a else 1]:
            assert table.loc[f"{law}{ALONE}, mu", "difference"] == pytest.approx(0.2)
            assert table.loc[f"{law}{ALONE}, mu", "sigmas"] == pytest.approx(0.2 / np.hypot(0.01, 0.01))
            assert table.loc[f"{law}{ALONE}, error", "difference"] == 0.0
    text = comparison_text(compare(a, b), "before", "after")
    assert "The base laws differ: before has mirtich, after has whittaker." in text
    assert "Different by more than 3 standard errors: mirtich alone, mu; whittaker alone, mu." in text
    text = comparison_text(compare(tilted, other), "before", "after")
    assert "With the effects the laws differ: before has mirtich, after has whittaker." in text


def test_effects_that_come_or_go_are_said_and_the_law_is_compared_without_them():
    a, b = run("mirtich", 0.1, ("surface_tilt",)), run("mirtich", 0.1)
    table = rows(a, b)
    assert table.loc["surface_tilt.phi", "unit"] == "rad" and pd.isna(table.loc["surface_tilt.phi", "b"])
    assert f"mirtich{ALONE}, epsilon" in table.index and f"whittaker{ALONE}, epsilon" not in table.index
    text = comparison_text(compare(a, b), "before", "after")
    assert "The effects differ: before has surface_tilt, after has none." in text
    assert "No error and no common parameter differs by more than 3 standard errors." in text


def test_an_effect_means_the_same_under_any_law_and_in_any_order():
    a, b = run("mirtich", 0.1, ("surface_tilt",)), run("whittaker", 0.1, ("surface_tilt",))
    b["effects"][0]["parameters"]["phi"]["value"] = 0.25
    assert rows(a, b).loc["surface_tilt.phi", "sigmas"] == pytest.approx(0.2 / np.hypot(0.01, 0.01))
    a, b = run("mirtich", 0.1, ("x", "y")), run("mirtich", 0.1, ("y", "x"))
    assert "differ:" not in comparison_text(compare(a, b), "a", "b")


def test_runs_without_errors_of_each_law_are_compared_as_far_as_they_go():
    """Critiques of mechanisms are such, as there is one law of their forces; no rows are said to be missing."""
    a, b = run("mirtich", 0.1, ("surface_tilt",)), run("whittaker", 0.1)
    del a["laws"], b["laws"]
    text = comparison_text(compare(a, b), "before", "after")
    assert "effects differ: before has surface_tilt" in text and "laws mean different things." in text
    assert ALONE not in text and "No error and no parameter can be compared." in text


def test_errors_are_compared_in_standard_errors_of_their_intervals():
    a, b = run("mirtich", 0.1), run("mirtich", 0.1)
    a["error"] |= {"base_interval": [0.028, 0.032], "augmented_interval": [0.008, 0.012]}
    b["error"] |= {"base": 0.05, "base_interval": [0.046, 0.054], "augmented_interval": [0.008, 0.012]}
    table = rows(a, b)
    row = table.loc["error, base"]
    assert (row["a_low"], row["a_high"], row["b_low"]) == pytest.approx((0.028, 0.032, 0.046))
    assert row["sigmas"] == pytest.approx(0.02 / (np.hypot(0.002, 0.004) / 1.959964))
    assert pd.isna(table.loc["error, noise floor", "sigmas"])
    text = comparison_text(compare(a, b), "before", "after")
    assert "0.03 [0.028, 0.032]" in text and "standard errors: error, base." in text


def test_an_unfinished_run_is_recognised(tmp_path):
    for name in ("where.json", "comparison.csv", "ladder.csv"):
        (tmp_path / name).write_text("{}")
    assert is_run(tmp_path)
    with pytest.raises(UserError, match="unfinished run"):
        read_run(tmp_path)
    (tmp_path / "dataset.yaml").write_text("")
    assert not is_run(tmp_path)
