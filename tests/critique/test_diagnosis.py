"""diagnosis.json says what the design's format asks for, and what it says is true."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from thesis_lib.critique import diagnosis as module
from thesis_lib.critique.detectable import detectable
from thesis_lib.critique.diagnosis import diagnosis
from thesis_lib.critique.fit import fit
from thesis_lib.critique.judge import judge
from thesis_lib.critique.next_experiment import next_experiment
from thesis_lib.critique.score_test import scan
from thesis_lib.critique.synthetic import synthesise
from thesis_lib.effects import EFFECTS

LEAST_RISE = 0.25  # of the noise floor: the setting material_floor
DRAWS = 40
LEAST_POWER = 0.6  # 80 % is aimed at; 40 draws at 80 % give fewer than 60 % once in 700 times
MOST_BY_CHANCE = 0.3  # at a quarter of the size the power is near that of chance, 1 %


@pytest.fixture(scope="module")
def told(hidden_impacts) -> dict:
    return diagnosis(hidden_impacts, np.random.default_rng(0))


@pytest.fixture(scope="module")
def told_nothing(nothing_hidden) -> dict:
    return diagnosis(nothing_hidden, np.random.default_rng(0))


def test_the_format_has_every_key_of_the_design(told):
    assert {
        *("schema", "dataset", "n_impacts", "n_trials", "base_model", "verdict", "effects", "error"),
        *("remaining", "not_testable", "left_out", "detectable", "next_experiment"),
    } <= set(told)
    assert told["schema"] == 1 and told["n_impacts"] == told["n_trials"] == 80
    assert set(told["base_model"]["parameters"]) == {"mu", "epsilon"}
    assert set(told["base_model"]["parameters"]["mu"]) == {"value", "std", "unit"}
    assert set(told["error"]) >= {
        *("unit", "base", "augmented", "irb_bound", "noise_floor", "explained_share", "flight")
    }
    assert set(told["effects"][0]["gain"]) == {"held_out_log_score_per_impact", "interval", "p_value"}
    assert set(told["next_experiment"]["states"][0]) == {"vx", "vy", "omega", "theta"}


def test_the_hidden_effect_is_named_with_its_size(told):
    assert told["verdict"] == "effects"
    (effect,) = told["effects"]
    assert effect["name"] == "tangential_restitution" and effect["family"] == "contact_law"
    e_t = effect["parameters"]["e_t"]
    assert abs(e_t["value"] - 0.4) < 4.0 * e_t["std"]
    low, high = effect["gain"]["interval"]
    assert 0.0 < low < effect["gain"]["held_out_log_score_per_impact"] < high
    assert told["error"]["explained_share"] > 0.9
    assert told["error"]["flight"] is None  # impacts alone say nothing of the flight
    assert {"name": "linear_drag", "why": "no trajectories"} in told["not_testable"]


def test_nothing_hidden_is_adequate_and_says_what_would_have_shown(told_nothing):
    assert told_nothing["verdict"] == "adequate" and told_nothing["effects"] == []
    assert told_nothing["error"]["flight"]["base"] < 1.3
    assert len(told_nothing["summary"]) == 2 and "adequate" in told_nothing["summary"][0]
    sizes = {entry["name"]: entry["smallest"] for entry in told_nothing["detectable"]}
    assert set(sizes) == set(EFFECTS) - {entry["name"] for entry in told_nothing["not_testable"]}
    assert 0.0 < sizes["tangential_restitution"]["e_t"] < 1.0


def test_numbers_are_json_with_six_digits(told, told_nothing):
    def check(value):
        if isinstance(value, dict):
            [check(item) for item in value.values()]
        elif isinstance(value, list):
            [check(item) for item in value]
        elif isinstance(value, float):
            assert math.isfinite(value) and float(f"{value:.6g}") == value

    for content in (told, told_nothing):
        check(content)
        json.dumps(content, allow_nan=False)


def test_equal_streams_give_equal_diagnoses(hidden_impacts, told):
    assert diagnosis(hidden_impacts, np.random.default_rng(0)) == told


def test_unknown_noise_and_a_base_below_the_floor_give_null(hidden_impacts):
    def with_floor(floor: float):
        ladder = tuple((label, one, replace(j, floor=floor)) for label, one, j in hidden_impacts.ladder)
        return diagnosis(replace(hidden_impacts, ladder=ladder), np.random.default_rng(0))["error"]

    assert with_floor(np.nan)["noise_floor"] is None and with_floor(np.nan)["explained_share"] is None
    assert with_floor(10.0)["explained_share"] is None


@pytest.mark.parametrize(("factor", "passes"), [(1.0, True), (0.25, False)])
def test_the_smallest_detectable_size_is_found_in_most_repetitions(nothing_hidden, factor, passes):
    """Data made by the base law with the effect on, at that size: how often does the score test pass its null?"""
    name = "orientation_dependent_restitution"
    smallest = {e["name"]: e["smallest"] for e in detectable(nothing_hidden)}[name]["a_c"]
    base = nothing_hidden.ladder[0][1]
    hidden = base.model.with_effect(EFFECTS[name])
    values = {**base.values, f"{name}.a_c": factor * smallest, f"{name}.a_s": 0.0}
    limit = np.quantile(nothing_hidden.discovery.last_scan.null, 0.99)
    rng = np.random.default_rng(5)
    training = nothing_hidden.training
    found = 0
    for _ in range(DRAWS):
        data = synthesise(hidden, values, training, rng)
        fitted = fit(base.model, data, base.values, rounds=1)
        found += scan(fitted, data, [EFFECTS[name]], rng).gain[name] > limit
    share = found / DRAWS
    assert share >= LEAST_POWER if passes else share <= MOST_BY_CHANCE


def test_a_material_size_raises_the_error_by_what_counts(nothing_hidden):
    """Data made with the effect at that size, and fitted without it: the error rises by a quarter of the floor."""
    name, p = "anisotropic_friction", "a_t"
    entry = {e["name"]: e for e in detectable(nothing_hidden)}[name]
    size = entry["smallest_material"][p]
    base, training = nothing_hidden.ladder[0][1], nothing_hidden.training
    floor = nothing_hidden.ladder[0][2].floor
    rng = np.random.default_rng(8)

    def error(size: float) -> float:
        hidden = base.model.with_effect(EFFECTS[name])
        values = {**base.values, f"{name}.{p}": size}
        draws = [synthesise(hidden, values, training, rng) for _ in range(8)]
        fits = [fit(base.model, data, base.values, rounds=1) for data in draws]
        return float(np.mean([judge(one, data).error.mean() for one, data in zip(fits, draws)]))

    rise = (error(size) - error(0.0)) / floor
    assert 0.5 * LEAST_RISE < rise < 2.0 * LEAST_RISE
    assert size > entry["smallest"][p] > 0.0


def test_the_next_experiment_tells_named_candidates_apart(hidden_impacts):
    (step,) = hidden_impacts.discovery.steps
    step = replace(step, alternatives=("moving_surface",))
    doubtful = replace(hidden_impacts, discovery=replace(hidden_impacts.discovery, steps=(step,)))
    found = next_experiment(doubtful, np.random.default_rng(0))
    assert "tangential restitution" in found["why"] and EFFECTS["moving_surface"].title in found["why"]
    assert 3 <= len(found["states"]) <= 5
    assert found["sigmas"] == sorted(found["sigmas"], reverse=True) and found["sigmas"][0] > 3.0
    assert "a single one tells" in found["why"]
    measured = np.abs(hidden_impacts.observations.slope[:, 0]).max(axis=0)
    for state in found["states"]:
        assert state["vy"] < 0.0
        assert np.all(np.abs([state["vx"], state["vy"], state["omega"]]) <= 1.4 * measured)
    states = np.array([[s["vx"], s["vy"], s["omega"] / 15.0, s["theta"]] for s in found["states"]])
    apart = np.linalg.norm(states[:, None] - states[None], axis=2)
    assert apart[np.triu_indices(len(states), 1)].min() > 0.3
    content = diagnosis(doubtful, np.random.default_rng(0))
    assert content["effects"][0]["indistinguishable_from"] == ["moving_surface"]
    assert "tell the named candidates apart" in content["summary"][-1]


def test_a_fault_of_the_measurement_is_said_first(told):
    fault = {**told["effects"][0], "name": "mirrored_rotation", "family": "measurement"}
    content = {
        **told,
        "effects": [*told["effects"], fault],
        "left_out": {"share": 0.3, "reasons": {"second_hit": 90, "not_ballistic": 20, "lost_frames": 1}},
    }
    sentences = module._summary(content)
    assert "faulty" in sentences[0] and "mirrored rotation" in sentences[0]
    assert "30 %" in sentences[1]
    assert (
        "(90 × second hit too near to tell apart; 20 × no free flight on a side (held, rolling, bad track); 1 for "
        "other reasons)" in sentences[1]
    )
    assert "tangential restitution" in sentences[2] and "mirrored" not in sentences[2]
    alone = module._summary({**told, "effects": [fault]})
    assert "put right" in alone[1]


def test_structure_that_nothing_explains_is_told_with_what_it_depends_on(hidden_impacts):
    left = replace(
        hidden_impacts.remaining,
        p_value=0.005,
        error_before=0.2,
        error_after=0.05,
        depends_on=("theta", "v_n"),
    )
    content = diagnosis(replace(hidden_impacts, remaining=left), np.random.default_rng(0))
    assert content["verdict"] == "unexplained" and content["remaining"]["structured"]
    assert content["remaining"]["depends_on"] == ["theta", "v_n"]
    assert (
        "(theta) and the normal velocity of the contact point before impact (v_n):" in content["summary"][-1]
    )
