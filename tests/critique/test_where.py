"""Regions are found where they were planted, none where there is none, and class tests tell classes apart."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hidden_effects import injected_impacts

from thesis_lib.contact import LAWS
from thesis_lib.critique import where as module
from thesis_lib.critique.class_tests import class_tests
from thesis_lib.critique.fit import fit
from thesis_lib.critique.model import Model
from thesis_lib.critique.observations import observe
from thesis_lib.critique.where import LEVEL, Condition, regions, where

N = 300
SEEDS = 20
CERTAIN = 1e-6  # p-values of what is there
UNSEEN = 1e-3  # below it a test of what is not there would fail in one of 1000 runs


def planted(monkeypatch, factor: float, seed: int) -> tuple[pd.DataFrame, np.ndarray]:
    """Random states, with errors `factor` times as large for |v_t| < 0.4 and r_x > 0."""
    rng = np.random.default_rng(seed)
    table = pd.DataFrame(
        {
            "v_t": rng.uniform(-1.5, 1.5, N),
            "v_n": -rng.uniform(0.5, 3.0, N),
            "omega": rng.uniform(-15.0, 15.0, N),
            "r_x": rng.uniform(-0.01, 0.01, N),
            "theta": rng.uniform(-1.5, 1.5, N),
            "x": rng.uniform(-0.2, 0.2, N),
            "trial": np.arange(N, dtype=float),
        }
    )
    inside = ((table["v_t"].abs() < 0.4) & (table["r_x"] > 0)).to_numpy()
    error = 0.01 * np.linalg.norm(rng.standard_normal((N, 3)), axis=1) * np.where(inside, factor, 1.0)
    monkeypatch.setattr(module, "features", lambda fitted, o: table)
    monkeypatch.setattr(module, "relative_error", lambda fitted, o: (error, error / 0.017))
    return table, inside


def test_a_planted_region_is_found_with_a_readable_rule(monkeypatch):
    table, inside = planted(monkeypatch, 3.0, 0)
    first = regions(None, None, np.random.default_rng(0))[0]
    assert first["p_value"] <= 0.01
    assert first["ratio"] == pytest.approx(3.0, rel=0.3)
    found = np.logical_and.reduce([Condition(**c).inside(table) for c in first["conditions"]])
    assert np.sum(found & inside) / np.sum(found | inside) > 0.6
    assert "|v_t| <" in first["rule"] and "r_x > 0" in first["rule"]
    assert first["support"] == pytest.approx(found.mean()) and first["n"] == found.sum()


def test_errors_without_structure_give_no_region(monkeypatch):
    false = 0
    for seed in range(SEEDS):
        planted(monkeypatch, 1.0, seed)
        false += bool(regions(None, None, np.random.default_rng(0)))
    # at a level of 5 % more than 4 of 20 happen once in 400 runs of other seeds
    assert false <= 4, f"{false} of {SEEDS} at level {LEVEL}"


def test_regions_do_not_overlap_and_have_support(hidden_drops):
    found = where(hidden_drops, np.random.default_rng(0))
    for part in (found["regions"], found["after"]["regions"]):
        assert len(part) <= 3
        assert all(0.05 <= region["support"] <= 0.6 and region["ratio"] > 1.0 for region in part)
    assert found["after"]["effects"] == ["anisotropic_friction"]
    assert found["regions"] and found["regions"][0]["ratio"] > 1.5
    assert found == where(hidden_drops, np.random.default_rng(0))


def test_a_condition_reads_as_it_is_evaluated():
    table = pd.DataFrame({"v_t": [-0.3, -0.1, 0.1, 0.3], "trial": [0.0, 1.0, 2.0, 3.0]})
    cases = {
        "|v_t| < 0.2 m/s": (Condition("v_t", True, None, 0.2), [0, 1, 1, 0]),
        "v_t > 0": (Condition("v_t", False, 0.0, None), [0, 0, 1, 1]),
        "0.5 < trial < 2.5": (Condition("trial", False, 0.5, 2.5), [0, 1, 1, 0]),
    }
    for text, (condition, inside) in cases.items():
        assert condition.text == text
        assert condition.inside(table).astype(int).tolist() == inside


def test_nothing_hidden_fails_no_class_test(nothing_hidden):
    found = where(nothing_hidden, np.random.default_rng(0))
    assert found["after"] is None
    for name, test in found["class_tests"].items():
        assert test["p_value"] > UNSEEN, name
    balance = found["class_tests"]["momentum_balance"]
    for name in ("a", "b"):
        assert abs(balance[name]["value"] - 1.0) < 4.0 * balance[name]["std"]


def test_direction_dependent_friction_breaks_parity_and_nothing_else(hidden_drops):
    found = where(hidden_drops, np.random.default_rng(0))["class_tests"]
    assert found["parity"]["p_value"] < CERTAIN
    for name in ("rigid_point", "momentum_balance", "homogeneity"):
        assert found[name]["p_value"] > UNSEEN, name


@pytest.mark.parametrize(
    ("effect", "values", "broken"),
    [
        ("mirrored_rotation", {"mirrored": 1.0}, {"rigid_point", "momentum_balance"}),
        ("velocity_dependent_restitution", {"p": 0.2, "c": 0.0}, {"homogeneity"}),
        ("tangential_restitution", {"e_t": 0.4}, set()),
        ("wrong_inertia", {"d_I": 0.1}, {"momentum_balance"}),
    ],
)
def test_each_class_test_sees_its_own_class(effect, values, broken):
    data = injected_impacts("one", 150, 7, effect, {f"{effect}.{k}": v for k, v in values.items()})
    observations = observe(data)
    fitted = fit(Model(LAWS["anitescu_potra_newton"]), observations)
    found = class_tests(fitted, observations)
    seen = {name for name, test in found.items() if test["p_value"] < CERTAIN}
    assert broken <= seen
    assert all(found[name]["p_value"] > UNSEEN for name in set(found) - broken - {"rigid_point"}), found
    if effect == "mirrored_rotation":  # k² Δω = a r_x Δv_y − b r_y Δv_x: r_x and ω turn with θ, r_y does not
        assert found["momentum_balance"]["b"]["value"] == pytest.approx(-1.0, abs=0.05)
        assert found["momentum_balance"]["a"]["value"] == pytest.approx(1.0, abs=0.05)


def test_a_test_that_the_data_cannot_support_says_so(impacts_dataset):
    one_way = impacts_dataset.impacts.copy()
    one_way["vx_pre"] = np.abs(one_way["vx_pre"]) + 2.0
    header = impacts_dataset.header.model_copy(update={"noise": None})
    observations = observe(replace(impacts_dataset, impacts=one_way, header=header))
    found = class_tests(fit(Model(LAWS["whittaker"]), observations), observations)
    assert found["parity"]["p_value"] is None and "both ways" in found["parity"]["why_not"]
    assert found["rigid_point"]["p_value"] is None and "noise" in found["rigid_point"]["why_not"]
