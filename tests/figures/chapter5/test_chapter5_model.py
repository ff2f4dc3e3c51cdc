"""Chapter 5's model: cone, abstractions and hidden effects are drawn as the tables have them."""

from itertools import product

import numpy as np
import pandas as pd
import pytest
from matplotlib.patches import Rectangle

from thesis_lib.thesis.figures.chapter5.model import (
    COLORS,
    MU,
    MU_RANGE,
    QUANTITIES,
    abstraction_style,
    figure_5_7,
    figure_abstractions,
    figure_hidden,
)

NAMES = ["no block", "easy move", "hard move", "no move", "drags tower"]
FORCE = {"no block": 0.02, "easy move": 0.12, "hard move": 0.7, "no move": 1.9, "drags tower": 1.3}


def cone() -> pd.DataFrame:
    rng, table = np.random.default_rng(0), pd.DataFrame({"abstraction": np.repeat(NAMES, 60)})
    f_n = table["abstraction"].map(FORCE) * rng.uniform(0.2, 1.8, len(table))
    f_t = rng.normal(0.0, 0.18, len(table)) * f_n
    return table.assign(f_n=f_n, f_t=f_t, inside=(f_t.abs() <= MU * f_n).astype(int))


def height() -> pd.DataFrame:
    """Three pushes of each layer."""
    rows = [(7.5 + 15.0 * layer, name) for name in NAMES[1:4] for layer in np.repeat(range(15), 3)]
    table = pd.DataFrame(rows, columns=["height_mm", "abstraction"])
    pred = table["abstraction"].map(FORCE) * (1.6 - table["height_mm"] / 225.0)
    return table.assign(f_n_pred=pred, f_n=pred * np.random.default_rng(1).uniform(0.6, 1.4, len(table)))


def abstractions() -> pd.DataFrame:
    values = np.random.default_rng(3).uniform(-0.1, 1.0, (len(NAMES), len(QUANTITIES)))
    values[4, -1] = np.nan
    return pd.DataFrame(values, columns=list(QUANTITIES)).assign(abstraction=NAMES, stuck=[0, 0, 0, 1, 1])


def hidden() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors and pushes; the lowest blocks are not pushed."""
    effects = {"glued_blocks": range(18, 21), "slippery_layer": range(24, 27)}
    keys = product(effects, ("before", "relearned"), ("all", "failing"))
    errors = pd.DataFrame(list(keys), columns=["effect", "stage", "group"])
    errors = errors.assign(error=[1.35, 2.9, 1.05, 1.3] * 2, n=40)
    pushes = [
        (effect, block, int(block in where), NAMES[1 + block % 4])
        for effect, where in effects.items()
        for block in range(9, 45)
    ]
    errors = errors.assign(low=errors["error"] - 0.2, high=errors["error"] + 0.2)
    return errors, pd.DataFrame(pushes, columns=["effect", "block", "fails", "abstraction"])


def test_abstractions_called_alike_share_a_colour_but_not_a_line():
    styles = abstraction_style(["easy move 1", "easy move 2", "no move 1", "no move 2"])
    assert styles["easy move 1"][0] == styles["easy move 2"][0] == COLORS["easy move"]
    assert styles["easy move 1"][1] != styles["easy move 2"][1]
    assert styles["no move 2"][0] == COLORS["no move"]
    # unknown ones get a colour each
    unknown = {color for color, _ in abstraction_style(["zig", "alpha", "mid"]).values()}
    assert len(unknown - set(COLORS.values())) == 3


def test_the_cone_is_that_of_the_friction_coefficients():
    figure, drawn = figure_5_7(cone(), height())
    left = figure.axes[0]
    slopes = sorted(line.get_ydata()[1] / line.get_xdata()[1] for line in left.lines if len(line.get_xdata()) == 2)
    expected = sorted([s * mu for mu in (MU, *MU_RANGE) for s in (-1, 1)])
    assert slopes == pytest.approx(expected)
    inside = 100 * cone().groupby("abstraction")["inside"].mean()
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend[1] == f"easy move ({inside['easy move']:.0f} % inside)"
    assert drawn["panel"].value_counts().to_dict() == {"A": len(cone()), "B": len(height())}


def test_the_line_over_height_is_the_model():
    figure, _ = figure_5_7(cone(), height())
    line = next(line for line in figure.axes[1].lines if line.get_label() == "hard move")
    predicted = height()[height()["abstraction"] == "hard move"].groupby("height_mm")["f_n_pred"].mean()
    assert line.get_ydata() == pytest.approx(predicted.to_numpy())


def test_each_abstraction_has_a_bar_in_each_panel():
    table = abstractions()
    figure, _ = figure_abstractions(table)
    for ax, name in zip(figure.axes, QUANTITIES, strict=True):
        widths = [patch.get_width() for patch in ax.patches]
        assert widths == pytest.approx(table[name].fillna(0.0).tolist())
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert [label.endswith("*") for label in labels] == [False, False, False, True, True]


def test_failing_blocks_are_where_the_effect_is():
    errors, pushes = hidden()
    figure, drawn = figure_hidden(errors, pushes)
    right = figure.axes[1]
    cells = [patch for patch in right.patches if isinstance(patch, Rectangle)]
    assert len(cells) == 45
    coloured = {int(3 * cell.get_y() + cell.get_x()) for cell in cells if np.ptp(cell.get_facecolor()[:3]) > 0.05}
    own = pushes[(pushes["effect"] == "glued_blocks") & (pushes["fails"] == 1)]
    assert coloured == set(own["block"]) and {18, 19, 20} <= coloured
    blocks = drawn[(drawn["panel"] == "blocks") & (drawn["effect"] == "glued_blocks")]
    assert blocks["failed"].sum() == len(own)
    assert drawn[drawn["panel"] == "error"]["error"].tolist() == errors["error"].tolist()


def test_an_effect_without_relearning_or_other_blocks_is_drawn_as_it_is():
    errors, pushes = hidden()
    errors = errors.replace({"group": {"all": "others", "failing": "affected"}})
    alone = errors["effect"] == "glued_blocks"
    errors = errors[~alone | ((errors["stage"] == "before") & (errors["group"] == "affected"))]
    figure, _ = figure_hidden(errors, pushes)
    dots = [[line for line in ax.lines if len(line.get_xdata()) == 1] for ax in figure.axes[::2]]
    assert list(map(len, dots)) == [1, 4]
    # no interval leaves a panel
    assert all(ax.get_ylim()[1] > errors["high"].max() for ax in figure.axes[::2])
    labels = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"before", "relearned", "fails: easy move", "as predicted", "not pushed"} <= labels
