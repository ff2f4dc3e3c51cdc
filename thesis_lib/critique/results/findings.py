"""Findings of a critique as data, computed once; folder, page and figures are made from them.

If impacts are too few for a verdict, diagnosis.json gives restitution, friction, and the data that a verdict needs.  It
has the keys of every diagnosis (`diagnosis`), with null for verdict and errors and no effects, and `restitution` with
value, std, unit and the number of impacts; std is null if unknown.  In space, `reason` states why there is no verdict,
and `recording` contains sentences on flights and rests alone.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.few_impacts import LAW, FewImpacts
from thesis_lib.critique.drops.questions.where import where
from thesis_lib.critique.likelihood.channels import ALWAYS
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.results.candidates import Choice, candidates, choices, choices_table
from thesis_lib.critique.results.diagnosis import diagnosis, left_out, parameters
from thesis_lib.critique.results.saved_in_space import saved_in_space
from thesis_lib.critique.results.saved_model import SavedModel, saved
from thesis_lib.critique.results.summary import much_left_out
from thesis_lib.critique.results.tables import few_tables, tables
from thesis_lib.datasets.checks.in_space import motion_facts
from thesis_lib.datasets.checks.tracked_pose import tracked_frame_told
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.impacts.found import MIN_IMPACTS, MIN_TRIALS, are_enough
from thesis_lib.datasets.space.flights import too_slow
from thesis_lib.effects import effects_in
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation.files import six_digits
from thesis_lib.statistics.wording import bounded, plural

PLACES = 4  # decimals of a coefficient
ERRORS = ("base", "augmented", "irb_bound", "irb_bound_augmented", "noise_floor", "noise_floor_single", "no_impact")


def few_diagnosis(few: FewImpacts) -> dict:
    """Content of diagnosis.json for too few impacts, rounded to six digits."""
    o, (value, std) = few.observations, few.restitution
    n, m = len(o), len(np.unique(o.trial))
    model = {"name": LAW, "parameters": few_parameters(few)}
    why = f"too few impacts ({n} in {plural(m, 'trial')}; {MIN_IMPACTS} in {MIN_TRIALS} are needed)"
    slow = "" if few.source is None or o.space.is_plane or not o.arcs else too_slow(few.source.rate)
    if slow:
        why = f"too slow for a verdict ({plural(n, 'usable impact')} in {plural(m, 'trial')}). {slow[:-1]}"
    needed = _what_is_needed(n, m)
    if slow:
        needed = "For a verdict on the contact model, record at 100 Hz or more."
    elif are_enough(n, m):
        why = f"too few impacts: only {len(o.single)} of {n} stand alone, and models are judged by those"
        needed = "For a verdict on the contact model, record at a higher rate and unfiltered: hits follow quickly."
    shown = [] if o.space.is_plane else _recording(few)
    nothing: dict = dict.fromkeys((*ERRORS, "explained_share", *ALWAYS))
    ends = {f"{name}_interval": [None, None] for name in ("base", "augmented")}
    unknown = {"error": None, "interval": [None, None], "unit": "m/s"}
    content = {
        "schema": 1,
        "dataset": few.dataset,
        "n_impacts": n,
        "n_trials": m,
        "verdict": None,
        "restitution": {"value": value, "std": std, "unit": "1", "n_impacts": n and (len(few.each.epsilon) or n)},
        "base_model": model,
        "augmented_model": model,
        "effects": [],
        "error": {"unit": "m/s", **nothing, **ends, "worst": []},
        "remaining": {
            "structured": False,
            "channels": [],
            **dict.fromkeys(("p_value", "error", "error_without_it", "restitution")),
            **{name: [] for name in ("depends_on", "stand_ins")},
        },
        "not_testable": [{"name": name, "why": why} for name in effects_in(o.space)],
        "left_out": left_out(o),
        "detectable": [],
        "next_experiment": {"why": needed, "states": []},
        "laws": {name: {"parameters": parameters(fitted), **unknown} for name, fitted in few.laws.items()},
    }
    if not o.space.is_plane:
        content |= {"dimensions": o.space.dimension, "reason": why, "recording": shown}
    if (low_pass := o.found.low_pass) is not None:
        content["low_pass"] = low_pass.content()
    content["summary"] = [*_summary(content, why), *shown]
    return six_digits(content)


def _recording(few: FewImpacts) -> list[str]:
    """Sentences on what flights and rests of a body in space show by themselves."""
    source = few.source
    if source is None or source.trajectories is None:
        return []
    facts, said = motion_facts(source.trajectories, source.in_space), []
    if facts.fall is not None:
        size = with_error(float(np.linalg.norm(facts.fall)), facts.fall_error)
        said.append(
            f"{plural(facts.flights, 'free flight')} fall{'s' * (facts.flights == 1)} by {size} m/s², and "
            f"{source.gravity:.4g} is stated as gravity."
        )
    if told := tracked_frame_told(source, compare=True):
        said.append(f"{told[0].upper()}{told[1:]}.")
    return said


def few_parameters(few: FewImpacts) -> dict[str, dict]:
    """Parameters of the law, with restitution and its standard error from all impacts; empty without impacts."""
    if not few.laws:
        return {}
    value, std = few.restitution
    found = parameters(few.fitted)
    if "bound" not in found["epsilon"]:
        found["epsilon"] |= {"value": value, "std": std if np.isfinite(std) else None}
    return found


def _summary(content: Mapping, why: str) -> list[str]:
    of, found = content["restitution"], content["base_model"]["parameters"]
    first = f"{why.replace('too few impacts', 'Too few impacts for a verdict', 1).replace('too slow', 'Too slow', 1)}."
    last = (*much_left_out(content), content["next_experiment"]["why"])
    if not found:
        return [first, *last]
    epsilon, mu = found["epsilon"], found["mu"]
    scatter = "standard error, including the scatter of trials"
    if epsilon.get("bound"):
        restitution = f"Restitution is {bounded(epsilon)}"
    elif np.isfinite(of["std"]):
        trials = content["n_trials"]
        scatter = scatter if trials > 1 else "standard error without scatter of trials, as there is only one"
        restitution = f"Restitution {with_error(of['value'], of['std'])} ({scatter})"
    else:
        restitution = f"Restitution {of['value']:.3g}, from one impact whose noise is not stated"
    friction = (
        f"Friction: mu {with_error(mu['value'], mu['std'])}." if mu["std"] else "These impacts do not show friction."
    )
    if mu.get("bound") and not (mu["bound"] == "lower" and mu["value"] <= mu["range"][0]):
        friction = f"Friction: mu {bounded(mu)}" + (
            ", the largest ratio of impulses." * (mu["bound"] == "lower") or "."
        )
    return [first, f"{restitution}.", friction, *last]


def with_error(value: float, std: float) -> str:
    """Text “value ± standard error”, to two digits of the error and at most `PLACES` decimals."""
    places = int(np.clip(1 - np.floor(np.log10(std)), 0, PLACES)) if std > 0.0 else PLACES
    return f"{value:.{places}f} ± {max(std, 10.0**-PLACES):.{places}f}"


def _what_is_needed(n: int, m: int) -> str:
    """Sentence on how many more trials a verdict needs."""
    if not n:
        return (
            f"For a verdict on the contact model, record trials with impacts: {MIN_IMPACTS} in {MIN_TRIALS} are needed."
        )
    trials = max(MIN_TRIALS, int(np.ceil(MIN_IMPACTS * m / n))) - m
    each = f"{n / m:.2g} usable impact{'' if n == m else 's'}"
    return (
        f"For a verdict on the contact model, record about {trials} more trials like these, with {each} in each; for "
        "restitution alone, these are enough."
    )


@dataclass(frozen=True)
class Findings:
    """Attributes:
    diagnosis: content of diagnosis.json.
    tables: tables by file name.
    regions: content of where.json; None if regions are not searched for.
    model: content of model.json; None for a mechanism and, in space, without the dataset.
    choices: models with each combination of the effects found and their closest rival.
    """

    diagnosis: dict
    tables: dict[str, pd.DataFrame]
    regions: dict | None = None
    model: SavedModel | None = None
    choices: Sequence[Choice] = ()


def findings(critique: DropsCritique, rng: np.random.Generator, models: pd.DataFrame | None = None) -> Findings:
    """All findings of a critique of drops; `models`: the table of `compare_models`, if models were compared.

    `rng` draws regions, intervals and trial states: equal streams give equal numbers.
    """
    regions = where(critique, rng)
    made = tables(critique, rng)
    content = diagnosis(critique, rng, made["ladder"])
    if models is not None:
        made["models"] = models
        content["models"] = json.loads(models.to_json(orient="records"))
    if len(tried := candidates(critique)):
        made["candidates"] = tried
    if switched := choices(critique, tried):
        made["choices"] = choices_table(switched)
    model = saved_of(critique.ladder[-1][1], critique.observations.rig, critique.dataset, critique.source)
    return Findings(content, made, regions, model, switched)


def few_findings(few: FewImpacts) -> Findings:
    """Findings on too few impacts for a verdict."""
    model = None
    if few.laws:
        model = saved_of(few.fitted, few.observations.rig, few.dataset, few.source, few_parameters(few))
    return Findings(few_diagnosis(few), few_tables(few), model=model)


def saved_of(
    fitted: Fit, rig: Rig, name: str, source: Dataset | None, parameters: Mapping[str, Mapping] | None = None
) -> SavedModel | None:
    """Content of model.json; None for a body in space without its dataset, `source`."""
    if rig.space.is_plane:
        return saved(fitted, rig, name, parameters)
    return None if source is None else saved_in_space(fitted, source.in_space, name, parameters)
