"""Chapter 5's study: what is drawn is what the tables say, legibly."""

from itertools import pairwise, product

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

from thesis_lib.thesis.figures.chapter5.showcase import PLACED, PUSHED, WOOD, figure_5_5a, figure_game
from thesis_lib.thesis.figures.chapter5.study import (
    GOAL,
    figure_5_5b,
    figure_5_6,
    figure_movable,
    figure_paired,
    policy_style,
)

LEVELS = {"rule": 10.6, "oracle": 15.8, "always_push": 1.2, "exploration": 1.9}


def curve() -> pd.DataFrame:
    final = {"hma": 14.0, "hma_without_cost": 11.5, "mor": 13.0, "network": 9.0, "ppo": 3.0}
    rows = [(name, size, mean * np.log10(size) / 3.0) for name, mean in final.items() for size in (30, 100, 300, 1000)]
    rows += [("ppo", 20000, 5.0), *((name, 0, mean) for name, mean in LEVELS.items())]
    table = pd.DataFrame(rows, columns=["policy", "size", "mean"])
    return table.assign(low=table["mean"] - 0.9, high=table["mean"] + 0.9, n=6)


def pairs() -> pd.DataFrame:
    rows = [
        ("hma", "rule", 100, 1.2, -0.4, 2.9, 20),
        ("hma", "network", 100, 6.3, 4.1, 8.5, 20),
        ("hma", "mor", 100, 4.8, 2.2, 7.1, 6),
        ("hma", "hma_without_cost", 100, 2.4, 0.3, 4.5, 6),
        ("hma", "oracle", 100, -4.2, -6.0, -2.5, 20),
        ("rule", "always_push", 0, 9.4, 7.9, 11.0, 20),
    ]
    table = pd.DataFrame(rows, columns=["policy", "rival", "size", "difference", "low", "high", "n"])
    return table.assign(rival_size=table["size"])


def success() -> pd.DataFrame:
    keys = product(("exploration", "learned"), ("all", "side", "middle"), ("push", "extract", "place"))
    share = np.random.default_rng(2).uniform(0.3, 0.8, 18)
    table = pd.DataFrame(list(keys), columns=["phase", "position", "action"])
    table = table.assign(attempts=40, successes=(40 * share).round(), share=share, published=share + 0.05)
    return table.assign(low=share - 0.1, high=share + 0.1)


def fractions() -> pd.DataFrame:
    rng = np.random.default_rng(1)
    rows = []
    for tower in (*range(5), *range(100, 120)):
        level = 0.455 + 0.04 * rng.normal()
        for mm in np.arange(0.5, 2.01, 0.25):
            share = np.round(45 * (level + 0.05 * (mm - 1.0))) / 45
            rows.append((tower, "development" if tower < 5 else "test", mm, share))
    return pd.DataFrame(rows, columns=["tower", "set", "threshold_mm", "share"])


def tower() -> tuple[np.ndarray, np.ndarray]:
    """A perfect tower of 18 layers; block 3 layer + place."""
    layer, place = np.divmod(np.arange(54), 3)
    across = 25.4e-3 * (place - 1)
    odd = layer % 2 == 1
    x, y = np.where(odd, across, 0.0), np.where(odd, 0.0, across)
    w, z = np.where(odd, np.sqrt(0.5), 1.0), np.where(odd, np.sqrt(0.5), 0.0)
    zero = np.zeros(54)
    poses = np.column_stack([x, y, 7.5e-3 + 15e-3 * layer, w, zero, zero, z])
    return poses, np.tile([75e-3, 25e-3, 15e-3], (54, 1))


def frames() -> tuple[list[np.ndarray], list[int]]:
    """A tower, and the same after block 7 was laid on top and while 22 is out by 33 mm."""
    first, _ = tower()
    second = first.copy()
    second[7, 2] = 277.5e-3
    third = second.copy()
    third[22, 1] += 33e-3
    return [first, second, third], [-1, 7, 22]


def names_of_colours(ax) -> set[str]:
    """Which blocks are in a picture, by the hue of their faces whatever the shade."""
    known = {"wood": WOOD, "pushed": PUSHED, "placed": PLACED}
    hues = np.array([np.array(rgb) / max(rgb) for rgb in known.values()])
    rgb = ax.collections[0].get_facecolors()[:, :3]
    apart = np.abs(rgb[:, None] / rgb.max(axis=1)[:, None, None] - hues).max(axis=2)
    assert apart.min(axis=1).max() < 1e-9
    return {list(known)[k] for k in apart.argmin(axis=1)}


