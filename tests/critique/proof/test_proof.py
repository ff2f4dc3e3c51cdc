"""The proof: its cases, what counts as right, and the sizes of what is hidden."""

import itertools
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from stored_proof import OUTSIDE, many, put

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.mechanics.space import PLANE
from thesis_lib.simulate.rig.hidden_causes import CAUSES
from thesis_lib.studies.proof import find_size as finder
from thesis_lib.studies.proof import sizes
from thesis_lib.studies.proof.by_contact import accuracy, as_markdown, by_contact
from thesis_lib.studies.proof.cases import (
    BODIES,
    CORNERED,
    FRESH,
    RATIO,
    SEEDS,
    SOURCES,
    Case,
    make,
    pairs,
    simulate,
    truths,
)
from thesis_lib.studies.proof.compute import compute, is_of_today, numbers_of_row, read_rows, run, table_of
from thesis_lib.studies.proof.find_size import find_size
from thesis_lib.studies.proof.headline import PLANNED, TIMES, WORLDS, planned
from thesis_lib.studies.proof.results import confusion, is_right, outcomes, recovered, usual, wrong_names
from thesis_lib.studies.proof.sizes import EPSILON, MU, SIZES, law_size, stored_factor
from thesis_lib.studies.proof.store import NOTHING, groups_of, numbers_in

ROOT = Path(__file__).resolve().parents[3]
STORED_SIZES = json.loads(SIZES.read_text(encoding="utf-8"))["law"]


def test_truths_and_the_effects_that_describe_them():
    assert truths("law")[0] == truths("mechanism")[0] == NOTHING
    lasting = {name for name, effect in effects_in(PLANE).items() if effect.needs_contact_time}
    # no law makes those, nor slides
    assert set(truths("law")[1:]) == set(effects_in(PLANE)) - lasting - {"sliding_friction"}
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


OWN = "velocity_dependent_restitution"  # Drake's own contact loses more at higher speed; a pad does not


@pytest.mark.parametrize(
    ("source", "truth", "verdict", "named", "right"),
    [
        ("law", "wear", "effects", "wear", True),
        ("law", "wear", "effects", "magnus/wear", True),
        ("law", "wear", "effects", "wear/magnus/adhesion/wrong_size", False),  # a group of four
        ("law", "wear", "effects", "magnus + wear", False),
        ("law", "wear", "unexplained", "wear", False),
        ("law", "wear", "adequate", "", False),
        ("law", "wear", "refused", "", False),
        ("law", "wear+moving_surface", "effects", "moving_surface/sensor_drift + wear", True),
        ("law", "wear+moving_surface", "effects", "wear/moving_surface", False),  # one or the other is not both
        ("law", "wear+moving_surface", "effects", "wear/moving_surface + magnus", False),
        ("law", "wear+moving_surface", "effects", "wear + magnus", False),
        ("law", "wear+moving_surface", "effects", "wear", False),
        ("law", "wear+moving_surface", "effects", "moving_surface + wear + magnus", False),
        ("law", "wear+moving_surface", "adequate", "", False),
        ("mechanism", "com_offset_x+linear_drag", "effects", "linear_drag/magnus + wear/com_offset", True),
        ("law", NOTHING, "adequate", "", True),
        ("law", NOTHING, "effects", "wear", False),
        ("law", NOTHING, "refused", "", False),
        ("mechanism", OUTSIDE, "unexplained", "wear", True),
        ("mechanism", OUTSIDE, "effects", "wear", False),
        ("mechanism", OUTSIDE, "adequate", "", False),
        ("mechanism", OUTSIDE, "refused", "", False),
        ("mujoco", "fluid_density", "unexplained", "quadratic_drag", True),
        ("drake_point", NOTHING, "adequate", "", True),
        ("drake_point", NOTHING, "effects", OWN, True),
        ("drake_point", NOTHING, "effects", f"{OWN} + wear", False),
        ("drake_point", NOTHING, "unexplained", OWN, False),
        ("drake_point", "tilt", "effects", f"{OWN} + surface_tilt", True),
        ("drake_point", "tilt", "effects", OWN, False),
        ("drake_hydroelastic", NOTHING, "effects", OWN, True),
        ("drake", NOTHING, "effects", OWN, False),
    ],
)
def test_only_an_exact_verdict_is_right(source, truth, verdict, named, right):
    assert is_right(Case(source, truth, 0), verdict, groups_of(named)) is right


