"""Chapter 4's figures of ellipsoid and errors draw what was computed."""

import numpy as np
import pandas as pd
import pytest
from small_study import BODY

from thesis_lib.contact.space import velocity_change, velocity_error
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.figures.chapter3.contact_space import EXAMPLE
from thesis_lib.thesis.figures.chapter4.ellipsoid import figure_4_1, figure_4_2
from thesis_lib.thesis.figures.chapter4.errors import CLASSES, NAMED_STYLE, figure_4_5, figure_4_6, figure_named_physics

LAW = "anitescu_potra_newton"
MODELS = [LAW, "best_post_hoc", "irb_bound", *(name for names in CLASSES.values() for name in names)]
MASS, K_G = BODY.mass, BODY.radius_of_gyration


def _summary(models):
    rows = [
        (m, n, 1.0 / n + 0.1 * i, 0.9 / n + 0.1 * i, 1.1 / n + 0.1 * i)
        for i, m in enumerate(models, 1)
        for n in (10, 100)
    ]
    return pd.DataFrame(rows, columns=["model", "n", "mean", "low", "high"])


def test_wrenches_on_the_ellipsoid_keep_the_energy():
    _, table = figure_4_2(BODY)
    v = np.array(EXAMPLE.v)
    r = EXAMPLE.contact_point(BODY)
    dv = velocity_change(table["c_t"].to_numpy(), table["c_n"].to_numpy(), r, mass=MASS, k_g=K_G)
    dv[:, 2] += table["tau_over_k"].to_numpy() / (MASS * K_G)
    np.testing.assert_allclose(velocity_error(v + dv, K_G), velocity_error(v, K_G), rtol=1e-9)
    normal = (v + dv)[:, 1] + r[:, 0] * (v + dv)[:, 2]
    speed = velocity_error(v, K_G)
    assert (normal[table["series"] == "feasible"] > -1e-9 * speed).all()
    assert (normal[table["series"] == "penetrates"] < 1e-9 * speed).all()
    np.testing.assert_allclose(normal[table["series"] == "maximum compression"], 0.0, atol=1e-9 * speed)


def test_the_cut_without_couple_is_the_energy_ellipse():
    _, table = figure_4_2(BODY)
    cut = table[table["series"].str.startswith("energy ellipse")]
    np.testing.assert_allclose(cut["tau_over_k"], 0.0, atol=1e-12)
    space = EXAMPLE.space(BODY)
    np.testing.assert_allclose(space.alpha(cut["c_t"].to_numpy(), cut["c_n"].to_numpy()), 1.0, rtol=1e-9)
    _, flat = figure_4_1(BODY)
    ellipse = flat[flat["series"] == "energy ellipse"]
    for column in ("c_t", "c_n"):
        assert cut[column].max() == pytest.approx(ellipse[column].max(), rel=2e-3)


def test_densities_integrate_to_the_share_below():
    rng = np.random.default_rng(0)
    parts = [
        pd.DataFrame({"model": m, "error": rng.gamma(2.0, 0.1 * (i + 1), 400), "n": 450}) for i, m in enumerate(MODELS)
    ]
    _, table = figure_4_5(pd.concat(parts), LAW)
    for _, curve in table[table["panel"] == "density"].groupby(["variant", "model"]):
        area = np.trapezoid(curve["density"], curve["error"])
        assert 0.85 < area < 1.01
    shares = table[(table["panel"] == "cumulative") & (table["model"] == "rigid_x1")]
    median = shares.loc[(shares["share_below"] - 0.5).abs().idxmin(), "error"]
    assert median == pytest.approx(parts[MODELS.index("rigid_x1")]["error"].median(), rel=0.05)


def test_a_model_that_always_fails_is_named():
    table = pd.DataFrame({"model": MODELS, "error": [np.nan] + [0.1] * (len(MODELS) - 1), "n": 450})
    with pytest.raises(UserError, match=LAW):
        figure_4_5(table, LAW)


def test_curves_are_those_of_the_table():
    summary = _summary(MODELS)
    figure, table = figure_4_6(summary, LAW)
    assert set(table["model"]) == set(MODELS)
    drawn = {line.get_label(): line.get_ydata() for line in figure.axes[0].get_lines()}
    np.testing.assert_array_equal(drawn["wrench, X1"], summary.loc[summary["model"] == "wrench_x1", "mean"])


@pytest.mark.parametrize("floor", [None, 0.01])
def test_named_physics_shows_all_rungs_and_the_floor_where_known(floor):
    names = [*NAMED_STYLE, "irb_bound", "irb_bound_effects"]
    rungs = _summary(names).query("n == 100")
    figure, table = figure_named_physics(rungs, _summary(NAMED_STYLE), ["mirrored rotation"], floor)
    widths = {round(bar.get_width(), 9) for bar in figure.axes[0].patches}
    assert widths == {round(rungs.set_index("model").loc[name, "mean"], 9) for name in NAMED_STYLE}
    assert ("noise_floor" in set(table["model"])) == (floor is not None)
