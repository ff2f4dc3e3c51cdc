"""Comparison of laws and physics engines on one object, without and with the named effects.

Every model is fitted to the training trials of a critique and judged on its held-out trials.  An engine that cannot
have one of the effects is fitted without it, and the table lists this effect.

In space each engine has a compliant law (`engine_contact.STAND_INS`) that gives the same contact, to a few thousandths
of the velocity change of a hit.  The law is fitted instead of the engine, which takes minutes instead of hours, and the
engine is judged on hits with the parameters of the law.  Whole held-out tosses are also predicted by the law.

`model_sentences` states which model is best, and why.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pandas as pd
from scipy.optimize import minimize_scalar

from thesis_lib.contact.compliant.normal_force import NormalForce
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.engine_contact import (
    DEFAULT,
    IN_SPACE,
    MASS,
    STAND_INS,
    WITH_DEFAULT,
    default_values,
    engine_law,
    lacks,
)
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.sliding import require_falling
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.engines.fit import EngineFit, fit_engine
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import ROUNDS, Fit, fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.results.titles import effect_title, law_title
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects.effect import Effect
from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.intervals import clustered_mean
from thesis_lib.statistics.wording import listed, number

LAWS = "laws"
MODELS = (LAWS, *STAND_INS)
COLUMNS = (
    *("model", "kind", "effects", "lacks", "mu", "mu_std", "epsilon", "epsilon_std", "contact_time"),
    *("mu_bound", "epsilon_bound"),
    *("error", "error_low", "error_high", "behind", "behind_low", "behind_high", "noise_floor"),
)
OF_TOSSES = {"position": "pos_int_percent", "angle": "angle_int_deg"}  # in space, each with _low and _high
FRICTIONS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 1.0, 1.5)  # from which a search starts
WITHOUT, WITH = "without", "with"


def read_models(text: str) -> tuple[str, ...]:
    """Names in a list of models, "laws,mujoco,drake"; UserError for unknown ones, or if Bullet is not installed."""
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if unknown := [name for name in names if name not in MODELS]:
        raise UserError(f"--models: there is no {', '.join(map(repr, unknown))}; known are {', '.join(MODELS)}.")
    if not names:
        raise UserError(f"--models needs at least one of {', '.join(MODELS)}.")
    if "bullet" in names and not find_spec("pybullet"):
        from thesis_lib.engines.bullet_engine import PACKAGE

        raise UserError(f"--models bullet needs a package that is not installed: pip install {PACKAGE}.")
    return names


def require_models(dataset: Dataset, names: Sequence[str]) -> None:
    """Raise a UserError if the models cannot be compared on the dataset; a critique first would take minutes."""
    walls = (dataset.header.surfaces or ()) if dataset.space.is_plane else ()
    require_falling(dataset.gravity, dataset.has_angle, walls, "--models")
    lacking = [name for name in names if not dataset.space.is_plane and name not in (LAWS, *IN_SPACE)]
    if lacking:
        raise UserError(
            f"--models has no {listed(lacking)} for bodies in space; {listed([LAWS, *IN_SPACE])} can be compared there."
        )
    if not dataset.space.is_plane and dataset.impacts is not None and set(names) - {LAWS}:
        raise UserError(
            "--models compares engines in space by trajectories: impacts.csv does not show how long contacts last. "
            "Give trajectories.csv alone, or compare laws."
        )


def compare_models(
    critique: DropsCritique, names: Sequence[str], say: Callable[[str], None] = lambda text: None
) -> pd.DataFrame:
    """Table of all models without the named effects and, if the critique named some, with them; best first.

    Columns: `COLUMNS`; in m/s error with its 95 % interval, and its excess over the best with the same effects,
    compared impact by impact; `mu_bound`, `epsilon_bound`: lower or upper if there is only a bound; contact time in
    s at 1 m/s (NaN if contacts are taken as instants: engines then have `engine_contact.INSTANT`); `lacks`:
    effects that the model cannot have, by name.  In space, for whole tosses, also `position` in % of the width and
    `angle` in degrees, means over the frames of a toss (`simulation.rollout`), with their intervals.  UserError if an
    engine is not installed.
    """
    engines, space = [name for name in names if name in STAND_INS], critique.observations.space
    final = critique.ladder[-1][1]
    # the laws of the critique, and the law of its final model
    laws = dict.fromkeys([*Drops(critique.training, critique.settings).bases, final.base])
    sets = {WITHOUT: (), WITH: final.effects} if final.effects else {WITHOUT: ()}
    source = critique.source
    follows = source is not None and not space.is_plane and source.trajectories is not None
    follows = follows and len(source.in_space.planes) == 1  # pyright: ignore[reportOptionalMemberAccess]
    columns = [*COLUMNS, *([f"{name}{end}" for name in OF_TOSSES for end in ("", "_low", "_high")] if follows else ())]
    parts = []
    for label, effects in sets.items():
        rows, errors = [], []
        for name in [*(laws if LAWS in names else ()), *engines]:
            say(f"fitting {engine_law(name).title if name in STAND_INS else BASES[name].title} {label} effects")
            missing = lacks(name, effects, space) if name in STAND_INS else []
            own = tuple(effect for effect in effects if effect.name not in missing)
            kept = {effect.name for effect in own}
            start = {key: value for key, value in final.values.items() if key.split(".")[0] in kept}
            found = [("engine" if name in STAND_INS else "law", _fitted(critique, name, own, start))]
            if name in WITH_DEFAULT and critique.observations.arcs:
                found += zip(("default", "friction"), _default(critique, name, own, start))
            for kind, fitted in found:
                row, error = _judged(critique, fitted)
                rows.append(row | {"kind": kind, "effects": label, "lacks": " + ".join(missing)})
                if follows:
                    rows[-1] |= whole_tosses(critique, fitted.model, fitted.values)
                errors.append(error)
        best = errors[int(np.argmin([error.mean() for error in errors]))]
        behind = [clustered_mean(error - best, critique.held_out.trial) for error in errors]
        part = pd.DataFrame(rows).assign(noise_floor=critique.ladder[-1][2].floor)
        part[["behind", "behind_low", "behind_high"]] = np.array(behind)
        parts.insert(0, part.sort_values("error", kind="stable"))
    return pd.concat(parts, ignore_index=True)[columns]


def whole_tosses(critique: DropsCritique, model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """Errors of a model in space on whole held-out tosses, from their first flights: `OF_TOSSES`, with intervals.

    NaN if no first flight is observed.
    """
    from thesis_lib.critique.results.saved_in_space import saved_in_space
    from thesis_lib.critique.simulation.rollout import rolled_out_by
    from thesis_lib.critique.simulation.tosses import toss

    assert critique.source is not None  # as `compare_models` requires
    engine = model.law.name.removesuffix(DEFAULT)
    model = replace(model, law=BASES[STAND_INS[engine][0]] if engine in STAND_INS else model.law)
    numbers = {name: {"value": values[name], "std": None, "unit": p.unit} for name, p in model.parameters.items()}
    near = replace(critique.ladder[-1][1], model=model, values=dict(values))
    saved = saved_in_space(near, critique.source.in_space, critique.source.name, numbers)
    trials = np.unique(critique.held_out.trial).tolist()
    found = {f"{name}{end}": np.nan for name in OF_TOSSES for end in ("", "_low", "_high")}
    try:
        tosses = rolled_out_by(toss, saved, critique.source, trials)
    except UserError:
        return found
    for name, column in OF_TOSSES.items():
        means = clustered_mean(tosses[column].to_numpy(), tosses.index.to_numpy())
        found |= dict(zip((name, f"{name}_low", f"{name}_high"), means))
    return found


def _fitted(
    critique: DropsCritique, name: str, effects: tuple[Effect, ...], start: Mapping[str, float]
) -> Fit | EngineFit:
    """One model fitted to the training trials."""
    base = STAND_INS[name][0] if name in STAND_INS else name
    model = replace(critique.ladder[-1][1].model, law=BASES[base], effects=effects)
    law = replace(fit(model, critique.training, start, rounds=ROUNDS), seen=critique.observations)
    if name not in STAND_INS:
        return law
    if model.space.is_plane:
        return fit_engine(name, law, critique.training)
    return EngineFit(replace(model, law=engine_law(name)), law.values, dict(law.std), law.bounds)


def _default(
    critique: DropsCritique, name: str, effects: tuple[Effect, ...], start: Mapping[str, float]
) -> list[EngineFit]:
    """An engine with its default contact, at its default friction and at the friction that suits the training trials
    best; the effects are as the critique fitted them."""
    body = critique.source.header.body if critique.source else None
    values = {**default_values(name, (body.mass if body else None) or MASS), **start}
    model = replace(critique.ladder[-1][1].model, law=engine_law(f"{name}{DEFAULT}"), effects=effects, takes_time=True)
    suited = values | {"mu": best_friction(model, values, critique.training)}
    return [EngineFit(model, numbers, dict.fromkeys(values, 0.0)) for numbers in (values, suited)]


def _judged(critique: DropsCritique, fitted: Fit | EngineFit) -> tuple[dict[str, object], np.ndarray]:
    """Parameters of a model with its mean held-out error, and the errors (n,) in m/s."""
    model, values = fitted.model, fitted.values
    error = held_out_error(model, values, critique.held_out)
    row: dict[str, object] = {"model": model.law.name, "contact_time": np.nan}
    if model.takes_time:
        row["contact_time"] = values["tau"] * (model.law.force or NormalForce()).lasting(values["epsilon"])
    for one in ("mu", "epsilon"):
        bound = fitted.bounds.get(one)
        told = (values[one], fitted.std[one], None) if bound is None else (bound.value, np.nan, bound.kind)
        row |= dict(zip((one, f"{one}_std", f"{one}_bound"), told))
    return row | dict(zip(("error", "error_low", "error_high"), clustered_mean(error, critique.held_out.trial))), error


def best_friction(model: Model, values: Mapping[str, float], observations: Observations) -> float:
    """The μ with the least mean error of a model, all other parameters fixed, as friction is often fitted."""

    def error(log_mu: float) -> float:
        return float(held_out_error(model, {**values, "mu": float(np.exp(log_mu))}, observations).mean())

    grid = np.log(FRICTIONS)
    errors = [error(log_mu) for log_mu in grid]
    i = int(np.argmin(errors))
    around = grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)]
    found = minimize_scalar(error, bounds=around, method="bounded", options={"xatol": 0.01})
    return float(np.exp(found.x if found.fun < errors[i] else grid[i]))


def held_out_error(model: Model, values: Mapping[str, float], observations: Observations) -> np.ndarray:
    """Error (n,) in m/s, by the kinetic norm, of each predicted velocity after impact."""
    dv = Comparison(model, values, observations).R[:, : observations.space.motions]
    return observations.norm(dv)


def spread(table: pd.DataFrame, label: str, kind: str = "engine") -> float:
    """Largest μ of the engines over the smallest; NaN with fewer than two that have an estimate.

    `kind`: "friction" for the default contact.
    """
    mu = table[(table["kind"] == kind) & (table["effects"] == label) & table["mu_bound"].isna()]["mu"]
    return float(mu.max() / mu.min()) if len(mu) > 1 else np.nan


ALIKE = 1.1  # ratio of friction coefficients up to which engines agree
FITTED = ("law", "engine")


def model_title(name: str) -> str:
    """Title of a law or an engine."""
    return engine_law(name).title if name.removesuffix(DEFAULT) in STAND_INS else law_title(name)


def row_title(row: Mapping) -> str:
    """Title of a row of the table."""
    return model_title(str(row["model"])) + (", friction fitted" if row["kind"] == "friction" else "")


def bounded_text(row: Mapping, name: str, digits: int) -> str:
    """μ or ε of a row to some decimals, with ≥ or ≤ before a bound."""
    return {"lower": "≥ ", "upper": "≤ "}.get(row[f"{name}_bound"], "") + f"{row[name]:.{digits}f}"


def missed_tosses(row: Mapping) -> list[str]:
    """Texts of the errors of position and angle on whole tosses, in a row of the table; – if unknown."""
    units = {"position": " %", "angle": "°"}
    return [f"{number(row[name])}{unit}" if pd.notna(row[name]) else "–" for name, unit in units.items()]


def model_sentences(table: pd.DataFrame) -> list[str]:
    """Sentences on the model with the least error, on friction in the engines, and on effects that they lack."""
    label = WITH if (table["effects"] == WITH).any() else WITHOUT
    last = table[(table["effects"] == label) & table["kind"].isin(FITTED)]
    best = last.iloc[0]
    alike = [model_title(row["model"]) for row in last.iloc[1:].to_dict("records") if row["behind_low"] <= 0.0]
    named = " with the named effects" if label == WITH else ""
    first = f"{model_title(best['model'])} errs least{named}: {number(best['error'])} m/s"
    if np.isfinite(best["noise_floor"]):
        first += f" (noise floor {number(best['noise_floor'])} m/s)"
    if len(last) > 1:
        first += f"; {listed(alike)} cannot be told from it" if alike else "; all others err more"
    first += "."
    sentences = [first]
    before, after = spread(table, WITHOUT), spread(table, WITH)
    if np.isfinite(before):
        second = f"The engines' friction coefficients differ by a factor of {before:.3g}"
        if np.isfinite(after):
            second += f" without the named effects, and of {after:.3g} with them"
            if before > ALIKE >= after:
                second += ": they compensated for what was missing"
        sentences.append(f"{second}.")
    if np.isfinite(plain := spread(table, WITHOUT, "friction")):
        rows = table[(table["kind"] == "friction") & (table["effects"] == WITHOUT)].to_dict("records")
        each = listed([f"{row['mu']:.2g} in {model_title(row['model'].removesuffix(DEFAULT))}" for row in rows])
        sentences.append(
            f"With the default contact of each, and only friction fitted, they differ by a factor of "
            f"{plain:.2g}: {each}."
        )
    for row in table[(table["effects"] == label) & (table["kind"] == "default")].to_dict("records"):
        ratio = row["error"] / float(last[last["model"] == row["model"].removesuffix(DEFAULT)]["error"].iloc[0])
        sentences.append(
            f"{model_title(row['model'])} errs by {number(row['error'])} m/s, {ratio:.2g} times as much as fitted."
        )
    for row in last[last["lacks"] != ""].to_dict("records"):
        effects = listed([effect_title(name) for name in row["lacks"].split(" + ")])
        sentences.append(f"{model_title(row['model'])} cannot have {effects}, and is fitted without.")
    return sentences
