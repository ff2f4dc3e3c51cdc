"""What data cannot show is said as a bound, or as not shown: never as a number with a standard error."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bouncing_disk import K_G, RADIUS, bouncing

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.drops.own_restitution import OwnRestitution
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.engines.compare import compare_models
from thesis_lib.critique.export.export import exported
from thesis_lib.critique.likelihood.bounds import Bound
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.proposal import terms as proposed
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.critique.results.saved_model import saved
from thesis_lib.critique.results.tables import comparison
from thesis_lib.figures.critique.errors import draw_parameters
from thesis_lib.figures.critique.pictures import draw_models
from thesis_lib.report.critique.tables import models

MU, EPSILON = 0.3, 0.6
NEAR = 0.05  # of the largest ratio of impulses: the bound lies two standard errors of one impact below it
# held-out error over the noise floor of a dozen impacts; one that slips where it should stick is far off
AT_NOISE = 1.6
OF_ONE_IMPACT = 2e-3  # four standard errors of ε from a single impact
STANDARD_ERRORS = 4.0  # by chance once in 16,000
NO_SEARCH = CritiqueSettings(max_effects=0, max_terms=0, contact_time=False)


@pytest.fixture(scope="module")
def sticking():
    """40 drops that all end rolling, and the largest ratio of impulses."""
    dataset, ratio = bouncing([EPSILON] * 40, MU, np.random.default_rng(3))
    return criticise_drops(dataset, rng=np.random.default_rng(0), settings=NO_SEARCH), ratio


@pytest.mark.slow
def test_friction_of_drops_that_never_slip_is_a_lower_bound(sticking):
    critique, ratio = sticking
    content = diagnosis(critique, np.random.default_rng(0))
    for part in (content["base_model"], content["augmented_model"], *content["laws"].values()):
        mu = part["parameters"]["mu"]
        assert (mu["bound"], mu["std"]) == ("lower", None)
        assert (1.0 - NEAR) * ratio < mu["value"] < (1.0 + NEAR) * ratio
        assert part["parameters"]["epsilon"]["std"] > 0.0
    assert f"mu at least {ratio:.2g}"[:-1] in " ".join(content["summary"])
    assert content["error"]["base"] < AT_NOISE * content["error"]["noise_floor"]
    table = comparison(critique)
    assert table[table["kind"] == "law"]["mu_std"].isna().all()
    assert "NaN" not in json.dumps(content)


def test_its_model_sticks_beyond_the_bound_and_is_read_again(sticking, tmp_path):
    critique, ratio = sticking
    saved(critique.ladder[-1][1], critique.observations.rig, "disk").save(tmp_path / "model.json")
    model = load_model(tmp_path / "model.json")
    assert model.parameters["mu"].bound == "lower" and model.parameters["mu"].std is None
    steep = pd.DataFrame([{"x": 0.0, "y": RADIUS, "theta": 0.0, "vx": 3.0, "vy": -2.0, "omega": 0.0}])
    after = model.predict(steep).iloc[0]
    assert 2.0 * ratio < 3.0 / (1.0 + (RADIUS / K_G) ** 2) / 3.2  # the ratio of impulses that it needs
    assert after["vx_post"] + RADIUS * after["omega_post"] == pytest.approx(0.0, abs=1e-6)
    assert any(line.startswith("mu: at least") for line in exported(model, "mjcf", depth=0.05).left_out)


def test_a_bound_is_drawn_as_an_arrow_and_models_side_by_side_have_the_same(sticking):
    critique, ratio = sticking
    figure, drawn = draw_parameters(critique)
    assert drawn[drawn["parameter"] == "mu"]["std"].isna().all()
    of_mu = next(ax for ax in figure.axes if "μ" in ax.get_xlabel())
    assert any(text.arrow_patch is not None for text in of_mu.texts)
    table = compare_models(critique, ["laws"])
    assert set(table["mu_bound"]) == {"lower"} and table["mu_std"].isna().all() and table["epsilon_bound"].isna().all()
    assert table["mu"].to_numpy() == pytest.approx(ratio, rel=NEAR)
    assert "≥" in models(table) and "nan" not in models(table)
    assert draw_models(table)[1] is table


@pytest.mark.parametrize("slip", [1.5, 0.6])
def test_friction_of_drops_of_which_some_slip_keeps_its_standard_error(slip):
    dataset, ratio = bouncing([EPSILON] * 40, 0.05, np.random.default_rng(4), slip=slip)
    assert ratio == pytest.approx(0.05, rel=1e-6)
    fitted = fit(Model(LAWS["mirtich"], (), takes_time=True), observe(dataset))
    assert fitted.bounds == {}
    assert abs(fitted.values["mu"] - 0.05) < STANDARD_ERRORS * fitted.std["mu"] < 0.01


def test_slip_that_only_unseen_trials_show_is_not_missed():
    dataset, _ = bouncing([EPSILON] * 40, MU, np.random.default_rng(3))
    trials = np.random.default_rng(0).permutation(40)
    held_out = set(trials[:12].tolist())  # as `split` draws them
    quick, _ = bouncing([EPSILON] * 40, 0.08, np.random.default_rng(5), slip=2.0)
    poses = pd.concat(
        [(quick if trial in held_out else dataset).trajectories.query("trial == @trial") for trial in range(40)]
    )
    mixed = type(dataset)("mixed", dataset.header, poses.reset_index(drop=True))
    found = criticise_drops(mixed, rng=np.random.default_rng(0), settings=NO_SEARCH)
    assert set(np.unique(found.held_out.trial).tolist()) == held_out
    base = found.ladder[0][1]
    assert base.bounds == {} and base.values["mu"] == pytest.approx(0.08, abs=0.005)


@pytest.mark.parametrize(
    ("mu", "epsilon", "end", "kind"),
    [(0.0, EPSILON, {"mu": 0.0}, "upper"), (MU, 1.0, {"epsilon": 1.0}, "lower")],
    ids=["no friction", "elastic"],
)
def test_an_estimate_at_the_end_of_its_range_is_a_bound(mu, epsilon, end, kind):
    dataset, _ = bouncing([epsilon] * 12, mu, np.random.default_rng(6))
    fitted = fit(Model(LAWS["mirtich"]), observe(dataset))
    ((name, value),) = end.items()
    bound = replace(fitted, values=fitted.values | end).bounds[name]
    assert bound.kind == kind and abs(bound.value - value) < OF_ONE_IMPACT


def test_what_a_slip_alone_shows_is_not_told_of_a_disk_whose_spin_nobody_saw():
    dataset, _ = bouncing([EPSILON] * 30, MU, np.random.default_rng(7), angle=False)
    o = observe(dataset)
    fitted = fit(Model(LAWS["mirtich"], (), takes_time=True), o)
    assert fitted.bounds["mu"] == Bound("lower", 0.0) and np.isnan(fitted.std["mu"])
    assert abs(fitted.values["epsilon"] - EPSILON) < STANDARD_ERRORS * fitted.std["epsilon"]
    world = Drops(o)
    assert "convex_contact" not in world.reserve and "compliant_contact" in world.reserve
    assert {"anisotropic_friction", "velocity_dependent_friction", "moving_surface"} <= set(world.not_testable)
    terms = proposed.testable_terms(has_angle=False)
    assert terms and not any(term.variables & proposed.OF_SPIN for term in terms)
    assert not {term.target for term in terms} & {"direction", "couple"}
    assert any(term.variables & proposed.OF_SPIN for term in proposed.testable_terms(has_angle=True))


@pytest.mark.parametrize("angle", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_restitution_that_differs_from_trial_to_trial_is_said_with_its_range(angle):
    rng = np.random.default_rng(8)
    epsilon = rng.uniform(0.3, 0.6, 36)
    dataset, _ = bouncing(epsilon, MU, rng, angle=angle)
    critique = criticise_drops(dataset, rng=np.random.default_rng(0), settings=NO_SEARCH)
    content = diagnosis(critique, np.random.default_rng(0))
    assert content["verdict"] == "unexplained" and content["remaining"]["depends_on"] == []
    differs = content["remaining"]["restitution"]
    assert (differs["low"], differs["high"]) == pytest.approx((epsilon.min(), epsilon.max()), abs=OF_ONE_IMPACT)
    said = f"({differs['low']:.2f} to {differs['high']:.2f}) differs from trial to trial but depends on nothing that"
    assert f"Restitution {said}" in " ".join(content["summary"])


def test_restitution_that_is_one_number_does_not_differ_and_within_trials_it_differs_from_impact_to_impact():
    rng = np.random.default_rng(0)
    std, trial, rows = np.full(40, 0.01), np.repeat(np.arange(20), 2), np.arange(40)
    noise = std * rng.standard_normal(40)
    assert OwnRestitution(rows, trial, 0.5 + noise, std, 1.0).differs(1.5) is None
    apart = 0.5 + 0.1 * rng.standard_normal(40)
    assert OwnRestitution(rows, trial, apart, std, 1.0).differs(1.5) == "impact"
    assert OwnRestitution(rows, trial, apart[trial] + noise, std, 1.0).differs(1.5) == "trial"
    assert OwnRestitution(rows, trial, apart, std, 9.0).differs(1.5) is None  # something else is wrong, too


def test_a_law_that_was_given_up_on_the_way_may_have_parameters_of_its_own(sticking):
    critique, _ = sticking
    convex = fit(Model(BASES["convex_contact"], (), takes_time=True), critique.training.single)
    first, last = critique.ladder[0], critique.ladder[-1]
    two = replace(critique, ladder=((first[0], convex, first[2]), ("wear", last[1], last[2])))
    table = draw_parameters(two)[1]
    assert "damping_ratio" in set(table["parameter"])
