"""The proof in space: its datasets follow from the seed alone, and its table counts what is right."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.in_space.hits import observe_in_space
from thesis_lib.datasets.format.frames import body_states, tracked_states
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Reference, parameters_in
from thesis_lib.extensions.effect_probe import BOX, tumbling_boxes
from thesis_lib.foundation.randomness import generator
from thesis_lib.mechanics.space import SPACE
from thesis_lib.simulate.tosses.causes import CORNERED, NOT_IN_MUJOCO, RANGES, RANGES_OF_MORE
from thesis_lib.simulate.tosses.drawn import NOTHING, NOTHING_HIDDEN, OF_EACH_CAUSE, SpaceCase, cases, make
from thesis_lib.simulate.tosses.drawn_in_worlds import MISSING_IN, SHAPES_IN, worlds_cases
from thesis_lib.simulate.tosses.lifted import lifted
from thesis_lib.studies.proof import space
from thesis_lib.studies.proof.cases import Case
from thesis_lib.studies.proof.cases import make as make_in_plane
from thesis_lib.studies.proof.sizes import ALONG_TABLE, as_fitted
from thesis_lib.studies.proof.space import engine_of, write_list


@pytest.mark.parametrize("proof", [space.FIRST, space.IN_WORLDS], ids=["two worlds", "three worlds"])
def test_the_stored_list_is_what_the_seed_draws(proof, tmp_path):
    there = replace(proof, drawn=proof.drawn.at(tmp_path / "list.csv"))
    write_list(there)
    assert there.drawn.path.read_bytes() == proof.drawn.path.read_bytes()


def test_the_three_worlds_have_what_was_asked_for_each_cause_in_all_worlds_that_have_it():
    planned = worlds_cases()
    kinds = Counter(space.kind_of(case.truth) for case in planned)
    assert kinds == {NOTHING: 60, "one": 120, "pair": 40, "outside": 40} and len(set(planned)) == 260
    made = Counter((case.world, case.truth) for case in planned)
    for cause in (*RANGES, *RANGES_OF_MORE):
        having = [world for world, missing in MISSING_IN.items() if cause not in missing]
        of = [made[world, cause] for world in MISSING_IN]
        assert sum(of) >= 3 and [bool(n) for n in of] == [world in having for world in MISSING_IN], cause
    for case in planned:
        assert case.drawn["shape"] in SHAPES_IN[case.world]
        assert {name.split(".")[0] for name in case.hidden} == set(case.truth.split("+")) - {NOTHING}
        assert not set(case.truth.split("+")) & set(MISSING_IN[case.world])


def test_every_cause_is_hidden_twice_and_in_both_worlds_where_it_can_be():
    made = Counter((case.world, case.truth) for case in cases())
    by_truth = Counter(case.truth for case in cases())
    assert by_truth == {NOTHING: NOTHING_HIDDEN} | dict.fromkeys(RANGES, OF_EACH_CAUSE)
    assert all(made["own", cause] == (2 if cause in NOT_IN_MUJOCO else 1) for cause in RANGES)
    assert made["own", NOTHING] == made["mujoco", NOTHING]
    assert len(set(cases())) == len(cases())


def test_what_is_drawn_lies_in_the_stated_ranges():
    for case in cases():
        drawn, size = case.drawn, np.linalg.norm([*case.hidden.values()]) if case.hidden else 0.0
        assert 60 <= drawn["tosses"] <= 120 and 100.0 <= drawn["rate"] <= 500.0
        assert 5e-5 <= drawn["position"] <= 5e-4 and 0.03 <= np.degrees(drawn["rotation"]) <= 0.3
        assert 3e-4 <= drawn["contact_time"] <= 3e-3
        assert case.truth not in CORNERED or drawn["shape"] != "sphere"
        if case.truth != NOTHING and not RANGES[case.truth].choices and not RANGES[case.truth].fixed:
            assert 0.99 * RANGES[case.truth].low <= size <= 1.01 * RANGES[case.truth].high


@pytest.mark.slow
def test_a_dataset_of_the_proof_is_in_axes_of_its_own():
    case = SpaceCase("own", NOTHING, 0)
    made = make(case, engine_of(case))
    assert abs(made.in_space.gravity[2]) < 9.7 and np.linalg.norm(made.in_space.gravity) == pytest.approx(9.81)
    states = body_states(tracked_states(made.trajectories), made.in_space)
    ((point, normal),) = made.in_space.planes
    gap = normal @ (states.position - point[:, None]) + normal @ made.in_space.body.solid.lowest(
        states.attitude, normal[:, None]
    )
    assert np.quantile(gap, 0.01) > -2e-3 and np.quantile(gap, 0.2) < 0.02


def row(world, truth, verdict, named, seed=0):
    case = {"world": world, "truth": truth, "seed": seed, "shape": "box", "sizes": "a.b=1:1.1:0.1;a.c=1:2:0.1"}
    return case | {"verdict": verdict, "named": named, "code": "abc", "made": "2026-11-26"}


def test_the_table_counts_what_is_right_first_and_wrong(tmp_path):
    store, by_hand = space.FIRST.rows.at(tmp_path / "space.csv"), space.FIRST.missed.at(tmp_path / "missed.csv")
    proof = replace(space.FIRST, rows=store, missed=by_hand)
    assert "None of the 80 datasets" in space.as_markdown(proof)
    store.put(
        row("own", NOTHING, "adequate", ""),
        row("own", NOTHING, "effects", "magnus", 1),
        row("own", "com_offset", "effects", "marker_offset/com_offset"),
        row("mujoco", "com_offset", "unexplained", "com_offset"),
        row("mujoco", "magnus", "effects", "magnus + com_offset"),
        row("own", "magnus", "effects", "magnus/a/b/c"),
        row("drake", "a+b", "effects", "x/b + a"),
        row("drake", "a+b", "effects", "a/b", 1),
        row("mujoco", "hand", "unexplained", ""),
        row("mujoco", "hand", "unexplained", "magnus", 1),
    )
    judged = space.judged(store.table()).set_index(["world", "truth", "seed"])
    assert judged["right"].to_dict() == {
        ("own", NOTHING, 0): True,
        ("own", NOTHING, 1): False,
        ("own", "com_offset", 0): True,
        ("mujoco", "com_offset", 0): False,
        ("mujoco", "magnus", 0): False,
        ("own", "magnus", 0): False,
        ("drake", "a+b", 0): True,
        ("drake", "a+b", 1): False,
        ("mujoco", "hand", 0): True,
        ("mujoco", "hand", 1): True,
    }
    assert judged["first"].sum() == 6
    wrong = [("mujoco", "hand", 1), ("mujoco", "magnus", 0), ("own", NOTHING, 1)]
    assert sorted(judged.index[judged["wrong"]]) == wrong
    untold = dict.fromkeys(space.MISSED, "") | {"code": "abc", "made": "2026-11-26"}
    by_hand.put(untold | {"world": "mujoco", "truth": "magnus", "seed": 0, "why": "no flight"})
    page = space.as_markdown(proof)
    assert (
        "Sizes in their 95 % interval: " in page
        and "named | the cause switched on by hand |" in page
        and "no flight |" in page
    )
    assert "Sets with a wrong effect: 3, of which `unexplained`: 1; beside a right one that is named first: 1." in page
    assert "1 of 2 (" in page and "10 of 80 datasets: 10 by `abc`" in page and "magnus + com_offset" in page


@pytest.mark.parametrize("name", sorted(ALONG_TABLE))
def test_a_slope_that_counts_from_the_table_is_the_same_property_counted_from_the_reference(name):
    states, here = tumbling_boxes(8, generator(3, "slopes")), BOX
    states = states.changed(0.1 * states.position)  # where no property reaches its limit
    elsewhere = replace(here, reference=Reference(x=0.05, y=0.08))
    effect = EFFECTS[name]
    first, second = (f"{name}.{p.name}" for p in parameters_in(effect, SPACE))
    hidden = {first: 1.2, second: 0.7, "other.size": 2.0}
    true = as_fitted([effect], hidden, elsewhere)
    assert true["other.size"] == 2.0

    def of(sizes, rig, states):
        p = {p.name: np.full(len(states), sizes[f"{name}.{p.name}"]) for p in parameters_in(effect, SPACE)}
        if "time" in name:
            return effect.contact_time(1.0, None, states, p, rig)
        return effect.coefficients(0.4, 0.4, None, states, p, rig)["restitution" in name]

    ratio = of(hidden, here, states) / of(true, elsewhere, states)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)
    assert abs(ratio[0] - 1.0) > 0.01


def test_a_turn_about_the_normal_of_the_table_is_no_size():
    effect = EFFECTS["camera_pose"]
    true = as_fitted([effect], {"camera_pose.b_x": 0.01, "camera_pose.b_y": 0.02, "camera_pose.b_z": 0.03}, BOX)
    assert list(true.values()) == [0.01, 0.02, 0.0]


@pytest.mark.slow
def test_a_lifted_planar_set_gets_the_size_of_its_plane():
    """The verdict that a whole search finds stands in config/proof/lifted.csv."""
    planar, true = make_in_plane(Case("mechanism", "com_offset_x", 1000))
    drops = Drops(observe_in_space(lifted(planar, generator(1000, "lifted", "com_offset_x"))))
    fitted = drops.fit("compliant_contact", (EFFECTS["com_offset"],))
    for name, value in ({"com_offset.c_y": 0.0, "com_offset.c_z": 0.0} | true).items():
        assert abs(fitted.values[name] - value) < 3.0 * fitted.std[name] < 5e-6
