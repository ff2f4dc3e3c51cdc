"""What a critique leaves behind as data, computed once: what its folder, its page and its pictures are made of."""

import json
from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.few_impacts import FewImpacts
from thesis_lib.critique.drops.questions.where import where
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.critique.results.few_impacts import few_diagnosis, few_parameters
from thesis_lib.critique.results.saved_model import SavedModel, saved
from thesis_lib.critique.results.tables import few_tables, tables


@dataclass(frozen=True)
class Findings:
    """Attributes:
    diagnosis: content of diagnosis.json.
    tables: by the name of their file.
    regions: content of where.json, None where regions are not looked for.
    model: content of model.json, None of a mechanism.
    """

    diagnosis: dict
    tables: dict[str, pd.DataFrame]
    regions: dict | None = None
    model: SavedModel | None = None


def findings(critique: DropsCritique, rng: np.random.Generator, models: pd.DataFrame | None = None) -> Findings:
    """All of a critique of drops; `models`: the table of `compare_models`, where models were compared.

    `rng` draws regions, intervals and trial states: equal streams give equal numbers.
    """
    regions = where(critique, rng)
    made = tables(critique, rng)
    content = diagnosis(critique, rng, made["ladder"])
    if models is not None:
        made["models"] = models
        content["models"] = json.loads(models.to_json(orient="records"))
    model = saved(critique.ladder[-1][1], critique.observations.rig, critique.dataset)
    return Findings(content, made, regions, model)


def few_findings(few: FewImpacts) -> Findings:
    """Those of impacts that are too few for a verdict."""
    model = saved(few.fitted, few.observations.rig, few.dataset, few_parameters(few))
    return Findings(few_diagnosis(few), few_tables(few), model=model)
