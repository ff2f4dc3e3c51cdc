"""Chapter 5's model: cone and abstractions are drawn as the tables have them."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.figures.chapter5.model import COLORS, MU, MU_RANGE, abstraction_style, figure_5_7, figure_abstractions

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