def test_the_pushed_block_stands_out_and_placed_ones_are_found_by_their_height():
    sizes = tower()[1]
    figure, table = figure_5_5a(tower()[0], sizes)
    assert len(table) == 54
    assert names_of_colours(figure.axes[0]) == {"wood"}
    pictures, blocks = frames()
    figure, table = figure_game(pictures, sizes, ["start", "extracted", "pushed"], blocks)
    seen = [names_of_colours(ax) for ax in figure.axes]
    assert seen == [{"wood"}, {"wood", "pushed"}, {"wood", "pushed", "placed"}]
    assert table.groupby("frame").size().tolist() == [54] * 3


def test_learners_are_curves_and_the_others_levels():
    table = curve()
    figure, drawn = figure_5_5b(table)
    ax = figure.axes[0]
    named = {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}
    assert set(named) == {policy_style(p)[3] for p in table.loc[table["size"] > 0, "policy"]}
    mean = table.loc[table["policy"] == "mor", "mean"]
    assert named["MOR"].get_ydata() == pytest.approx(mean.to_numpy())
    levels = {line.get_ydata()[0] for line in ax.lines if len(set(line.get_ydata())) == 1}
    assert {float(GOAL), *LEVELS.values()} <= levels
    assert drawn[drawn["policy"] == "thesis"]["mean"].tolist() == [GOAL]
    assert len(drawn) == len(table) + 1


def test_names_of_close_levels_do_not_cover_each_other():
    table = curve()
    table.loc[table["policy"] == "always_push", ["mean", "low", "high"]] = [10.5, 9.5, 11.5]
    table.loc[table["policy"] == "oracle", ["mean", "low", "high"]] = [10.7, 9.5, 11.5]
    figure, _ = figure_5_5b(table)
    renderer = figure.canvas.get_renderer()
    figure.draw(renderer)
    # of the text alone: an annotation's own extent holds its line, too
    extents = [Text.get_window_extent(text, renderer) for text in figure.axes[0].texts]
    boxes = sorted(extents, key=lambda box: box.y0)
    assert len(boxes) == 5
    assert all(below.y1 <= above.y0 for below, above in pairwise(boxes))


def test_a_difference_is_filled_only_if_its_interval_is_clear_of_zero():
    table = pairs()
    figure, drawn = figure_paired(table)
    filled = {}
    for ax in figure.axes:
        dots = [line for line in ax.lines if line.get_marker() == "o"]
        filled |= {dot.get_xdata()[0]: dot.get_markerfacecolor() != "white" for dot in dots}
    assert filled == {row.difference: row.low > 0 or row.high < 0 for row in table.itertuples()}
    assert list(filled.values()).count(False) == 1
    assert len(drawn) == len(table)


def test_each_number_of_samples_has_its_panel_and_each_rival_its_row():
    ppo = pd.DataFrame([("hma", "ppo", 100, 9.0, 7.0, 11.0, 20)], columns=pairs().columns[:-1])
    at_100 = pd.concat([pairs().head(5), ppo], ignore_index=True)
    table = pd.concat([at_100, at_100.assign(size=1000, difference=at_100["difference"] + 1)])
    other = {"rule": 0, "oracle": 0, "ppo": 20000}
    table["rival_size"] = [other.get(rival, size) for rival, size in zip(table["rival"], table["size"])]
    figure, _ = figure_paired(table)
    assert [ax.get_title("left") for ax in figure.axes] == ["HMA (100) minus", "HMA (1000) minus"]
    rows = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert rows == ["HMA without “no move” cost", "MOR", "network", "PPO (20000)", "oracle", "rule"]


def test_success_has_a_bar_and_a_mark_of_the_thesis_for_each_row():
    table = success()
    # nothing tried: an empty bar, no interval, but still the thesis's mark
    table.loc[0, ["attempts", "successes"]] = 0
    table.loc[0, ["share", "low", "high"]] = np.nan
    figure, drawn = figure_5_6(table)
    ax = figure.axes[0]
    widths = [patch.get_width() for patch in ax.patches if np.isfinite(patch.get_width())]
    assert sorted(widths) == pytest.approx(sorted(100 * table["share"].fillna(0.0)))
    marks = [line.get_xdata()[0] for line in ax.lines if line.get_marker() == "D" and len(line.get_xdata())]
    assert sorted(marks) == pytest.approx(sorted(100 * table["published"]))
    assert "none tried" in {text.get_text() for text in ax.texts}
    assert len(drawn) == 18


def test_movable_shares_show_the_mean_over_towers_at_the_fixed_threshold():
    table = fractions()
    summary = table.groupby(["set", "threshold_mm"], as_index=False)["share"].mean()
    summary = summary.rename(columns={"share": "mean"}).assign(low=summary["share"] - 0.1)
    figure, drawn = figure_movable(table, summary, 1.0)
    own = table[(table["set"] == "test") & (table["threshold_mm"] == 1.0)]["share"].mean()
    assert f" {100 * own:.0f} %" in {text.get_text() for text in figure.axes[1].texts}
    assert len(drawn) == len(table)