def test_wrong_names_are_groups_without_anything_hidden():
    single = Case("law", "wear", 0)
    assert wrong_names(single, "unexplained", [["magnus", "wear"], ["time_lag"]]) == 1
    assert wrong_names(Case("law", NOTHING, 0), "effects", [["wear"]]) == 1
    assert wrong_names(Case("drake_point", NOTHING, 0), "effects", [[OWN]]) == 0


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
    case = Case("law", "wrong_gravity", 2, drops=50)  # a development seed
    row = table_of("law").cells(compute(case))
    groups, numbers = groups_of(row["named"]), numbers_of_row(row)
    assert is_right(case, row["verdict"], groups) and groups[0][0] == "wrong_gravity"
    true, found, std, fisher = (numbers[f"dg {kind}"] for kind in ("true", "found", "std", "fisher"))
    assert abs(found - true) < 4.0 * std
    assert 0.8 < std / fisher < 1.5
    table_of("law", tmp_path).put(row)
    assert read_rows("law", tmp_path) == {case: row}
    table = confusion(tmp_path)
    assert len(table) == 1 and table["right"].iloc[0] == 1.0


@pytest.mark.slow
def test_sizes_are_found_again():
    """Of one effect, to a factor of two: the fit has improved since, and finds more of the error without the effect."""
    assert 0.5 < stored_factor("com_offset") / find_size(Case("law", "com_offset", 7, ratio=RATIO)) < 2.0


def test_a_case_has_the_body_and_contact_of_its_source_unless_it_says_otherwise():
    assert Case("mechanism", "wear", 0) == Case("mechanism", "wear", 0, shape="ellipse", contact_time=2e-5)
    assert Case("law", "rounded_corners", 0).shape == Case("mujoco", "corner_radius", 0).shape == "square"
    assert Case("mujoco", NOTHING, 0).contact_time == 1e-3
    assert Case("mujoco", NOTHING, 0).is_usual and not Case("mujoco", NOTHING, 0, shape="square").is_usual
    for source, truth, contact in (
        ("mujoco", "corner_radius", {"shape": "ellipse"}),
        ("law", "wear", {"contact_time": 1e-3}),
    ):
        with pytest.raises(ValueError, match=r"corners|cannot last"):
            Case(source, truth, 0, **contact)


@pytest.mark.slow
@pytest.mark.parametrize("source", [name for name in SOURCES if name != "law"])
def test_each_source_drops_the_body_of_a_case_with_its_contact(source):
    """A contact of 3 ms is deeper than one of 0.3 ms, in each source, and of an ellipse as of a square."""
    for shape in ("ellipse", "square"):
        deepest = []
        for time in (3e-4, 3e-3):
            case = Case(source, NOTHING, 3, drops=2, shape=shape, contact_time=time)
            drops = simulate(case, {}, np.random.default_rng(5))
            assert drops.header.body == case.body and len(drops.impacts)
            deepest.append(drops.impacts.groupby("trial")["duration"].first().max())
        assert deepest[1] > 4.0 * deepest[0]
    one, two, other = (
        make(Case(source, NOTHING, 3, drops=2, contact_time=time))[0].digest() for time in (1e-3, 1e-3, 3e-3)
    )
    assert one == two != other


def test_sizes_of_causes_come_from_their_source_and_shape(monkeypatch):
    stored = {"mujoco": {"square": {"tilt": 0.2}}}
    monkeypatch.setattr(sizes, "_stored_sizes", lambda: stored)
    usual_size = CAUSES["tilt"].size
    assert Case("mujoco", "tilt", 0, shape="square").size("tilt") == 0.2
    assert Case("mujoco", "tilt", 0).size("tilt") == Case("mechanism", "tilt", 0).size("tilt") == usual_size
    assert Case("mujoco", "tilt", 0, shape="square", ratio=1.5).size("tilt") == pytest.approx(0.2 * np.sqrt(1.25 / 8.0))


@pytest.mark.slow
def test_the_size_of_a_cause_raises_the_misfit_to_the_ratio(monkeypatch):
    monkeypatch.setattr(finder, "DROPS", 24)
    found = find_size(Case("mujoco", "linear_drag", 7))
    assert 0.3 < found / CAUSES["linear_drag"].size < 3.0


