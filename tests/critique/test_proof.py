"""The proof: where results lie, that stored ones are kept, and how they are counted."""

import json
from pathlib import Path

import numpy as np
import pytest

from thesis_lib.critique.proof import cases as proof
from thesis_lib.critique.proof.cases import (
    DEVELOPMENT,
    NOTHING,
    SEEDS,
    SOURCES,
    Case,
    is_right,
    make,
    pairs,
    truths,
)
from thesis_lib.critique.proof.sizes import EPSILON, MU, SIZES, find_size, law_size, stored_factor
from thesis_lib.critique.proof.table import confusion
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.rig.hidden_causes import CAUSES

STORED_SIZES = json.loads(SIZES.read_text(encoding="utf-8"))["law"]


def test_every_case_has_a_path_of_its_own():
    cases = [
        Case(source, truth, seed, drops, noise, ratio)
        for source in SOURCES
        for truth in [*truths(source), *pairs(source)]
        for seed in (SEEDS, SEEDS + 1)
        for drops in (50, 150)
        for noise in (1.0, 5.0)
        for ratio in (1.5, 3.0)
    ]
    assert len({case.path for case in cases}) == len(cases)
    assert not any(case.path.is_absolute() for case in cases)
    assert Case("law", "wear", 1003).path == Path("law/wear/ratio3_drops150_noise1/1003.json")
    assert Case("mechanism", NOTHING, 1000, 50, 5.0).path == Path(
        "mechanism/nothing/ratio3_drops50_noise5/1000.json"
    )


def test_the_table_uses_no_seed_of_the_tuning():
    assert SEEDS not in DEVELOPMENT and max(DEVELOPMENT) < SEEDS


def test_truths_and_what_counts_as_right():
    assert truths("law")[0] == truths("mechanism")[0] == NOTHING
    assert set(truths("law")[1:]) == set(EFFECTS)
    assert Case("law", NOTHING, 0).expected == ()
    assert Case("law", "wear", 0).expected == (("wear",),)
    for cause in CAUSES:
        assert set(Case("mechanism", cause, 0).expected[0]) <= set(EFFECTS)


def test_pairs_are_ten_of_known_causes_that_ask_for_different_effects():
    assert len(pairs("mechanism")) == len(pairs("law")) == 10
    for source in SOURCES:
        for truth in pairs(source):
            one, two = Case(source, truth, 0).expected
            assert one and two and not set(one) & set(two)


def test_a_pair_needs_both_in_groups_of_their_own():
    pair = Case("law", "wear+moving_surface", 0)
    assert is_right(pair, [["moving_surface", "sensor_drift"], ["wear"]])
    assert not is_right(pair, [["wear", "moving_surface"]])
    assert not is_right(pair, [["wear"], ["magnus"]]) and not is_right(pair, [])
    single = Case("law", "wear", 0)
    assert is_right(single, [["magnus", "wear"]]) and not is_right(single, [["magnus"], ["wear"]])
    assert not is_right(Case("law", NOTHING, 0), [["wear"]])


def test_the_detection_curve_scales_what_is_hidden():
    sizes = [make(Case("law", "wear", 3, 12, ratio=ratio))[1]["wear.w"] for ratio in (1.5, 3.0, 6.0)]
    null = EFFECTS["wear"].parameters[0].null
    assert np.diff(np.abs(np.array(sizes) - null)).min() > 0
    # misfit and noise add up as squares
    assert (sizes[0] - null) / (sizes[1] - null) == pytest.approx(np.sqrt(1.25 / 8.0))


def test_every_law_has_a_size_within_its_bounds():
    for name, effect in EFFECTS.items():
        size = law_size(name, STORED_SIZES[name])
        for p in effect.parameters:
            assert p.low <= size[p.name] <= p.high
            assert size[p.name] != p.null, name


def test_a_case_is_made_the_same_each_time():
    case = Case("law", "sensor_drift", 3, drops=12)
    (one, true), (two, _) = make(case), make(case)
    assert one.digest() == two.digest()
    assert true == {"mu": MU, "epsilon": EPSILON} | {
        f"sensor_drift.{k}": v for k, v in law_size("sensor_drift", STORED_SIZES["sensor_drift"]).items()
    }
    other, none = make(Case("law", NOTHING, 3, drops=12))
    assert none == {"mu": MU, "epsilon": EPSILON} and other.digest() != one.digest()
    assert make(Case("law", "sensor_drift", 4, drops=12))[0].digest() != one.digest()


def test_a_stored_result_is_not_computed_again(tmp_path, monkeypatch):
    calls = []

    def refuse(dataset, **kwargs):
        calls.append(dataset)
        raise UserError("too few impacts\nmeasure more")

    monkeypatch.setattr(proof, "criticise", refuse)
    case = Case("law", NOTHING, 5, drops=12)
    first = proof.run(case, tmp_path)
    assert first["verdict"] == "refused" and first["why"] == "too few impacts"
    assert json.loads((tmp_path / case.path).read_text()) == first
    written = (tmp_path / case.path).read_bytes()
    assert proof.run(case, tmp_path) == first
    assert len(calls) == 1 and (tmp_path / case.path).read_bytes() == written
    proof.run(Case("law", NOTHING, 6, drops=12), tmp_path)
    assert len(calls) == 2


@pytest.mark.slow
def test_a_hidden_effect_is_found_and_its_result_holds_what_the_table_needs(tmp_path):
    case = Case("law", "wrong_gravity", 2, drops=50)  # a development seed
    result = proof.run(case, tmp_path)
    assert result["verdict"] == "effects" and result["right"]
    assert result["steps"][0][0] == "wrong_gravity"
    p = (
        result["parameters"]["dg"]
        if "dg" in result["parameters"]
        else next(iter(result["parameters"].values()))
    )
    assert abs(p["found"] - p["true"]) < 4.0 * p["std"]
    assert 0.8 < p["std"] / p["fisher"] < 1.5
    assert str(tmp_path) not in (tmp_path / case.path).read_text()
    table = confusion(tmp_path)
    assert len(table) == 1 and table["right"].iloc[0] == 1.0


@pytest.mark.slow
def test_sizes_are_found_again():
    """Of one effect, to a factor of two: the fit has improved since, and finds more of the error without the effect."""
    found = find_size("com_offset", proof.RATIO, 7)
    assert 0.5 < stored_factor("com_offset") / found < 2.0
    assert find_size("com_offset", 1.5, 7) < 0.7 * found
