"""The proof: its cases, what counts as right, and the sizes of what is hidden."""

import json

import numpy as np
import pytest
from stored_proof import OUTSIDE

from thesis_lib.critique.proof.cases import DEVELOPMENT, NOTHING, RATIO, SEEDS, SOURCES, Case, make, pairs, truths
from thesis_lib.critique.proof.compute import compute
from thesis_lib.critique.proof.results import confusion, is_right
from thesis_lib.critique.proof.sizes import EPSILON, MU, SIZES, find_size, law_size, stored_factor
from thesis_lib.critique.proof.store import put_row, read_rows
from thesis_lib.effects import EFFECTS
from thesis_lib.simulate.rig.hidden_causes import CAUSES

STORED_SIZES = json.loads(SIZES.read_text(encoding="utf-8"))["law"]


def test_the_table_uses_no_seed_of_the_tuning():
    assert SEEDS not in DEVELOPMENT and max(DEVELOPMENT) < SEEDS


def test_truths_and_the_effects_that_describe_them():
    assert truths("law")[0] == truths("mechanism")[0] == NOTHING
    assert set(truths("law")[1:]) == {name for name, effect in EFFECTS.items() if not effect.needs_contact_time}
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


def test_what_is_right():
    pair = Case("law", "wear+moving_surface", 0)
    assert is_right(pair, "effects", [["moving_surface", "sensor_drift"], ["wear"]])
    assert not is_right(pair, "effects", [["wear", "moving_surface"]])
    assert not is_right(pair, "effects", [["wear"], ["magnus"]]) and not is_right(pair, "adequate", [])
    single = Case("law", "wear", 0)
    assert is_right(single, "effects", [["magnus", "wear"]])
    assert not is_right(single, "effects", [["magnus"], ["wear"]])
    assert not is_right(single, "effects", [["wear", *list(EFFECTS)[:3]]])  # a group of four
    assert is_right(Case("law", NOTHING, 0), "adequate", [])
    assert not is_right(Case("law", NOTHING, 0), "effects", [["wear"]])
    outside = Case("mechanism", OUTSIDE, 0)
    assert is_right(outside, "unexplained", [["wear"]]) and not is_right(outside, "effects", [["wear"]])
    assert [case.kind for case in (pair, single, outside)] == ["pair", "single", "outside"]


def test_the_detection_curve_scales_what_is_hidden():
    sizes = [make(Case("law", "wear", 3, 12, ratio=ratio))[1]["wear.w"] for ratio in (1.5, 3.0, 6.0)]
    null = EFFECTS["wear"].parameters[0].null
    assert np.diff(np.abs(np.array(sizes) - null)).min() > 0
    # misfit and noise add up as squares
    assert (sizes[0] - null) / (sizes[1] - null) == pytest.approx(np.sqrt(1.25 / 8.0))


def test_every_law_has_a_size_within_its_bounds():
    for name in truths("law")[1:]:
        size = law_size(name, STORED_SIZES[name])
        for p in EFFECTS[name].parameters:
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


@pytest.mark.slow
def test_a_hidden_effect_is_found_and_its_row_holds_what_the_table_needs(tmp_path):
    row = compute(Case("law", "wrong_gravity", 2, drops=50))  # a development seed
    assert is_right(row.case, row.verdict, row.groups) and row.groups[0][0] == "wrong_gravity"
    (p,) = row.parameters.values()
    assert abs(p.found - p.true) < 4.0 * p.std
    assert 0.8 < p.std / p.fisher < 1.5
    put_row(row, tmp_path)
    assert read_rows("law", tmp_path) == {row.case: row}
    table = confusion(tmp_path)
    assert len(table) == 1 and table["right"].iloc[0] == 1.0


@pytest.mark.slow
def test_sizes_are_found_again():
    """Of one effect, to a factor of two: the fit has improved since, and finds more of the error without the effect."""
    found = find_size("com_offset", RATIO, 7)
    assert 0.5 < stored_factor("com_offset") / found < 2.0
    assert find_size("com_offset", 1.5, 7) < 0.7 * found
