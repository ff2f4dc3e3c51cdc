"""All pictures of one critique, by name."""

from collections.abc import Mapping

import pandas as pd

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.figures.critique.data import draw_data
from thesis_lib.figures.critique.errors import draw_budget, draw_ladder, draw_laws, draw_parameters
from thesis_lib.figures.critique.models import draw_models
from thesis_lib.figures.critique.residuals import BINS, draw_flights, draw_residuals
from thesis_lib.figures.critique.where import draw_where
from thesis_lib.figures.style import Drawn, house_style

NAMES = ("data", "laws", "budget", "where", "residuals", "flights", "ladder", "parameters")


@house_style
def pictures(
    critique: DropsCritique, tables: Mapping[str, pd.DataFrame] | None, where: Mapping | None
) -> dict[str, Drawn]:
    """Figures with the tables of the numbers drawn in them, by the names in `NAMES`.

    `tables`: `ladder`, `comparison` (IRB bound), `budget` and `models`; `where`: content of where.json.  The pictures
    of the error budget and of flights are left out without table `budget` or enough flights, that of models without
    its table.
    """
    tables = tables or {}
    drawn = {"data": draw_data(critique), "laws": draw_laws(critique)}
    if "budget" in tables:
        drawn["budget"] = draw_budget(tables)
    drawn |= {"where": draw_where(critique, where), "residuals": draw_residuals(critique)}
    if len(critique.observations.flights) > BINS:
        drawn["flights"] = draw_flights(critique)
    drawn |= {"ladder": draw_ladder(critique, tables), "parameters": draw_parameters(critique)}
    if "models" in tables:
        drawn["models"] = draw_models(tables["models"])
    return drawn
