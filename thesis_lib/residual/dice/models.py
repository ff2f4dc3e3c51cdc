"""Contact models that can be thrown: the law, its residuals, the critique's, and those fitted to training contacts.

A `Thrower` joins a body in flight, its uncertain contact, and that contact without uncertainty.  What a model misses is
measured on contacts between two flights, double hits included.  The model runs for the time T after the first touch,
the flight after the contact is traced back to that time, and the difference is

    residual = ((Δx, Δy, k Δθ)/(s T), (Δv_x, Δv_y, k Δω)/s),    s = √(v_x² + v_y² + k² ω²) at the touch

Its size (1.48 median |.|) is the scatter of a law; a Gaussian process of it is the contact map (`contact_map`).

| on paper | in code    | unit | shape  | meaning                                             |
|----------|------------|------|--------|-----------------------------------------------------|
| T        | `duration` | s    |        | of the contact map                                  |
|          | `residual` | 1    | (m, 6) | see above                                           |
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.errors import UserError
from thesis_lib.impact_study.cost import target_of
from thesis_lib.impact_study.ensemble import fit_ensemble
from thesis_lib.residual.dice.data import MAD_TO_STD, MeasuredContacts, Releases
from thesis_lib.residual.dice.double_hits import hit_again
from thesis_lib.residual.dice.fit import DiceModel, contact_path
from thesis_lib.residual.dice.settings import DiceStudySettings
from thesis_lib.residual.learners.bases import LawBase
from thesis_lib.residual.learners.gaussian_process import fit_gaussian_process
from thesis_lib.residual.learners.learners import ImpulseLearner
from thesis_lib.residual.throwing.contact_map import (
    ContactMap,
    Regime,
    contact_features,
    leave_one_out,
    residual_unit,
    split,
    student,
)
from thesis_lib.residual.throwing.flight import first_touch, fly
from thesis_lib.residual.throwing.propagation import LearnedImpact, Sampled, ScatteredLaw
from thesis_lib.residual.throwing.throw import Throws, simulate_throws

FEWEST = 50  # contacts on either side of an edge; with fewer, both sides are one range of speeds
KNOWN_EFFECTS = ("rounded_corners", "angle_offset", "linear_drag", "wrong_inertia")


@dataclass(frozen=True)
class Thrower:
    """A body in flight with an uncertain contact, and the same contact without uncertainty."""

    name: str
    model: DiceModel
    contact: Sampled
    certain: Sampled
    note: str = ""


def critique_model(saved: SavedModel, side: float) -> DiceModel:
    """The critique's body and law as a model that can be thrown; UserError for effects not in `KNOWN_EFFECTS`."""
    strange = [name for name in saved.effects if name not in KNOWN_EFFECTS]
    if strange:
        raise UserError(
            f"The critique's model has effects that thrown dice do not know: {', '.join(strange)}. "
            f"Known are {', '.join(KNOWN_EFFECTS)}; leave the critique's model out or choose its effects among them."
        )
    p = saved.values
    rho = p.get("rounded_corners.rho", 0.0)
    return DiceModel(
        half=side / 2 - rho,
        rho=rho,
        height=saved.rig.height,
        k_g=saved.rig.radius_of_gyration * float(np.sqrt(1.0 + p.get("wrong_inertia.d_I", 0.0))),
        law=saved.law,
        mu=p["mu"],
        epsilon=p["epsilon"],
        gravity=saved.rig.gravity,
        d_theta=p.get("angle_offset.d_theta", 0.0),
        c_v=p.get("linear_drag.c_v", 0.0),
        c_w=p.get("linear_drag.c_w", 0.0),
    )


