"""Chapter 5's model: cone, abstractions and hidden effects are drawn as the tables have them."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.patches import Rectangle

from thesis_lib.thesis.figures.chapter5.model import (
    COLORS,
    MU,
    MU_RANGE,
    abstraction_style,
    figure_5_7,
    figure_abstractions,
    figure_hidden,
)

NAMES = ["no block", "easy move", "hard move", "no move", "drags tower"]
FORCE = {"no block": 0.02, "easy move": 0.12, "hard move": 0.7, "no move": 1.9, "drags tower": 1.3}


def cone() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    parts = []
    for name in NAMES:
        f_n = np.abs(rng.normal(FORCE[name], 0.4 * FORCE[name], 60))
        f_t = rng.normal(0.0, 0.18, 60) * f_n
        inside = (np.abs(f_t) <= MU * f_n).astype(int)
        parts.append(pd.DataFrame({"f_n": f_n, "f_t": f_t, "abstraction": name, "inside": inside}))
    return pd.concat(parts, ignore_index=True)


def height() -> pd.DataFrame:
    rng = np.random.default_rng(1)
    rows = []
    for name in NAMES[1:4]:
        for layer in range(15):
            pred = FORCE[name] * (1.6 - layer / 15)
            rows += [(7.5 + 15 * layer, pred * (1 + 0.2 * rng.normal()), name, pred) for _ in range(3)]
    return pd.DataFrame(rows, columns=["height_mm", "f_n", "abstraction", "f_n_pred"])


def abstractions() -> pd.DataFrame:
    return pd.DataFrame(
        {
            "abstraction": NAMES,
            "share": [0.08, 0.41, 0.17, 0.22, 0.12],
            "force": [FORCE[name] for name in NAMES],
            "rise": [0.01, -0.02, 0.05, 0.48, 0.11],
            "move": [0.05, 0.97, 0.88, 0.21, 0.82],
            "lag": [0.3, 0.12, 0.25, 0.71, 0.33],
            "drag": [0.0, 0.01, 0.04, 0.09, 0.62],
            "stuck_share": [0.4, 0.03, 0.22, 0.97, np.nan],
            "stuck": [0, 0, 0, 1, 1],
        }
    )


def hidden() -> tuple[pd.DataFrame, pd.DataFrame]:
    errors, pushes = [], []
    rng = np.random.default_rng(2)
    for effect, where in (("glued_blocks", range(18, 21)), ("slippery_layer", range(24, 27))):
        for stage, group, error in (
            ("before", "all", 1.35),
            ("before", "failing", 2.9),
            ("relearned", "all", 1.05),
            ("relearned", "failing", 1.3),
        ):
            n = 40 if group == "all" else 6
            errors.append((effect, stage, group, error, error - 2 / n**0.5 / 2, error + 2 / n**0.5 / 2, n))
        for block in rng.choice(45, 30, replace=False):
            fails = int(block in where or rng.uniform() < 0.05)
            pushes.append((effect, int(block), fails, NAMES[int(rng.integers(1, 5))]))
        pushes += [(effect, block, 1, "easy move") for block in where]
    columns = ["effect", "stage", "group", "error", "low", "high", "n"]
    return pd.DataFrame(errors, columns=columns), pd.DataFrame(
        pushes, columns=["effect", "block", "fails", "abstraction"]
    )


def test_abstractions_called_alike_share_a_colour_but_not_a_line():
    styles = abstraction_style(["easy move 1", "easy move 2", "no move 1", "no move 2", "spins"])
    assert styles["easy move 1"][0] == styles["easy move 2"][0] == COLORS["easy move"]
    assert styles["easy move 1"][1] != styles["easy move 2"][1]
    assert styles["no move 2"][0] == COLORS["no move"]
    assert styles["spins"][0] not in COLORS.values()


def test_unknown_abstractions_get_a_colour_each():
    styles = abstraction_style(["zig", "alpha", "mid"])
    assert len({color for color, _ in styles.values()}) == 3


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
    assert len(figure.axes) == 7
    for ax, name in zip(figure.axes, ("share", "force", "rise", "move", "lag", "drag", "stuck_share")):
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
