"""Critique of mechanisms: the model's dynamics, the noise of windows, what is found of what is hidden, and refusals."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from thesis_lib.critique.mechanisms import diagnosis
from thesis_lib.critique.mechanisms.critique import MechanismCritique, criticise_mechanism, smallest_sizes
from thesis_lib.critique.mechanisms.diagnosis import mechanism_diagnosis
from thesis_lib.critique.mechanisms.effects import CANDIDATES, GRAVITY, MotionSteps
from thesis_lib.critique.mechanisms.model import BelievedArm, BelievedWheel
from thesis_lib.critique.mechanisms.recovery import force_error, identify_parameters
from thesis_lib.critique.mechanisms.settings import EquationWindowSettings, HiddenStudy, MechanismSettings
from thesis_lib.critique.mechanisms.steps import measured
from thesis_lib.critique.mechanisms.study import believed, exact_form, hidden_effect_study, is_right, true_sizes
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.mechanisms.world import ForceFit, MechanismWorld, fit_effects
from thesis_lib.critique.selection.scan import scan
from thesis_lib.foundation.errors import UserError
from thesis_lib.report.critique.mechanisms import mechanism_page
from thesis_lib.simulate.mechanisms import motions as chapter2
from thesis_lib.simulate.mechanisms.hidden_forces import (
    TRUTHS,
    HiddenSizes,
    LoadedWheel,
    gravity_direction,
    loaded_arm,
    planned,
    run_with,
)

ROUNDING = 1e-11  # N, N m, kg m²: double precision of sums of terms of order ten
SIZES, BODIES = HiddenSizes(), chapter2.DEFAULT
SETTINGS = MechanismSettings(resamples=199)
N_TRIALS, SNR = 9, 60.0
FOUND = [(kind, truth) for kind in TRUTHS for truth in TRUTHS[kind] if truth not in ("nothing", "cogging")]


def criticised(records, model, seed: int, snr: float = SNR, more: tuple = ()) -> MechanismCritique:
    """Critique of what is measured of simulated trials, with the candidates of the mechanism and `more`."""
    rng = np.random.default_rng(seed)
    trials = measured(records, snr, rng, SETTINGS.windows)
    return criticise_mechanism(trials, model, (*CANDIDATES[model.name], *more), rng, SETTINGS)


@pytest.fixture(scope="module")
def models():
    return {kind: believed(kind, BODIES, SIZES) for kind in TRUTHS}


@pytest.fixture(scope="module")
def plans():
    return {kind: planned(kind, N_TRIALS, np.random.default_rng(5), BODIES, SIZES) for kind in TRUTHS}


@pytest.fixture(scope="module")
def critiques(models, plans):
    """Critique of a mechanism with a hidden effect at 60 dB, made when first asked for."""

    @cache
    def make(kind: str, truth: str) -> tuple[MechanismCritique, tuple]:
        records = run_with(kind, truth, plans[kind], BODIES, SIZES)
        return criticised(records, models[kind], 8), records

    return make


def states(n, nv, seed):
    return np.random.default_rng(seed).standard_normal((3, n, nv))


@pytest.mark.parametrize("kind", TRUTHS)
def test_effects_without_normal_forces_do_not_see_them(kind, models, rng):
    model, n = models[kind], 7
    q, v, a = rng.normal(size=(3, n, len(model.coordinates)))
    pairs = len(model.mechanism.pairs)
    motion = MotionSteps(q, v, a, rng.uniform(1.0, 2.0, (n, pairs)))
    for effect in CANDIDATES[kind]:
        p = np.full(len(effect.parameters), 0.3)
        force = effect.force(model, motion, p)
        other = effect.force(model, replace(motion, c_n=motion.c_n + 1.0), p)
        assert (force == other).all() != effect.needs_normal


def test_inverse_dynamics_of_the_arm_are_those_of_drake():
    arm = chapter2.arm_disk()
    model = BelievedArm(arm)
    q, v, a = states(6, 5, 0)
    drake = [arm.mass_matrix(q[k]) @ a[k] + arm.bias(q[k], v[k]) - arm.gravity(q[k]) for k in range(len(q))]
    assert np.abs(model.inverse_dynamics(q, v, a) - drake).max() < ROUNDING
    assert np.abs(model.mass_matrix(q) - [arm.mass_matrix(one) for one in q]).max() < ROUNDING


def test_payload_of_the_model_is_the_loaded_arm_and_the_loaded_wheel():
    q, v, a = states(4, 5, 1)
    model, loaded = BelievedArm(chapter2.arm_disk()), BelievedArm(chapter2.arm_disk(loaded_arm(BODIES, 0.3)))
    heavier = model.regressor(q, v, a) @ (model.parameters + 0.3 * model.payload)
    assert np.abs(loaded.inverse_dynamics(q, v, a) - heavier).max() < ROUNDING
    wheel = LoadedWheel(chapter2.wheel(), 0.3, np.array([0.5, 0.0]))
    model = BelievedWheel(chapter2.wheel(), 0.5)
    q, v, a = states(4, 3, 2)
    forces = [wheel.mass_matrix(q[k]) @ a[k] + wheel.bias(q[k], v[k]) - wheel.gravity(q[k]) for k in range(len(q))]
    heavier = model.regressor(q, v, a) @ (model.parameters + 0.3 * model.payload)
    assert np.abs(heavier - forces).max() < ROUNDING


@pytest.mark.parametrize("kind", TRUTHS)
def test_turned_gravity_of_simulation_and_critique_agree(kind, models):
    model = models[kind]
    nv = len(model.coordinates)
    q, v, a = states(4, nv, 3)
    hidden = gravity_direction(model.mechanism, 0.2)
    motion = MotionSteps(q, v, a, np.zeros((4, len(model.mechanism.pairs))))
    ours = GRAVITY.force(model, motion, np.array([0.2]))
    assert np.abs(ours - [hidden(0.0, q[k], v[k]) for k in range(4)]).max() < ROUNDING


@pytest.mark.parametrize("kind", TRUTHS)
def test_exact_motion_leaves_no_residual_and_a_hidden_force_does(kind, models, plans):
    weak = WeakForm(
        measured(plans[kind], np.inf, np.random.default_rng(0), SETTINGS.windows), models[kind], SETTINGS.windows
    )
    z = weak.residual(np.zeros_like(weak.f))
    assert np.abs(z).max() < 1e-6  # of the accuracy asked, 80 dB
    push = np.zeros_like(weak.f)
    push[:, -1] = 0.1
    assert np.abs(weak.residual(push)).max() > 10.0


@pytest.mark.parametrize("kind", TRUTHS)
def test_whitened_residuals_are_unit_noise_and_not_correlated(kind, models, plans):
    rng = np.random.default_rng(1)
    z, products = [], []
    for _ in range(4):
        weak = WeakForm(measured(plans[kind], 40.0, rng, SETTINGS.windows), models[kind], SETTINGS.windows)
        one = weak.residual(np.zeros_like(weak.f))
        same = weak.trial[1:] == weak.trial[:-1]
        z.append(one)
        products.append((one[1:] * one[:-1])[same])
    z, products = np.concatenate(z), np.concatenate(products)
    # four standard errors of a mean square of n values and of a mean product
    assert abs(np.mean(z**2) - 1.0) < 4.0 * np.sqrt(2.0 / len(z))
    assert abs(products.mean()) < 4.0 / np.sqrt(len(products))


def test_null_counts_the_candidates(models, plans):
    """On unit noise the p-value of the best candidate is uniform, not too small."""
    rng = np.random.default_rng(2)
    weak = WeakForm(measured(plans["arm"], SNR, rng, SETTINGS.windows), models["arm"], SETTINGS.windows)
    empty = ForceFit((), {}, {}, np.zeros(len(weak.trial)), np.zeros((len(weak.trial), 0)))
    tests = scan(MechanismWorld(weak, CANDIDATES["arm"], 999).slopes(empty, CANDIDATES["arm"]), 999, rng)
    draws = rng.standard_normal((len(weak.trial), 400))
    best = np.max([0.5 * ((B.T @ draws) ** 2).sum(axis=0) for B in tests.basis.values()], axis=0)
    p = np.array([tests.p_value(gain) for gain in best])
    alone = 0.5 * ((tests.basis["gravity_direction"].T @ draws) ** 2).sum(axis=0)
    assert abs((p < 0.2).mean() - 0.2) < 0.08  # four standard errors of 400 draws
    assert np.mean([tests.p_value(gain) for gain in alone]) > 0.6  # one candidate alone must do better than chance


@pytest.mark.parametrize(("kind", "truth"), FOUND)
def test_hidden_effect_is_found_first_and_its_size_forces_and_parameters_recovered(kind, truth, critiques, models):
    found, records = critiques(kind, truth)
    assert found.verdict == "effects" and is_right(truth, found)
    assert [step.effect.name for step in found.steps] == [truth]
    sizes = true_sizes(kind, truth, SIZES)
    true = list(sizes.values())
    errors = (found.fitted.values[truth] - true) / found.fitted.std[truth]
    assert np.abs(errors).max() < 4.0 and (found.fitted.std[truth] < 0.1 * np.abs(true)).all()
    before, after = found.ladder[0][0], found.ladder[-1][0]
    assert before > 5.0 and after < 1.3
    assert found.gains[truth][1] > 0.0 and found.steps[0].p_value <= 0.01
    exact, nothing = exact_form(records, models[kind], HiddenStudy()), fit_effects(found.training, ())
    (before, *_), (after, *_) = (force_error(exact, records[-1], fitted) for fitted in (nothing, found.fitted))
    assert after < 0.05 * before
    identified = identify_parameters(found.training, found.fitted)
    true = models[kind].parameters + (sizes["m_p"] * models[kind].payload if truth == "payload" else 0.0)
    goal = identified.of(true)
    assert np.abs(identified.value / goal - 1.0).max() < 0.01
    start = identified.believed if truth == "payload" else identify_parameters(found.training, nothing).value
    assert np.abs(start / goal - 1.0).max() > 5.0 * np.abs(identified.value / goal - 1.0).max()


def test_arm_has_the_six_base_parameters_of_the_thesis(critiques):
    found, _ = critiques("arm", "nothing")
    identified = identify_parameters(found.training, found.fitted)
    arm = BODIES.arm
    (m1, m2), (c1, c2), (l1, _) = arm.link_masses, arm.link_coms, arm.link_lengths
    I1, I2 = (i + m * c * c for i, m, c in zip(arm.link_inertias, arm.link_masses, arm.link_coms))
    expected = sorted([m1 * c1 + l1 * m2, I1 + l1 * l1 * m2, m2 * c2, I2, arm.disk_mass, arm.disk_inertia])
    values = sorted(identified.believed)
    # the choice of independent columns may scale a combination by l_1
    assert len(values) == 6
    for value in (m2 * c2, I2, arm.disk_mass, arm.disk_inertia):
        assert np.abs(np.array(values) - value).min() < ROUNDING
    assert any(abs(v - e) < ROUNDING for v in values for e in expected[-2:])


@pytest.mark.parametrize("kind", TRUTHS)
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_nothing_hidden_is_adequate(kind, seed, models, plans):
    found = criticised(plans[kind], models[kind], seed)
    assert found.verdict == "adequate" and found.steps == ()


def test_a_cause_outside_the_library_is_unexplained_and_nothing_is_adequate(critiques):
    found, _ = critiques("arm", "cogging")
    assert is_right("cogging", found)
    assert "q_1" in found.remaining.depends_on  # the torque is a function of the first joint's angle
    for truth, verdict in (("nothing", "adequate"), ("cogging", "unexplained")):
        d = mechanism_diagnosis(critiques("arm", truth)[0], truth, np.random.default_rng(0))
        assert d["verdict"] == verdict and d["summary"]
        # an effect may stand in for an unknown cause; it clears all tests and does not explain it
        assert d["effects"] == [] or verdict == "unexplained"
        assert verdict in mechanism_page(d)


def test_candidates_with_one_signature_are_named_together(models, plans):
    """A conveyor's steady push on the disk acts as gravity's horizontal part does: nothing can tell them apart."""
    twin = replace(GRAVITY, name="twin", title="the same force under another name")
    records = run_with("wheel", "gravity_direction", plans["wheel"], BODIES, SIZES)
    found = criticised(records, models["wheel"], 3, 40.0, (twin,))
    assert set(found.first_group) == {"gravity_direction", "twin"}
    assert is_right("gravity_direction", found)
    d = mechanism_diagnosis(found, "wheel", np.random.default_rng(0))
    (effect,) = d["effects"]
    other = effect["indistinguishable_from"][0]
    assert effect["cosines"][other] == pytest.approx(1.0)
    assert d["next_experiment"]["states"]


@pytest.mark.parametrize(("times", "verdict"), [(0.4, "adequate"), (2.5, "effects")])
def test_an_effect_shows_from_the_smallest_size_on(times, verdict, critiques, models, plans):
    smallest = smallest_sizes(critiques("wheel", "nothing")[0])["payload"]["m_p"]
    records = run_with("wheel", "payload", plans["wheel"], BODIES, HiddenSizes(wheel_payload=times * smallest))
    found = criticised(records, models["wheel"], 4)
    assert found.verdict == verdict
    assert found.below in (("payload", "") if verdict == "adequate" else ("",))


def test_diagnosis_and_page_tell_the_story(critiques):
    found, _ = critiques("arm", "viscous_joint_friction")
    d = mechanism_diagnosis(found, "arm with friction", np.random.default_rng(0))
    assert json.loads(json.dumps(d)) == d
    impact_keys = {
        *("schema", "dataset", "n_trials", "base_model", "augmented_model", "verdict", "effects", "error"),
        *("remaining", "not_testable", "left_out", "detectable", "next_experiment", "summary"),
    }
    assert impact_keys <= set(d) and d["mechanism"] == "arm"
    (effect,) = d["effects"]
    assert effect["name"] == "viscous_joint_friction"
    assert effect["parameters"]["b_1"]["value"] == pytest.approx(SIZES.viscous[0], rel=0.05)
    assert d["error"]["base"] > d["error"]["augmented"]
    page = mechanism_page(d)
    for words in ("1. How far", "2. Where it fails", "3. Which effect", "4. What adding", "could have shown"):
        assert words in page
    assert "b_1" in page and page.count("<h1>") == 1


def test_bad_input_is_refused(models, plans):
    rng = np.random.default_rng(0)
    trials = measured(plans["wheel"], SNR, rng, SETTINGS.windows)
    with pytest.raises(UserError, match="4 trials or more"):
        criticise_mechanism(trials[:3], models["wheel"], CANDIDATES["wheel"], rng)
    broken = trials[0].q.copy()
    broken[5, 1] = np.nan
    with pytest.raises(UserError, match="Trial 0 contains"):
        WeakForm([replace(trials[0], q=broken)], models["wheel"], SETTINGS.windows)
    with pytest.raises(UserError, match=r"No window .* left out: \{'too short': \d+\}"):
        WeakForm(trials[:1], models["wheel"], EquationWindowSettings(min_window=1000))
    with pytest.raises(UserError, match="hides one of"):
        run_with("wheel", "coulomb_joint_friction", plans["wheel"], BODIES, SIZES)


@pytest.mark.slow
def test_study_counts_every_dataset_and_is_right():
    tables, shown = hidden_effect_study(
        HiddenStudy(seeds=1, trials=8, snr_db=(60.0,), critique=SETTINGS), np.random.default_rng(0)
    )
    effects = tables["effects"]
    assert len(effects) == sum(map(len, TRUTHS.values())) == len(shown)
    assert (effects["trials"] >= 6).all() and effects["right"].mean() >= 0.9
    assert set(tables["forces"]["component"]) == {"normal", "tangential"}
    hidden = effects[~effects["truth"].isin(["nothing", "cogging"])]
    assert (hidden["force_error_after"] < 0.1 * hidden["force_error_before"]).all()
    assert (tables["summary"]["right_low"] <= tables["summary"]["right"]).all()


@pytest.mark.parametrize(("end", "said"), [(1.75, "rises"), (1.25, "does not fall by an amount that matters")])
def test_an_effect_that_held_out_trials_strike_is_said_with_its_misfits(end: float, said: str):
    (text,) = diagnosis._rejected({"rejected": [{"title": "Payload", "ends": (1.5, end)}]})
    assert f"the misfit {said}, from 1.5 to {end}" in text.replace("1.50", "1.5")