def law_models(
    believed: DiceModel,
    impacts: Impacts,
    contacts: MeasuredContacts,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> tuple[list[Thrower], pd.DataFrame]:
    """The law with the least error on isolated training impacts, and its two residuals, learned on single hits."""
    target = target_of(impacts)
    fits = {name: fit_ensemble(LAWS[name], target, "velocity") for name in SIX_LAWS}
    name = min(fits, key=lambda law: fits[law].cost)
    model = replace(believed, law=name, mu=fits[name].mu, epsilon=fits[name].epsilon)
    throwers = [scattered("law", model, contacts, settings)]
    single = single_hits(model, impacts, settings)
    some = single.sample(settings.training_contacts, rng)
    for label, wrench in (("residual", False), ("residual_wrench", True)):
        trained = ImpulseLearner("X1", wrench, LawBase(name), True, settings.process).fit(some, rng)
        parts = {"body": model.body, "law": model.impact, "trained": trained, "slowest": settings.slowest}
        throwers.append(
            Thrower(label, model, LearnedImpact(**parts), LearnedImpact(**parts, draws=1, deterministic=True))
        )
    errors = pd.DataFrame(
        [(k, f.mu, f.epsilon, f.cost) for k, f in fits.items()], columns=["law", "mu", "epsilon", "error"]
    )
    return throwers, errors


def single_hits(model: DiceModel, impacts: Impacts, settings: DiceStudySettings) -> Impacts:
    """The impacts after which, by the model's law, no other corner hits before a camera could tell (`double_hits`)."""
    return impacts.select(~hit_again(model.body, model.impact, impacts, settings.data.longest_contact))


def contact_residuals(
    model: DiceModel, contacts: MeasuredContacts, settings: DiceStudySettings
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What a model misses of measured contacts, at `duration` after the first touch.

    Contacts slower than `slowest`, or followed by a flight later than twice the duration after the touch, are left out.

    Returns:
        Indices (m,) of the contacts used, pose and velocity (m, 3) at the touch, residual (m, 6) in the contact map's
        units, and the model's normal impulse (m,) per unit mass in m/s.
    """
    body = model.body
    q = model.seen(contacts.q)
    t, corner = first_touch(body, q, contacts.v)
    q_0, v_0 = fly(body, q, contacts.v, t)
    r = body.contact_point(q_0[:, 2], corner)
    approach = -(v_0[:, 1] + r[:, 0] * v_0[:, 2])
    # the flight after the contact, traced back to the end of the duration
    back = contacts.span - t - settings.duration
    rows = np.flatnonzero(
        (approach > settings.slowest) & (np.abs(back) < 2.0 * settings.duration) & (t < contacts.span)
    )
    q_0, v_0, back = q_0[rows], v_0[rows], back[rows]
    path_q, path_v = contact_path(model, q_0, v_0, settings.duration, settings.throw)
    after_q = contacts.q_after[rows] - [0.0, 0.0, model.d_theta]
    reached_q, reached_v = fly(body, after_q, contacts.v_after[rows], -back)
    residual = np.hstack([reached_q - path_q, reached_v - path_v])
    residual = residual / residual_unit(v_0, body.k_g, settings.duration)
    c_n = path_v[:, 1] - v_0[:, 1] + body.gravity * settings.duration
    return rows, q_0, v_0, residual, c_n


def scattered(name: str, model: DiceModel, contacts: MeasuredContacts, settings: DiceStudySettings) -> Thrower:
    """A law with the scatter of its training residuals (Δv_x, Δv_y, k Δω)/c_n, robust against lost contacts."""
    _, _, v_0, residual, c_n = contact_residuals(model, contacts, settings)
    relative = residual[:, 3:] * (velocity_error(v_0, model.k_g) / np.maximum(c_n, settings.slowest))[:, None]
    # means stay in: a systematic miss counts as scatter
    size = MAD_TO_STD * np.median(np.abs(relative), axis=0)
    # as a wrench about the centre: the couple per normal impulse is k times the spin's share
    wrench = np.diag(size * [1.0, 1.0, model.k_g]) ** 2
    return Thrower(
        name,
        model,
        ScatteredLaw(model.body, model.impact, relative=wrench),
        Sampled(model.body, model.impact, draws=1, deterministic=True),
    )


@dataclass(frozen=True)
class Missed:
    """What a model misses of training contacts, for a contact map; `left_out` counts outliers."""

    regimes: tuple[Regime, ...]
    freedom: float
    left_out: int


def train_missed(
    model: DiceModel,
    contacts: MeasuredContacts,
    settings: DiceStudySettings,
    rng: np.random.Generator,
    learned: bool = True,
) -> Missed:
    """Processes of what a model misses (if not `learned`, its scatter alone), and Student's t of their residuals."""
    _, q_0, v_0, residual, _ = contact_residuals(model, contacts, settings)
    speed = velocity_error(v_0, model.k_g)
    edges = [edge for edge in settings.edges if min((speed <= edge).sum(), (speed > edge).sum()) >= FEWEST]
    edges.append(np.inf)
    processes, parts, outliers = [], [], 0
    for rows in split(speed, edges):
        size = np.linalg.norm(residual[rows, 3:], axis=1)
        good = rows[size < settings.outlier * np.median(size)]
        outliers += len(rows) - len(good)
        if not learned:
            processes.append(None)
            parts.append(residual[rows])
            continue
        some = rng.permutation(good)[: settings.training_contacts]
        X = contact_features(q_0[some], v_0[some], model.k_g)
        process = fit_gaussian_process(X, residual[some], rng, settings.process, centred=False)
        processes.append(process)
        parts.append(leave_one_out(process))
        # no process is trained on outliers, but they occur and belong to its tails
        wild = np.setdiff1d(rows, good)
        if len(wild):
            mean, variance = process.predict(contact_features(q_0[wild], v_0[wild], model.k_g), noise=True)
            parts[-1] = np.vstack([parts[-1], (residual[wild] - mean) / np.sqrt(variance)])
    scales, freedom = student(parts)
    return Missed(tuple(map(Regime, edges, processes, scales)), freedom, outliers)


def contact_map(name: str, model: DiceModel, missed: Missed, settings: DiceStudySettings) -> Thrower:
    """A thrower with the contact map of what `model` misses."""

    def path(q: np.ndarray, v: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray]:
        return contact_path(model, q, v, duration, settings.throw)

    parts = {
        "body": model.body,
        "law": model.impact,
        "path": path,
        "regimes": missed.regimes,
        "freedom": missed.freedom,
        "duration": settings.duration,
        "slowest": settings.slowest,
    }
    return Thrower(name, model, ContactMap(**parts), ContactMap(**parts, draws=1, deterministic=True))


def slide_fitted(
    make: Callable[[DiceModel], Thrower], model: DiceModel, releases: Releases, side: float, settings: DiceStudySettings
) -> Thrower:
    """Thrower whose friction, in sliding and in its slowest contacts, gives the least |error| of training throws."""
    best = None
    for mu in settings.slide_grid:
        thrower = make(replace(model, mu=mu))
        out = throw_starts(thrower, thrower.certain, releases.q, releases.v, settings, np.random.default_rng(0))
        error = float(np.mean(np.abs(releases.end[:, 0] - out.q[:, 0]))) / side
        if best is None or error < best[0]:
            best = (error, thrower)
    return best[1]


def throw_starts(
    thrower: Thrower,
    contact: Sampled,
    q: np.ndarray,
    v: np.ndarray,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> Throws:
    """Ends of throws from measured poses and velocities (n, 3) with one of the two contacts of a thrower."""
    model = thrower.model
    return simulate_throws(model.body, model.seen(q), v, contact, model.mu, settings.throw, rng)
