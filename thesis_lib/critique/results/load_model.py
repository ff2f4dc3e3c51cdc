"""Reading of model.json: a file that cannot be used is refused with the reason, whatever it contains."""

from pathlib import Path

import numpy as np
from pydantic import ValidationError

from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.contact_time import CONTACT_TIME
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.critique.results.saved_model import MAX_MODEL, OPTIONAL, SavedModel
from thesis_lib.effects import EFFECTS, require_known
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_json
from thesis_lib.foundation.regular_file import MissingFile, regular_size

MOST = 10  # unknown names that a message lists


def load_model(path: str | Path) -> SavedModel:
    """Read model.json; UserError if it is missing or invalid, or names an unknown law, effect or parameter."""
    try:
        regular_size(path, MAX_MODEL)
        content = read_json(path)
        in_space = isinstance(content, dict) and content.get("dimensions") == 3
        model = (SavedSpaceModel if in_space else SavedModel).model_validate(
            content, context={"folder": Path(path).parent}
        )
    except MissingFile as error:
        raise UserError(
            f"There is no model {path}. A critique writes model.json: thesis-lib critique DATASET -o DIR"
        ) from error
    except ValidationError as error:
        lines = [f"{path} is not a model that this program wrote:"]
        for item in error.errors(include_url=False)[:20]:
            lines.append(f"  {'.'.join(map(str, item['loc']))[:200] or '(top level)'}: {item['msg']}")
        raise UserError("\n".join([*lines, "Write it again with thesis-lib critique."])) from error
    if model.law not in BASES:
        remedy = _remedy(model, model.law) or f"known are {', '.join(BASES)}"
        raise UserError(f"{path}: there is no law {model.law[:60]!r}; {remedy}.")
    for name in model.effects:
        if name not in EFFECTS:
            remedy = _remedy(model, name) or (
                "thesis-lib effects lists them, and --effects FILE.py adds those in your own file"
            )
            raise UserError(f"{path}: there is no effect {name[:60]!r}; {remedy}.")
    try:
        require_known(model.effects, model.rig.walls)
    except UserError as error:
        raise UserError(f"{path}: {error}") from error
    needed, given = set(model.model.parameters), set(model.parameters)
    if needed != given:
        lacks, other = sorted(needed - given), [name[:60] for name in sorted(given - needed)]
        more = f" and {len(other) - MOST} more" if len(other) > MOST else ""
        said = [f"missing parameter(s): {', '.join(lacks)}"] * bool(lacks)
        said += [f"unknown parameter(s): {', '.join(other[:MOST])}{more}"] * bool(other)
        raise UserError(f"{path}: {'; '.join(said)}. Write it again.")
    tau = CONTACT_TIME
    if tau.name in needed and not tau.low <= (lasts := model.values[tau.name]) <= tau.high:
        raise UserError(f"{path}: tau must be between {tau.low:g} and {tau.high:g} s; got {lasts:g}.")
    for name, p in model.model.parameters.items():
        if (unit := model.parameters[name].unit) != p.unit:
            raise UserError(f"{path}: {name} must be in {p.unit}, not in {unit[:20]!r}.")
    try:
        with np.errstate(all="ignore"):
            model.after(model.measured({name: -np.ones(1) for name in (*model.columns, *OPTIONAL)}))
    except (ArithmeticError, ValueError) as error:  # for example sizes of 1e308 m
        raise UserError(f"{path} holds numbers that cannot be computed with ({error}). Write it again.") from error
    return model


def _remedy(model: SavedModel, name: str) -> str:
    """Origin of a law or an effect that is not loaded, and how to load it; "" if the model does not state it."""
    if (origin := model.origins.get(name)) is None:
        return ""
    return f"it came from {origin} and is not loaded: {origin.remedy}"
