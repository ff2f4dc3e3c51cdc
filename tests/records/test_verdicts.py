"""What is said of a critique, of its proof and of the claims: the words follow verdict and numbers."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.results.summary import headline
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
    return records()["verdict"].said({**content, "headline": headline(content)})


def effect(name: str, family: str = "contact", clears: bool = True, others: tuple[str, ...] = ()) -> dict:
    same = {"indistinguishable_from": list(others), "stand_in": None, "parameters": {}, "material_in": ["impact"]}
    return {"name": name, "family": family, "clears": clears} | same


def test_missing_effect_and_the_fall_of_the_error_to_the_noise() -> None:
    said = verdict(diagnosis("effects", [effect("rounded_corners")]))
    assert said.startswith(
        "Mirtich leaves out: rounded corners; with it the held-out error falls from 0.5 m/s to 0.1 m/s"
    )
    assert "The held-out error is 0.10 (0.05 to 0.15)" in said
    assert said.endswith("m/s, not told apart from the noise floor.")


@pytest.mark.parametrize("law", BASES)
def test_every_law_that_a_critique_may_end_with_has_its_title(law: str) -> None:
    content = diagnosis("adequate", []) | {"base_model": {"name": law}, "augmented_model": {"name": law}}
    title = BASES[law].title
    assert verdict(content).startswith(f"{title[0].upper()}{title[1:]} is adequate")


def test_error_that_does_not_fall_and_stays_above_the_noise() -> None:
    said = verdict(diagnosis("unexplained", [effect("rounded_corners")], augmented=0.4))
    assert said.startswith(
        "Mirtich misses something that no effect in the library explains beyond rounded corners; with"
    )
    assert said.endswith("4.00 times the noise floor.")


def test_a_fault_of_the_measurement_is_not_physics() -> None:
    said = verdict(diagnosis("effects", [effect("angle_offset", "measurement")], floor=None))
    assert said.startswith("The measurements look faulty: angle offset; correct the camera or its calibration")
    assert "With this put right, Mirtich is enough" in said
    assert "the noise is not known" in said


def test_what_was_chosen_by_hand_is_not_found() -> None:
    alone = verdict(diagnosis("adequate", []))
    assert "adequate: no effect in the library lowers its held-out error" in alone
    by_hand = verdict(diagnosis("adequate", [effect("rounded_corners", clears=False)]))
    assert "adequate as far as was tested" in by_hand
    assert "rounded corners" not in by_hand


def test_many_impacts_left_out_are_told_and_doubt_is_kept() -> None:
    content = diagnosis("effects", [effect("rounded_corners", others=("wrong_size",))])
    content["left_out"]["share"] = 0.75
    said = verdict(content)
    assert "rounded corners (or wrong size, which these data cannot tell apart)" in said
    assert said.startswith("75 % of the detected impacts were left out (30 × second hit")


def summary(rows: dict[tuple[str, str], tuple[float, int]]) -> pd.DataFrame:
    table = [(*key, value, value - 0.05, value + 0.05, n) for key, (value, n) in rows.items()]
    return pd.DataFrame(table, columns=["figure", "source", "measured", "low", "high", "n"])


def test_proof_tells_the_worst_source_and_leaves_out_what_was_not_run() -> None:
    law, mechanisms, pair = PROVEN
    said = records()["proof"].said(
        summary(
            {
                law: (0.9, 280),
                mechanisms: (0.8, 490),
                pair: (float("nan"), 0),
                (QUIET, "law"): (0.95, 200),
                (QUIET, "drake"): (0.7, 100),
                OUTSIDE: (0.6, 60),
            }
        )
    )
    assert "90 (85 to 95)\N{NO-BREAK SPACE}% of 280 datasets with its own law" in said
    assert "both of them" not in said
    assert "no source has fewer than 70 (65 to 75)\N{NO-BREAK SPACE}% of 100 datasets" in said
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
    assert records()["claims"].said(table) == (
        "Of 4 claims: 2 reproduced, 1 deviating, 1 without the data. Of those compared, reproduced are 1 of 2 in "
        "chapter 2 and 1 of 1 in chapter 3."
    )
    assert "without" not in records()["claims"].said(table.head(3))


def test_a_finding_reads_json_and_names_the_file_that_lacks_something(tmp_path: Path) -> None:
    write_json({"verdict": "adequate"}, tmp_path / "diagnosis.json")
    plain = replace(records()["verdict"], finding="{{ diagnosis.verdict }}")
    assert plain.found(tmp_path) == "adequate"
    with pytest.raises(UserError, match=r"diagnosis\.json lack .*'error'"):
        records()["verdict"].found(tmp_path)
