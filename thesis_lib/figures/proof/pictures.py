"""All pictures of the proof, by name."""

import pandas as pd

from thesis_lib.critique.proof.table import of_table
from thesis_lib.figures.proof.detection import draw_detection, draw_sizes
from thesis_lib.figures.proof.matrix import draw_matrix
from thesis_lib.figures.proof.recovery import draw_misfits, draw_parameters
from thesis_lib.figures.proof.style import SOURCE_TITLE
from thesis_lib.figures.style import Drawn

NAMES = (*(f"matrix_{source}" for source in SOURCE_TITLE), "detection", "sizes", "misfits", "recovery")


def pictures(outcomes: pd.DataFrame, recovered: pd.DataFrame) -> dict[str, Drawn]:
    """Figures with the tables of the numbers drawn in them, by the names in `NAMES`.

    `outcomes` (a row for each dataset) and `recovered` (a row for each parameter) come from `critique.proof.results`.
    """
    table = of_table(outcomes)
    drawn = {f"matrix_{source}": draw_matrix(table, source) for source in SOURCE_TITLE}
    drawn["detection"] = draw_detection(outcomes)
    drawn["sizes"] = draw_sizes(outcomes)
    drawn["misfits"] = draw_misfits(table)
    drawn["recovery"] = draw_parameters(of_table(recovered))
    return drawn
