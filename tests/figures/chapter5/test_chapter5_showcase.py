"""Chapter 5's showcase pushes: belief and steering are drawn as the tables have them."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from thesis_lib.thesis.figures.chapter5.showcase import (
    ARROW,
    LENGTH,
    SHOWN,
    WIDE,
    figure_5_8,
    figure_5_9,
    outline_from_above,
)

NAMES = ("no block", "easy move", "hard move", "no move")


def showcase() -> pd.DataFrame:
    """Readings are the same for every abstraction, its predictions and belief its own."""
    table = pd.DataFrame(list(product(("stuck", "easy"), NAMES, range(20))), columns=["case", "abstraction", "step"])
    read = table["step"] * table["case"].map({"stuck": 0.45, "easy": 0.02})
    own = np.random.default_rng(0).uniform(size=(len(table), 4))
    table[["belief", "belief_nuts", "f_n_pred", "x_pred"]] = own
    return table.assign(belief_nuts=table["belief_nuts"].where(table["step"] % 5 == 0), f_n=read, x=0.5 * read)


def steering() -> pd.DataFrame:
    t = np.arange(36)
    table = pd.DataFrame({"step": t, "advance": t.astype(float), "x": 0.93 * t, "yaw": 1.6 * np.sin(t / 9)})
    y, controlled = 0.5 * np.cos(t / 7), (t >= 8).astype(int)
    offset, heading = np.linspace(-8.0, 8.0, len(t)), np.linspace(0.15, -0.15, len(t))
    return table.assign(y=y, offset=offset, heading=heading, controlled=controlled, steered=1)


def test_belief_readings_and_predictions_have_their_own_panels():
    table = showcase()
    figure, drawn = figure_5_8(table)
    assert len(figure.axes) == 6
    # first row: predictions of four abstractions and the reading, for stuck and easy
    for ax, case in zip(figure.axes[:2], ("stuck", "easy")):
        own = table[(table["case"] == case) & (table["abstraction"] == "no move")]
        lines = [line.get_ydata() for line in ax.lines if len(line.get_ydata())]
        assert len(lines) == len(NAMES) + 1
        assert lines[NAMES.index("no move")] == pytest.approx(own["f_n_pred"].to_numpy())
        assert lines[-1] == pytest.approx(own["f_n"].to_numpy())
    labels = {text.get_text() for text in figure.legends[0].get_texts()}
    assert set(NAMES) <= labels and len(labels) == len(NAMES) + 2
    assert len(drawn) == len(table)


def test_one_case_is_enough():
    table = showcase()
    figure, _ = figure_5_8(table[table["case"] == "easy"])
    assert len(figure.axes) == 3


def test_a_block_from_above_keeps_its_size_and_turns_about_its_centre():
    outline = outline_from_above(10.0, -4.0, 0.3)
    sides = np.linalg.norm(np.diff(outline, axis=0), axis=1)
    assert sides == pytest.approx([LENGTH, WIDE, LENGTH, WIDE])
    assert outline[:-1].mean(axis=0) == pytest.approx([10.0, -4.0])
    along = outline[1] - outline[0]
    assert np.arctan2(along[1], along[0]) == pytest.approx(0.3)


def test_the_pusher_touches_the_end_face_where_the_controller_chose():
    table = steering()
    figure, drawn = figure_5_9(table, exaggeration=2.0)
    assert drawn["shown"].sum() == SHOWN
    rows = table[drawn["shown"].to_numpy() == 1]
    for ax, row in zip(figure.axes[:SHOWN], rows.itertuples()):
        contact = next(line for line in ax.lines if line.get_marker() == "o")
        across, along = contact.get_xdata()[0], contact.get_ydata()[0]
        start, *_, end = outline_from_above(row.x, 2.0 * row.y, 2.0 * row.yaw / 23.0)[[0, 3]]
        # on the end face, `offset` from its middle
        off = np.array([along, across]) - 0.5 * (start + end)
        assert np.linalg.norm(off) == pytest.approx(abs(row.offset))
        assert off @ (end - start) / WIDE == pytest.approx(row.offset)
        arrow = next(text for text in ax.texts if text.arrow_patch is not None)
        vector = np.array(arrow.xy) - np.array(arrow.xyann)
        assert np.linalg.norm(vector) == pytest.approx(ARROW)
        assert np.arctan2(vector[0], vector[1]) == pytest.approx(2.0 * row.heading)
