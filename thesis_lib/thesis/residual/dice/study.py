"""Study of thrown dice: resting positions predicted by several contact models from measured starts of held-out throws.

Throws are divided into disjoint parts; each part is held out once, and the others are used for training.  All fits and
choices (`_train`) are repeated for each part, with its training throws alone.

| model               | body, flight          | contact                                                              |
|---------------------|-----------------------|----------------------------------------------------------------------|
| law                 | as assumed, no drag   | the law with least error on isolated training impacts, as in ch. 3   |
| residual            | as assumed, no drag   | that law + rigid residual on X1                                      |
| residual_wrench     | as assumed, no drag   | that law + wrench residual on X1                                     |
| critique            | model.json            | the critique's law with its effects                                  |
| compliant           | `fit`                 | body and springs fitted to training contacts by simulation           |
| compliant_residual  | `fit`                 | compliant over 12 ms + its learned residual (`contact_map`)          |

Each belief (predictive distribution) draws its start from the measured covariance; contacts are uncertain by training
residuals: laws scatter in proportion to c_n, compliant models in proportion to the speed.  Each model is also simulated
once without uncertainty, as in the thesis.  `tables` defines the scores.

The thesis has 750 throws, of which 500 are public.  For compliant models, the friction of sliding and of the slowest
contacts is the value on a grid with the least mean |error| of training throws; other models slide with the law's μ.

The candidate mechanisms were found in the residuals of all throws, when the study was first written.  Later, part 0 was
set apart: it is drawn with its own seed (`parts_seed`), new ideas were tried on the throws of the other parts alone,
and part 0 was opened after that.  docs/findings.md lists later changes.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import streams
from thesis_lib.thesis.residual.dice.budget import budget
from thesis_lib.thesis.residual.dice.data import LongFlights, MeasuredContacts, ThrowReleases, flight_drag, read_throws
from thesis_lib.thesis.residual.dice.fit import DiceModel, choose_mechanisms, fit_dice
from thesis_lib.thesis.residual.dice.models import (
    Thrower,
    contact_map,
    critique_model,
    law_models,
    mean_miss,
    noise_limit,
    perturbed,
    scattered,
    single_hits,
    throw_starts,
    train_missed,
)
from thesis_lib.thesis.residual.dice.settings import DiceStudySettings
from thesis_lib.thesis.residual.dice.tables import HeldOutThrows, contact_pits, impact_pits, throw_rows
from thesis_lib.thesis.residual.throwing.propagation import LearnedImpact


@dataclass(frozen=True)
class DiceStudy:
    """Results of one held-out part.

    Its `tables` by name:

    | table                | contents                                                                              |
    |----------------------|---------------------------------------------------------------------------------------|
    | throws, limit        | a row per model and held-out throw; likewise for the limit due to noise               |
    | parameters           | parameters of all models                                                              |
    | laws                 | training errors of the six laws on isolated impacts; the study uses the best          |
    | contact_pits         | PIT and misfit of each held-out contact (isolated impact, for learned impacts)        |
    | budget               | contributions to the error (`budget`)                                                 |
    | counts               | numbers of throws, contacts and impacts used and left out                             |
    """

    releases: ThrowReleases  # all measured releases, for training and held out
    held: "Measured"  # measurements of the held-out throws
    contacts: MeasuredContacts  # of all throws not used in training, including those without a usable release
    outcomes: dict[str, HeldOutThrows]  # held-out throws by name of the model
    tables: dict[str, pd.DataFrame]


def dice_study(
    dataset: Dataset,
    hits: pd.DataFrame,
    impacts: Impacts,
    critique: SavedModel | None,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> list[DiceStudy]:
    """Study a dataset of throws of a square; one result for each held-out part that is evaluated.

    `hits` has trial and t (s) of all detected hits (arcs.csv), `impacts` the isolated measured impacts (impacts.csv);
    `critique` is the critique's model (model.json) or None to omit it.
    Raises UserError if the shape is not a square, or the critique's model has effects that throws do not support.
    """
    side = side_of(dataset)
    believed = DiceModel(side / 2, 0.0, dataset.height, dataset.k_g, "mirtich", 0.1, 0.5, dataset.gravity)
    criticised = None if critique is None else critique_model(critique, side)
    dataset = dataset.first_trials(settings.throws)
    trials = dataset.trials
    hits, impacts = hits[hits["trial"].isin(trials)], impacts.select(np.isin(impacts.trial, trials))
    measured = Measured(*read_throws(dataset, hits, settings.data), impacts)
    parts = parts_of(np.unique(measured.releases.trial), settings)[: settings.judged]
    studies = []
    for i, (part, part_rng) in enumerate(zip(parts, rng.spawn(len(parts)))):
        studies.append(_one_part(believed, criticised, measured, part, settings, part_rng))
        print(f"part {i}: {dict(studies[-1].tables['counts'].to_numpy().tolist())}")
    return studies


def parts_of(trials: np.ndarray, settings: DiceStudySettings) -> list[np.ndarray]:
    """Divide the throws `trials` (n,) into disjoint parts, each ascending."""
    drawn = np.random.default_rng(settings.parts_seed).permutation(trials)
    return [np.sort(part) for part in np.array_split(drawn, settings.parts)]


@dataclass(frozen=True)
class Measured:
    """Measurements of a set of throws."""

    releases: ThrowReleases
    contacts: MeasuredContacts
    flights: LongFlights
    impacts: Impacts

    def of(self, trials: np.ndarray) -> "Measured":
        """Return the measurements of the throws `trials` (n,)."""
        return Measured(
            *(part.select(np.isin(part.trial, trials)) for part in (self.releases, self.contacts, self.flights)),
            self.impacts.select(np.isin(self.impacts.trial, trials)),
        )


def _one_part(
    believed: DiceModel,
    criticised: DiceModel | None,
    measured: Measured,
    part: np.ndarray,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> DiceStudy:
    """Train all models on the throws outside `part`, and evaluate them on the throws in `part`."""
    side = 2.0 * believed.half
    train_rng, _, named_rng = rng.spawn(3)  # the second is no longer used; the third keeps its random numbers
    stream = streams(named_rng)
    train = np.setdiff1d(measured.releases.trial, part)
    training, held = measured.of(train), measured.of(part)
    throwers, law_errors, outliers = _train(believed, criticised, training, settings, train_rng)
    law_model = throwers[0].model

    outcomes = {t.name: throw_held_out(t, held.releases, settings, stream("throw", t.name)) for t in throwers}
    isolated = single_hits(law_model, held.impacts, settings)
    pits, limits = [], []
    for t in throwers:
        learned_impact = isinstance(t.contact, LearnedImpact)
        pits.append(impact_pits(t, isolated) if learned_impact else contact_pits(t, held.contacts, settings))
        limits.append(noise_limit(t, held.releases, side, settings, stream("limit", t.name)).assign(model=t.name))
    counts = {
        "throws": len(measured.releases) + sum(measured.releases.left_out.values()),
        "used": len(measured.releases),
        **measured.releases.left_out,
        "train": len(train),
        "held_out": len(held.releases.trial),
        "contacts": len(measured.contacts),
        "contacts_of_a_throw": int(np.median(np.unique(measured.contacts.trial, return_counts=True)[1])),
        "contact_outliers": outliers,
        "training_impacts": len(training.impacts),
        "training_single_hits": len(single_hits(law_model, training.impacts, settings)),
    }
    rows = [throw_rows(outcome, held.releases, side, stream("rows", name)) for name, outcome in outcomes.items()]
    tables = {
        "throws": pd.concat(rows, ignore_index=True),
        "limit": pd.concat(limits, ignore_index=True),
        "parameters": pd.concat([_parameters(t) for t in throwers], ignore_index=True),
        "laws": law_errors,
        "contact_pits": pd.concat(pits, ignore_index=True),
        "budget": budget(throwers, training.releases, held.releases, held.contacts, side, settings, stream("budget")),
        "counts": pd.DataFrame(counts.items(), columns=["counted", "count"]),
    }
    untrained = measured.contacts.select(~np.isin(measured.contacts.trial, train))
    return DiceStudy(measured.releases, held, untrained, outcomes, tables)


def _train(
    believed: DiceModel,
    criticised: DiceModel | None,
    training: Measured,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> tuple[list[Thrower], pd.DataFrame, int]:
    """Train all models; return them, the errors of the six laws, and the number of outlying contacts."""
    law_rng, named_rng = rng.spawn(2)
    stream = streams(named_rng)
    throwers, law_errors = law_models(believed, training.impacts, training.contacts, settings, law_rng)
    if criticised is not None:
        throwers.append(scattered("critique", criticised, training.contacts, settings))
    c_v, c_w = flight_drag(training.flights)
    start = replace(believed, law=throwers[0].model.law, c_v=c_v, c_w=c_w)
    mechanisms = choose_mechanisms(start, training.contacts, stream("mechanisms"), settings.fit)
    fitted, _ = fit_dice(start, training.contacts, stream("fit"), settings.fit, mechanisms)
    outliers = 0
    for name, learned in (("compliant", False), ("compliant_residual", True)):
        missed, outliers = train_missed(fitted, training.contacts, settings, stream("missed", name), learned)
        made = [contact_map(name, replace(fitted, mu=mu), missed, settings) for mu in settings.slide_grid]
        throwers.append(min(made, key=lambda thrower: mean_miss(thrower, training.releases, settings)))
    return throwers, law_errors, outliers


def throw_held_out(
    thrower: Thrower, releases: ThrowReleases, settings: DiceStudySettings, rng: np.random.Generator
) -> HeldOutThrows:
    """Simulate all held-out throws by one model, with and without uncertainty."""
    model = thrower.model
    certain = throw_starts(model, thrower.certain, releases.q, releases.v, settings.throw, rng)
    q, v = perturbed(releases, settings.particles, rng)
    out = throw_starts(model, thrower.contact, q, v, settings.throw, rng)
    shape = (len(releases.trial), settings.particles)
    velocity = (out.snapshot_v[0] * np.array([1.0, 1.0, model.k_g])).reshape(*shape, 3)
    spread = np.sqrt(np.nanvar(velocity, axis=1).sum(-1))
    return HeldOutThrows(thrower, out.q[:, 0].reshape(shape), out.face.reshape(shape), certain, spread)


def side_of(dataset: Dataset) -> float:
    """Length in m of the square's side; UserError unless it is centred with sides along the body's axes."""
    shape = dataset.shape
    if isinstance(shape, Polygon) and len(shape.vertices) == 4:
        p = np.array(shape.vertices)
        sides = np.linalg.norm(p - np.roll(p, 1, axis=0), axis=1)
        if np.ptp(sides) < 1e-6 * sides[0] and np.allclose(np.abs(p), sides[0] / 2):
            return float(sides[0])
    raise UserError(f"{dataset.name}: the study of dice needs a centred square with sides along the body's axes.")


def _parameters(thrower: Thrower) -> pd.DataFrame:
    """Parameters of a model: model, parameter, value."""
    model = thrower.model
    items = {**vars(model), **(vars(model.contact) if model.contact else {})}.items()
    rows = [(thrower.name, name, float(value)) for name, value in items if isinstance(value, float)]
    return pd.DataFrame(rows, columns=["model", "parameter", "value"])
