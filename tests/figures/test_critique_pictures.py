"""Pictures of the critique: complete, explained, reproducible, and true to the numbers of the critique."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from small_critique import drops, small_critique

from thesis_lib.contact.space import contact_space, measured_impulse, velocity_change
from thesis_lib.critique.drops.questions.where import where
from thesis_lib.critique.results import numbers
from thesis_lib.critique.results.numbers import energy_disc
from thesis_lib.critique.results.tables import ladder
from thesis_lib.critique.results.titles import handy_unit
from thesis_lib.figures.critique import residuals
from thesis_lib.figures.critique.errors import draw_budget, laws_sentence
from thesis_lib.figures.critique.pictures import NAMES, pictures, trials_to_show
from thesis_lib.figures.critique.residuals import Residuals, draw_flights, features_to_show
from thesis_lib.figures.critique.where import boxes_of, inside, map_axes, region_text
from thesis_lib.figures.style import house_style, png_of
from thesis_lib.foundation.columns import explain
from thesis_lib.statistics.wording import number

PARTS = ("noise", "parameters", "rigid_point_contact", "choice_of_law", "rest")
BUDGET = pd.DataFrame({"part": PARTS, "mean_square": [4.0, 1.0, 2.0, 3.0, 10.0], "share": [0.2, 0.05, 0.1, 0.15, 0.5]})
FAST = {"feature": "v_n", "absolute": True, "low": 1.5, "high": None}
AHEAD = {"feature": "r_x", "absolute": False, "low": 0.0, "high": None}
REGION = {"rule": "|v_n| > 1.5 m/s", "conditions": [FAST], "support": 0.4, "ratio": 2.5, "p_value": 0.002}
REGION["on"] = "held_out"
ROUNDING = 1e-9  # relative: the same sums in another order


@pytest.fixture(scope="module")
def critique():
    return small_critique(drops(), ("tangential_restitution", "time_lag"))


@pytest.fixture(scope="module")
def without_effects():
    return small_critique(drops(trajectories=False), ())


@pytest.fixture(scope="module")
def drawn(critique):
    rungs = ladder(critique, np.random.default_rng(0))
    return pictures(critique, {"ladder": rungs, "budget": BUDGET}, {"regions": [REGION]})


def texts(figure):
    return [text.get_text() for text in figure.findobj(match=lambda artist: hasattr(artist, "get_text"))]


@pytest.mark.slow
def test_all_pictures_are_there_with_explained_numbers_and_one_sentence(drawn):
    # without a choice there are no candidates
    assert tuple(drawn) == tuple(name for name in NAMES if name != "candidates")
    for name, (figure, table) in drawn.items():
        explain(name, table.columns)
        assert len(table) and len(figure.get_suptitle()) > 20, name


@pytest.mark.slow
def test_no_title_leaves_its_figure(drawn):
    for name, (figure, _) in drawn.items():
        house_style(figure.draw_without_rendering)()
        assert figure._suptitle.get_window_extent().x1 < figure.bbox.x1, name


@pytest.mark.slow
def test_impacts_alone_without_effects_or_regions_are_drawn(without_effects):
    rungs = ladder(without_effects, np.random.default_rng(0))
    found = pictures(without_effects, {"ladder": rungs, "budget": BUDGET}, where(without_effects))
    assert set(NAMES) - set(found) == {"flights", "candidates"}
    assert "error_after" not in found["where"][1]
    assert np.isnan(without_effects.ladder[0][2].floor)
    assert "noise_floor" not in set(found["ladder"][1]["label"])
    for figure, _ in found.values():
        assert len(png_of(figure)) > 1000
        assert not any("nan" in text for text in texts(figure))


def test_ladder_holds_the_errors_and_bounds_of_the_critique(critique, drawn):
    table = drawn["ladder"][1].set_index("label")
    for label, _, judged in critique.ladder:
        row = table.loc[label]
        assert row["error"] == pytest.approx(judged.error.mean(), rel=ROUNDING)
        assert row["error_low"] < row["error"] < row["error_high"]
    assert table.loc["irb_bound", "error"] == critique.irb
    assert table.loc["no_impact", "error"] == critique.no_impact
    assert table.loc["noise_floor", "error"] == critique.ladder[-1][2].floor


def test_laws_are_sorted_and_none_beats_best_post_hoc(drawn):
    table = drawn["laws"][1].set_index("model")
    laws = table.iloc[:6]["error"]
    assert laws.is_monotonic_increasing and table.loc["best_post_hoc", "error"] <= laws.iloc[0]


def test_the_sentence_on_laws_follows_the_errors():
    table = pd.DataFrame({"model": ["mirtich", "whittaker", "wang_mason"], "error": [1.0, 1.05, 1.08]})
    assert "hardly matters" in laws_sentence(table)
    assert "2 of 3 laws" in laws_sentence(table.assign(error=[1.0, 1.05, 3.0]))
    assert "choice of law matters" in laws_sentence(table.assign(error=[1.0, 2.0, 3.0]))


def test_budget_names_its_largest_part(drawn):
    assert drawn["budget"][0].get_suptitle().startswith("50 %")


def test_energy_disc_maps_what_impacts_do(critique):
    o, fitted = critique.observations, critique.ladder[0][1]
    disc = energy_disc(fitted, o)
    here = fitted.on(o)
    before, after = here.before, here.after
    r = o.rig.shape.contact_point(before.theta)
    v_pre, v_post = (np.stack([s.vx, s.vy, s.omega], axis=1) for s in (before, after))
    space = contact_space(v_pre, r, mass=1.0, k_g=o.rig.k_g)
    alpha = space.alpha(*measured_impulse(v_post - v_pre, r, mass=1.0, k_g=o.rig.k_g))
    np.testing.assert_allclose(np.sum(disc**2, axis=1), alpha, rtol=1e-6)  # squared radius: share of energy left


@pytest.mark.parametrize(("velocity_after", "place"), [(1.0, (0.0, -1.0)), (0.0, (0.0, 0.0)), (-1.0, (0.0, 1.0))])
def test_energy_disc_has_nothing_below_and_reversal_above(without_effects, velocity_after, place):
    o, fitted = without_effects.observations, without_effects.ladder[0][1]
    before = fitted.on(o).before
    r = o.rig.shape.contact_point(before.theta) + o.offset
    space = contact_space(o.slope[:, 0], r, mass=1.0, k_g=o.rig.k_g)
    c_t, c_n = space.impulse_to(velocity_after * space.v_t, velocity_after * space.v_n)
    slope = o.slope.copy()
    slope[:, 1] = slope[:, 0] + velocity_change(c_t, c_n, r, mass=1.0, k_g=o.rig.k_g)
    moved = replace(o, slope=slope)
    np.testing.assert_allclose(energy_disc(fitted, moved), np.broadcast_to(place, (len(o), 2)), atol=1e-6)


def test_regions_are_outlined_where_their_impacts_are():
    rng = np.random.default_rng(1)
    table = pd.DataFrame(
        {"v_t": rng.uniform(-2, 2, 500), "v_n": rng.uniform(-3, 0, 500), "r_x": rng.uniform(-1, 1, 500)}
    )
    slip = {"feature": "v_t", "absolute": True, "low": 0.5, "high": 1.0}
    region = {"conditions": [FAST, slip]}
    boxes = boxes_of(region, ("v_t", "v_n"), (-2.0, 2.0, -3.0, 0.0))
    assert len(boxes) == 2  # sliding ahead and back; v_n is never above zero
    boxed = np.zeros(500, bool)
    for a, b, c, d in boxes:
        boxed |= (table["v_t"] > a) & (table["v_t"] < b) & (table["v_n"] > c) & (table["v_n"] < d)
    assert boxed.any() and (boxed == inside(region, table)).all()


def test_regions_of_other_features_change_the_map_or_are_not_outlined():
    assert map_axes([]) == ("v_t", "v_n")
    assert set(map_axes([{"conditions": [AHEAD]}])) == {"r_x", "v_t"}
    assert map_axes([{"conditions": [FAST, AHEAD]}]) == ("v_n", "r_x")
    assert boxes_of({"conditions": [AHEAD]}, ("v_t", "v_n"), (-1.0, 1.0, -1.0, 0.0)) is None
    assert inside({"conditions": [{**AHEAD, "feature": "t"}]}, pd.DataFrame({"r_x": [1.0]})) is None


def test_a_region_whose_error_is_only_larger_than_its_noise_is_not_said_to_err_more():
    assert "2.5 times" in region_text(REGION) and "held-out impacts" in region_text(REGION)
    assert "all impacts" in region_text({**REGION, "on": "all"})
    assert "times" not in region_text({**REGION, "ratio": 0.8})


def test_dependence_finds_the_feature_and_nothing_in_noise():
    rng = np.random.default_rng(2)
    table = pd.DataFrame({"v_t": rng.standard_normal(800), "omega": rng.standard_normal(800)})
    noise = rng.standard_normal((800, 3))
    noise[:, 1] += 2.0 * table["v_t"]
    shares = Residuals(dict.fromkeys(("tangential", "normal", "couple"), ""), {}, table, {"before": noise}).shares
    assert shares.loc["normal", "v_t"] > 0.6
    assert shares.drop(columns="v_t").to_numpy().max() < 0.03 and shares.loc["couple", "v_t"] < 0.03


def test_each_component_shows_the_feature_on_which_it_depends():
    # two features tell nearly the same of the first component; the second depends on another one
    shares = pd.DataFrame({"v_y": [0.97, 0.0], "y": [0.96, 0.0], "span": [0.9, 0.0], "v_x": [0.0, 0.5]})
    assert features_to_show(shares) == ["v_y", "v_x", "y"]
    # what explains next to nothing is not shown
    assert features_to_show(shares * [1.0, 0.04, 0.04, 0.04]) == ["v_y"]


def test_flights_are_drawn_one_by_one_with_their_misfit(critique, drawn):
    figure, table = drawn["flights"]
    assert len(table) == 2 * len(critique.observations.flights)
    assert "times the noise" in figure.get_suptitle()
    blown = critique.observations.flights
    a = blown.acceleration.copy()
    a[:, 0] -= 20.0 * blown.state.vx * np.sqrt(blown.variance[:, 0])
    windy = replace(critique, observations=replace(critique.observations, flights=replace(blown, acceleration=a)))
    title = draw_flights(windy)[0].get_suptitle().replace("\n", " ")
    assert "horizontal residual depends most on the velocity along the surface v_x" in title


def test_means_of_bins_are_not_cut_by_the_spread_of_others():
    x = np.linspace(0.0, 1.0, 800)
    y = np.where(x > 0.875, 100.0, 0.0) + np.random.default_rng(0).standard_normal(800)
    y[0] = 1e6
    means = residuals._binned(x, y)["mean"].to_numpy()
    assert means[-1] == pytest.approx(100.0, abs=1.0) and np.abs(means[:-1]).max() < 1.0


def test_maps_mark_held_out_impacts_and_title_their_mean(critique, drawn):
    figure, table = drawn["where"]
    held_out = table["held_out"] == 1
    assert held_out.sum() == len(critique.held_out.single)
    mean = table.loc[held_out, "error_before"].mean()
    assert f"{number(mean)} m/s, single hits held out" in " ".join(texts(figure))


def test_parameters_that_move_are_called_out(critique):
    found = numbers.compensations(critique).set_index("parameter")
    assert set(found.index) == {"mu", "epsilon", "tau"}
    first, last = critique.ladder[0][1], critique.ladder[-1][1]
    std = np.hypot(first.std["mu"], last.std["mu"])
    assert found.loc["mu", "sigmas"] == pytest.approx((last.values["mu"] - first.values["mu"]) / std)


def test_a_sure_but_tiny_move_is_no_compensation(critique, monkeypatch):
    rows = [("mu", 0.149, 0.150, 4.1), ("epsilon", 0.5, 0.6, 9.0), ("other", 0.5, 0.6, 2.0)]
    table = pd.DataFrame(rows, columns=["parameter", "before", "after", "sigmas"])
    monkeypatch.setattr(numbers, "compensations", lambda critique: table)
    assert numbers.compensated(critique)["parameter"].tolist() == ["epsilon"]


def test_trials_shown_are_measured_ones(critique, without_effects):
    shown = trials_to_show(critique)
    assert 1 <= len(shown) <= 3 and np.isin(shown, critique.observations.trial).all()
    assert len(trials_to_show(without_effects)) == 0


@pytest.mark.slow
def test_a_picture_saved_twice_is_the_same_picture(drawn):
    for name, (figure, _) in drawn.items():
        assert png_of(figure) == png_of(figure), name


def test_small_lengths_and_angles_are_shown_in_thousandths():
    assert handy_unit(0.0005, "m") == (1e3, "mm") and handy_unit(-0.0358, "rad") == (1e3, "mrad")
    for size, unit in ((0.1, "m"), (0.5, "rad"), (0.0, "m"), (0.001, "1"), (0.001, "m/s")):
        assert handy_unit(size, unit) == (1.0, unit)


def test_a_budget_of_unknown_noise_does_not_call_it_none():
    part = {"part": PARTS, "mean_square": [0.0, 1.0, 2.0, 3.0, 4.0], "share": [0.0, 0.1, 0.2, 0.3, 0.4]}
    assert "noise unknown" in texts(draw_budget(pd.DataFrame(part))[0])
    assert "noise 20 %" in texts(draw_budget(BUDGET)[0])
