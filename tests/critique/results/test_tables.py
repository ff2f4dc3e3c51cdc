"""The tables agree with the critique that they tell of, the budget is one, and what was found leads the candidates."""

import numpy as np
import pytest
from hidden_effects import injected_impacts

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.questions.class_tests import velocities
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.results.candidates import FOUND, OTHER, candidates, choices, choices_table
from thesis_lib.critique.results.tables import _bounds, left_out_impacts, tables
from thesis_lib.critique.selection.discovery import KEPT
from thesis_lib.figures.critique.candidates import draw_candidates

ROUNDING = 1e-12
QUICK = 0.3  # relative: a quick fit ends near the full one
PARTS = ("noise", "parameters", "rigid_point_contact", "choice_of_law", "rest")


def test_comparison_has_laws_model_bounds_and_baseline(drops_tables, hidden_drops):
    table = drops_tables["comparison"].set_index("model")
    expected = [*SIX_LAWS, "augmented", "best_post_hoc", "irb_bound", "no_impact"]
    assert list(table.index) == expected
    for name in SIX_LAWS:
        assert table.loc[name, "mean"] == pytest.approx(hidden_drops.laws[name].error.mean(), rel=1e-9)
        assert 0.0 <= table.loc[name, "share_in_range"] <= 1.0
    assert (table["n_failed"] == 0).all()
    best = table.loc[list(SIX_LAWS), "mean"].min()
    assert table.loc["best_post_hoc", "mean"] <= best + ROUNDING
    assert table.loc["augmented", "mean"] < 0.3 * best
    assert table.loc["irb_bound", "mean"] < table.loc["best_post_hoc", "mean"]
    assert table.loc["no_impact", "mean"] > 10.0 * best
    assert table.loc["irb_bound", ["mu", "score"]].isna().all()


def test_the_error_vector_in_the_contact_frame_holds_the_whole_error(drops_tables, hidden_drops):
    o, table = hidden_drops.observations, drops_tables["errors"]
    assert list(table["model"].unique()) == ["base", "augmented"]
    assert len(table) == 2 * len(o)
    base = table[table["model"] == "base"]
    _, _, r = velocities(hidden_drops.ladder[0][1], o)
    order = np.lexsort((o.impact, o.trial))
    r, k_g = r[order], o.rig.k_g
    # (normal, tangential, couple) = T (δv_x, δv_y, δω), undone impact by impact
    one, zero = np.ones(len(o)), np.zeros(len(o))
    T = np.stack(
        [
            np.stack([zero, one, r[:, 0]], axis=1),
            np.stack([one, zero, -r[:, 1]], axis=1),
            np.stack([r[:, 1], -r[:, 0], k_g**2 * one], axis=1) / k_g,
        ],
        axis=1,
    )
    parts = base[["error_normal", "error_tangential", "error_couple"]].to_numpy()
    back = np.linalg.solve(T, parts[:, :, None])[:, :, 0]
    assert velocity_error(back, k_g) == pytest.approx(base["error"].to_numpy(), rel=1e-6)
    held_out = base.loc[base["held_out"] == 1, "error"]
    assert held_out.mean() == pytest.approx(hidden_drops.ladder[0][2].error.mean(), rel=1e-9)


def test_flights_are_there_with_residuals_in_units_of_noise(drops_tables, hidden_drops, hidden_impacts):
    o, table = hidden_drops.observations, drops_tables["flights"]
    assert list(table["model"].unique()) == ["base", "augmented"]
    assert len(table) == 2 * len(o.flights) > 100
    base = table[table["model"] == "base"]
    # the base law has nothing but gravity
    a_y = base["residual_y"] * np.sqrt(o.flights.variance[:, 1]) - o.rig.gravity
    assert a_y.to_numpy() == pytest.approx(o.flights.acceleration[:, 1])
    assert set(base.loc[base["held_out"] == 1, "trial"]) <= set(hidden_drops.held_out.trial)
    sigma = base["misfit"].median()
    assert 0.6 < sigma < 1.3  # friction is hidden, and nothing in flight
    assert "flights" not in tables(hidden_impacts, np.random.default_rng(0))


def test_the_ladder_falls_and_brackets_its_errors(drops_tables, hidden_drops):
    table = drops_tables["ladder"]
    assert table["label"].tolist() == ["no effect", "anisotropic_friction"]
    assert (table["error_low"] < table["error"]).all() and (table["error"] < table["error_high"]).all()
    assert table.loc[1, "error_high"] < table.loc[0, "error_low"]
    assert np.isnan(table.loc[0, "gain"]) and table.loc[1, "gain_low"] > 0.0
    fall = table.loc[1, "score"] - table.loc[0, "score"]
    assert table.loc[1, "gain"] == pytest.approx(fall, rel=1e-9)


