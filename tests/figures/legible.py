"""No text of a schematic is small, covers another one or leaves the figure; nothing is out of scale."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

SMALLEST_TEXT = 7.0  # pt


def assert_legible(figure: Figure) -> None:
    """No text is small, covers another one or leaves the figure."""
    renderer = figure.canvas.get_renderer()
    figure.draw(renderer)
    texts = [text for ax in figure.axes for text in ax.texts if text.get_text()]
    boxes = [text.get_window_extent(renderer) for text in texts]
    assert texts and min(text.get_fontsize() for text in texts) >= SMALLEST_TEXT
    for i, box in enumerate(boxes):
        assert box.x0 >= 0.0 and box.y0 >= 0.0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
        for text, other in zip(texts[:i], boxes[:i]):
            assert not box.overlaps(other), f"{texts[i].get_text()} covers {text.get_text()}"


def assert_schematic(figure: Figure, table: pd.DataFrame) -> None:
    """A legible drawing to scale, of finite points."""
    assert_legible(figure)
    assert all(ax.get_aspect() == 1.0 for ax in figure.axes)
    assert np.isfinite(table[["x", "y"]].to_numpy()).all()
