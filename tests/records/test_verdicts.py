"""What is said of a critique, of its proof and of the claims: the words follow verdict and numbers."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from finding_of import finding

from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.results.summary import headline
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_json
from thesis_lib.thesis.records.catalogue import records
from thesis_lib.thesis.records.verdicts import OUTSIDE, PROVEN, QUIET


def diagnosis(name: str, effects: list[dict], augmented: float = 0.1, floor: float | None = 0.1) -> dict:
    return {
        "verdict": name,
        "base_model": {"name": "mirtich"},
        "augmented_model": {"name": "mirtich"},
        "effects": effects,
        "left_out": {"share": 0.1, "reasons": {"second_hit": 30}},
        "remaining": {"structured": name == "unexplained", "channels": [], "restitution": None, "depends_on": []},
        "next_experiment": {"states": []},
        "search": {"limit": None, "value": None, "tried": True},
        "error": {
            "worst": [],
            "base": 0.5,
            "base_interval": [0.4, 0.6],
            "augmented": augmented,
            "augmented_interval": [augmented - 0.05, augmented + 0.05],
            "noise_floor": floor,
        },
    }


def verdict(content: dict) -> str:
    """What the record says of a diagnosis."""
    return finding("verdict", {**content, "headline": headline(content, SearchSettings())})


def effect(name: str) -> dict:
    same = {"indistinguishable_from": [], "stand_in": None, "parameters": {}, "material_in": ["impact"]}
    return {"name": name, "family": "contact", "clears": True} | same


@pytest.mark.parametrize(
    ("name", "augmented", "floor", "end"),
    [
        ("effects", 0.1, 0.1, "The held-out error is 0.10 (0.05 to 0.15) m/s, indistinguishable from the noise floor."),
        ("unexplained", 0.4, 0.1, "4.00 times the noise floor."),
        ("effects", 0.1, None, "and the noise is not known."),
    ],
)
def test_a_verdict_is_its_headline_and_what_is_left_of_the_error(name, augmented, floor, end) -> None:
    content = diagnosis(name, [effect("rounded_corners")], augmented, floor)
    said = verdict(content)
    assert said.startswith(" ".join(headline(content, SearchSettings()))) and said.endswith(end)


@pytest.mark.parametrize("law", BASES)
def test_every_law_that_a_critique_may_end_with_has_its_title(law: str) -> None:
    content = diagnosis("adequate", []) | {"base_model": {"name": law}, "augmented_model": {"name": law}}
    title = BASES[law].title
    assert verdict(content).startswith(f"{title[0].upper()}{title[1:]} is adequate")


def summary(rows: dict[tuple[str, str], tuple[float, int]]) -> pd.DataFrame:
    table = [(*key, value, value - 0.05, value + 0.05, n) for key, (value, n) in rows.items()]
    return pd.DataFrame(table, columns=["figure", "source", "measured", "low", "high", "n"])


def test_proof_tells_the_worst_source_and_leaves_out_what_was_not_run() -> None:
    law, mechanisms, pair = PROVEN
    said = finding(
        "proof",
        summary(
            {
                law: (0.9, 280),
                mechanisms: (0.8, 490),
                pair: (float("nan"), 0),
                (QUIET, "law"): (0.95, 200),
                (QUIET, "drake"): (0.7, 100),
                OUTSIDE: (0.6, 60),
            }
        ),
    )
    assert "90 (85 to 95) % of 280 datasets with its own law" in said
    assert "both of them" not in said
    assert "at least 70 (65 to 75) % of 100 datasets of each source" in said
    assert "left unexplained in 60" in said


def test_the_proof_writes_the_rows_that_are_read() -> None:
    from thesis_lib.studies.proof.cases import RIGID
    from thesis_lib.studies.proof.summary import TARGETS

    written = {
        (target.figure, "all" if group == RIGID else " + ".join(group)) for target in TARGETS for group in target.groups
    }
    assert {*PROVEN, OUTSIDE, (QUIET, "law")} <= written


def test_claims_are_counted_and_compared_by_chapter() -> None:
    table = pd.DataFrame(
        {"chapter": [2, 2, 3, 3], "status": ["reproduced", "deviates", "reproduced", "data not present"]}
    )
    assert finding("claims", table) == (
        "Of 4 claims: 2 reproduced, 1 deviating, 1 without the data. Of those compared, 1 of 2 in "
        "chapter 2 and 1 of 1 in chapter 3 are reproduced."
    )
    assert "without" not in finding("claims", table.head(3))


def test_a_finding_reads_json_and_names_the_file_that_lacks_something(tmp_path: Path) -> None:
    write_json({"verdict": "adequate"}, tmp_path / "diagnosis.json")
    plain = replace(records()["verdict"], finding="{{ diagnosis.verdict }}")
    assert plain.found(tmp_path) == "adequate"
    with pytest.raises(UserError, match=r"diagnosis\.json lack .*'error'"):
        records()["verdict"].found(tmp_path)