def test_impacts_lists_used_and_left_out_ones_once(drops_tables, hidden_drops):
    o, table = hidden_drops.observations, drops_tables["impacts"]
    assert table["used"].sum() == len(o)
    assert table["hits"].sum() == len(o.found.arcs)
    assert len(table) == len(table[["trial", "impact"]].drop_duplicates())
    out = table[table["used"] == 0]
    assert len(out) == len(left_out_impacts(o)) > 0 and (out["reason"] != "").all()
    assert (table.loc[table["used"] == 1, "reason"] == "").all()
    assert table.loc[table["used"] == 1, "cov_vx_pre_vx_pre"].gt(0).all()


def test_the_budget_sums_to_the_mean_square_without_the_worst_impacts(drops_tables, nothing_tables, hidden_drops):
    for table in (drops_tables["budget"], nothing_tables["budget"]):
        assert tuple(table["part"]) == PARTS
        assert (table["mean_square"] >= 0.0).all()
        assert table["share"].sum() == pytest.approx(1.0)
    error = np.sort(hidden_drops.ladder[0][2].error[hidden_drops.held_out.span == 0.0])  # of single hits
    kept = error[: round(0.98 * len(error))]
    assert drops_tables["budget"]["mean_square"].sum() == pytest.approx(np.mean(kept**2))


def test_the_budget_blames_noise_where_nothing_is_hidden_and_the_law_where_friction_is(drops_tables, nothing_tables):
    nothing = nothing_tables["budget"].set_index("part")["share"]
    # of some 30 held-out impacts a single one at 2.5 sigma may pass for a fault of the contact; nothing else may
    assert nothing["noise"] > 0.5 and nothing.drop(["noise", "rigid_point_contact"]).sum() < 0.15
    hidden = drops_tables["budget"].set_index("part")["share"]
    # any (μ, ε) of its own explains an impact with another friction: no part of it is beyond rigid point contact
    assert hidden["rigid_point_contact"] < 0.05
    assert hidden["choice_of_law"] + hidden["rest"] > 0.9


def test_a_mirrored_camera_is_beyond_rigid_point_contact():
    data = injected_impacts("one", 100, 2, "mirrored_rotation", {"mirrored_rotation.mirrored": 1.0})
    o = observe(data)
    base = fit(Model(LAWS["anitescu_potra_newton"]), o)
    squares, irb, _ = _bounds(base, [base], o)
    _, made_irb, _ = _bounds(base, [base], synthesise(base.on(o), np.random.default_rng(0)))
    assert irb > 0.5 * squares and made_irb < 0.01 * irb


def test_what_was_hidden_leads_and_the_others_have_a_reason(hidden_drops):
    table = candidates(hidden_drops)
    assert 2 <= len(table) <= KEPT and table["effect"].is_unique and table["gain"].is_monotonic_decreasing
    first, others = table.iloc[0], table[table["standing"] == OTHER]
    assert (first["effect"], first["standing"]) == ("anisotropic_friction", FOUND)
    assert first["why"].startswith("lowers errors of velocities after impact")
    assert len(others) and others["why"].ne("").all() and (others["gain"] < 0.5 * first["gain"]).all()
    # the same gain as from one rung of the ladder to the next
    before, after = (judged for _, _, judged in hidden_drops.ladder[:2])
    assert first["gain"] == pytest.approx((after.total - before.total) / after.units, rel=QUICK)
    assert first["gain_low"] > 0.0


def test_without_a_cause_no_candidate_predicts_better(nothing_hidden):
    table = candidates(nothing_hidden)
    assert (table["standing"] == OTHER).all() and table["gain"].max() < 0.2
    drawn = draw_candidates(nothing_hidden, table)
    assert drawn is not None and ", but " in drawn[0].get_suptitle().replace("\n", " ")
    assert np.isfinite(drawn[1][["gain", "gain_low", "gain_high"]]).all(axis=None)
    assert choices(nothing_hidden, table) == []  # nothing to switch


def test_each_choice_of_effects_has_its_error(hidden_drops):
    table = candidates(hidden_drops)
    made = choices(hidden_drops, table)
    rival = table["effect"][table["standing"] == OTHER].iloc[0]
    found = "anisotropic_friction"
    assert [one.effects for one in made] == [(), (found,), (rival,), (found, rival)]
    assert made[0].judged is hidden_drops.ladder[0][2] and made[1].judged is hidden_drops.ladder[-1][2]
    assert made[2].fitted.base == hidden_drops.discovery.base and made[3].fitted.base == made[1].fitted.base
    errors = choices_table(made)["error"].to_numpy()
    # the rival mends next to nothing, with the effect or without it
    assert errors[1] < 0.5 * errors[0] and errors[2] > 0.7 * errors[0] and errors[3] < 0.5 * errors[0]