def test_real_contacts_are_counted_by_source_shape_and_contact_time(tmp_path):
    many(tmp_path, "mechanism", "wear", 5, 0)  # of the first table: not counted
    many(tmp_path, "mechanism", "wear", 1, 1, contact_time=1e-3)
    many(tmp_path, "mujoco", "wear", 9, 1, shape="square")
    put(tmp_path, Case("mujoco", "tilt", SEEDS, shape="square"), verdict="unexplained")
    many(tmp_path, "drake_point", NOTHING, 4, 0, contact_time=3e-3)
    table = by_contact(outcomes(tmp_path), recovered(tmp_path)).set_index(["figure", "source", "shape"])
    single = table.loc["one cause, named alone"]
    assert single.loc[("all", "all"), "n"] == 13 and single.loc[("all", "all"), "share"] == pytest.approx(10 / 13)
    assert single.loc[("mujoco", "square"), "share"].tolist() == pytest.approx(
        [9 / 11] * 2
    )  # right, but something remains
    assert single.loc[("mechanism", "ellipse"), "n"].tolist() == [2, 2]
    nothing = table.loc["nothing hidden: adequate"].loc[("drake_point", "ellipse")]
    assert set(nothing["met"]) == {"met"} and nothing["contact_time"].tolist() == pytest.approx(
        [np.nan, 3e-3], nan_ok=True
    )
    datasets = outcomes(tmp_path)
    lines = as_markdown(datasets, recovered(tmp_path)).splitlines()
    assert [line for line in lines if line.startswith("| mujoco | square | 1 |  | 9 of 11 |")]
    assert lines[2].startswith("| asked |  |  | ≥ 95 % | ≥ 90 % |")
    assert lines[3].startswith("| all | all | all | 4 of 4 | 10 of 13 |")
    assert lines[-1] == "- wear, 1 ms: adequate, nothing named"
    assert "- tilt, 1 ms: unexplained, surface_tilt" in lines and sum(line.startswith("- ") for line in lines) == 3
    assert set(usual(outcomes(tmp_path))["source"]) == {"mechanism"}  # at 20 µs; a square and 3 ms are asked for


def test_how_far_parameters_are_off_is_told_by_source(tmp_path):
    for k in range(20):  # 1 to 20 % off with standard errors of 5 %: |z| up to 4
        value = numbers_in({"alpha": (2.0, 2.0 * (1.0 + 0.01 * (k + 1)), 0.1, np.nan)})
        case = Case("mujoco", "tilt", SEEDS + k, shape="square", contact_time=1e-3)
        put(tmp_path, case, parameters=value)
    *_, every, mujoco = accuracy(recovered(tmp_path))[-1].splitlines()
    assert every == mujoco.replace("mujoco", "all") == "| all | 9 of 20 | 11 % | 18 % | 1.9 |"
    assert accuracy(recovered(tmp_path / "none")) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, cause in CAUSES.items() if cause.parameter])
def test_the_size_of_a_cause_is_the_parameter_of_its_effect(name):
    drops, true = make(Case("mechanism", name, 3, 40))
    ((parameter, size),) = true.items()
    found = fit(Model(LAWS["mirtich"], (EFFECTS[CAUSES[name].effects[0]],)), observe(drops))
    # a slope of friction or restitution acts at the contact point, and the effect takes the place of the body
    within = 0.04 * abs(size) if name.endswith("_slope") else 0.0
    assert abs(found.values[parameter] - size) < 4.0 * found.std[parameter] + within


class TestPlan:
    def test_holds_what_is_asked_of_each_world(self):
        cases = planned()
        assert len(set(cases)) == len(cases) and min(case.seed for case in cases) == FRESH
        for sources in WORLDS.values():
            kinds = Counter(case.kind for case in cases if case.source in sources)
            assert kinds == PLANNED
            for source, shape in itertools.product(sources, BODIES):
                of_body = [c for c in cases if (c.source, c.shape) == (source, shape)]
                assert {c.contact_time for c in of_body if c.truth == NOTHING} == set(TIMES)
                causes = {t for t in truths(source)[1:] if shape == "square" or t not in CORNERED}
                described = {t for t in causes if Case(source, t, 0, shape=shape).kind == "single"}
                missed = described - {c.truth for c in of_body}
                assert len(missed) <= len(described) // 4, "every cause in its turn"

    def test_a_part_of_it_is_mixed_as_the_whole(self):
        cases = planned()
        worlds = {source: world for world, sources in WORLDS.items() for source in sources}
        for figure in (lambda c: c.kind, lambda c: worlds[c.source], lambda c: c.shape):
            whole, part = (Counter(map(figure, some)) for some in (cases, cases[: len(cases) // 4]))
            for key, count in whole.items():
                assert part[key] / count == pytest.approx(0.25, abs=0.12), key

    def test_only_what_is_missing_is_computed_or_older_if_told_to(self, tmp_path):
        said: list[str] = []
        few = Case("law", NOTHING, 5, drops=12)
        assert run([few], 1, said.append, tmp_path) and "adequate" in said[-1]
        assert is_of_today(few, read_rows("law", tmp_path)[few])
        put(tmp_path, few, code="0" * 16)
        assert run([few], 1, said.append, tmp_path) and said[-1] == "1 of 1 are stored, 0 to compute"
        assert not is_of_today(few, read_rows("law", tmp_path)[few])
        assert run([few], 1, said.append, tmp_path, again=True)
        assert is_of_today(few, read_rows("law", tmp_path)[few])
