"""Contact models for simulated throws: the law, its residuals, the critique's model, and models fitted to contacts.

A `Thrower` combines a body in flight and its uncertain contact, with or without the uncertainty.  A model's residual is
computed for contacts between two flights, double hits included.  The model runs for the time T after the first touch,
the flight after the contact is traced back to that time, and the difference is

    residual = ((Δx, Δy, k Δθ)/(s T), (Δv_x, Δv_y, k Δω)/s),    s = √(v_x² + v_y² + k² ω²) at the touch

Its size (1.48 median |.|) is the scatter of a law; a Gaussian process fitted to it is the contact map (`contact_map`).
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd

from thesis_lib.coefficients.cost import target_of
from thesis_lib.coefficients.ensemble import fit_ensemble
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Effect, in_order
from thesis_lib.foundation.errors import UserError
from thesis_lib.learners.bases import LawBase
from thesis_lib.learners.gaussian_process import fit_gaussian_process
from thesis_lib.learners.learners import ImpulseLearner
from thesis_lib.thesis.residual.dice.data import MAD_TO_STD, MeasuredContacts, ThrowReleases
from thesis_lib.thesis.residual.dice.fit import DiceModel, contact_path, touch_down
from thesis_lib.thesis.residual.dice.settings import DiceStudySettings
from thesis_lib.thesis.residual.throwing.belief import covariance_root
from thesis_lib.thesis.residual.throwing.contact_map import (
    ContactMap,
    Regime,
    contact_features,
    leave_one_out,
    residual_unit,
    split,
    student,
)
from thesis_lib.thesis.residual.throwing.flight import ThrownBody, first_touch, fly
from thesis_lib.thesis.residual.throwing.propagation import LearnedImpact, Sampled, ScatteredLaw
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings
from thesis_lib.thesis.residual.throwing.throw import LawImpact, Throws, simulate_throws

FEWEST = 50  # fewest contacts on either side of an edge; with fewer, both sides form one range of speeds
BODY_EFFECTS = ("rounded_corners", "angle_offset", "marker_offset", "linear_drag", "wrong_inertia", "surface_height")
CONTACT_HOOKS = {"coefficients", "impulse", "contact_time"}


@dataclass(frozen=True)
class Thrower:
    """Model of a throw: a body in flight with an uncertain contact."""

    name: str
    model: DiceModel
    contact: Sampled

    @property
    def certain(self) -> Sampled:
        """The same contact without uncertainty."""
        return replace(self.contact, deterministic=True)


def critique_model(saved: SavedModel, side: float) -> DiceModel:
    """Convert the critique's body and law to a model for throws, with instantaneous contacts.

    With a marker off the centre, the outline is shifted accordingly, and the centre of mass is assumed at the marker,
    as in all fits of the dice.

    UserError for effects that are not in `BODY_EFFECTS` and do not act on contacts alone.
    """
    of_contact = in_order(EFFECTS[name] for name in saved.effects if acts_on_contacts_alone(EFFECTS[name]))
    known = {*BODY_EFFECTS, *(effect.name for effect in of_contact)}
    strange = [name for name in saved.effects if name not in known]
    if strange:
        raise UserError(
            f"The critique's model has effects that throws of dice do not support: {', '.join(strange)}. Supported are "
            f"{', '.join(BODY_EFFECTS)} and effects on contacts alone; leave the critique's model out or choose "
            "its effects among these."
        )
    p = saved.values
    rho = p.get("rounded_corners.rho", 0.0)
    return DiceModel(
        half=side / 2 - rho,
        rho=rho,
        height=saved.rig.height + p.get("surface_height.h", 0.0),
        k_g=saved.rig.radius_of_gyration * float(np.sqrt(1.0 + p.get("wrong_inertia.d_I", 0.0))),
        law=saved.law,
        mu=p["mu"],
        epsilon=p["epsilon"],
        gravity=saved.rig.gravity,
        d_theta=p.get("angle_offset.d_theta", 0.0),
        c_x=p.get("marker_offset.d_x", 0.0),
        c_y=p.get("marker_offset.d_y", 0.0),
        c_v=p.get("linear_drag.c_v", 0.0),
        c_w=p.get("linear_drag.c_w", 0.0),
        effects=tuple(
            (effect, {q.name: p[f"{effect.name}.{q.name}"] for q in effect.parameters}) for effect in of_contact
        ),
        rig=saved.believed,
    )


def acts_on_contacts_alone(effect: Effect) -> bool:
    """Whether an effect changes only (μ, ε), the impulse or the contact time, in the same way in every throw."""
    hooks = [name for name in vars(Effect) if callable(getattr(Effect, name)) and not name.startswith("_")]
    acting = {name for name in hooks if getattr(type(effect), name) is not getattr(Effect, name)}
    of_throws = "trial" not in effect.along  # simulated throws have no number
    return bool(acting) and acting <= CONTACT_HOOKS | {"shapes"} and of_throws


def law_models(
    believed: DiceModel,
    impacts: Impacts,
    contacts: MeasuredContacts,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> tuple[list[Thrower], pd.DataFrame]:
    """Fit the law with the least error on isolated training impacts, and its two residuals, learned on single hits."""
    target = target_of(impacts)
    fits = {name: fit_ensemble(LAWS[name], target, "velocity") for name in SIX_LAWS}
    name = min(fits, key=lambda law: fits[law].cost)
    model = replace(believed, law=name, mu=fits[name].mu, epsilon=fits[name].epsilon)
    throwers = [scattered("law", model, contacts, settings)]
    single = single_hits(model, impacts, settings)
    some = single.sample(settings.training_contacts, rng)
    for label, wrench in (("residual", False), ("residual_wrench", True)):
        trained = ImpulseLearner("X1", wrench, LawBase(name), True, settings=settings.process).fit(some, rng)
        contact = LearnedImpact(model.body, model.impact, trained=trained, slowest=settings.slowest)
        throwers.append(Thrower(label, model, contact))
    errors = [(k, f.mu, f.epsilon, f.cost) for k, f in fits.items()]
    return throwers, pd.DataFrame(errors, columns=["law", "mu", "epsilon", "error"])


def single_hits(model: DiceModel, impacts: Impacts, settings: DiceStudySettings) -> Impacts:
    """Select impacts after which, by the model's law, no other corner hits within the camera's time resolution."""
    return impacts.select(~hit_again(model.body, model.impact, impacts, settings.data.longest_contact))


def hit_again(body: ThrownBody, law: LawImpact, impacts: Impacts, within: float) -> np.ndarray:
    """Mask (n,) of impacts after which, by the law and in free flight, another corner hits within `within` s.

    A square that lands nearly flat hits with its next corner milliseconds later (thesis 4.4, figure 4-9), and the
    camera sees one impact, which no impulse at one point explains.  A learner of such impulses would find a large
    residual, count the second hit twice (a simulated throw has it anyway), and multiply the energy of a body that
    rocks on its corner, which has the same features X1.  Nothing measured after the impact is used.
    """
    q = impacts.q.copy()
    q[:, 1] -= body.gap(q)  # measured heights are a millimetre off, so the lowest corner is placed on the surface
    r, corner = body.lowest(q[:, 2])
    _, after, _ = law(q, impacts.v_pre, r, np.zeros(len(q), bool))
    known = np.isfinite(after).all(axis=1)
    again = np.zeros(len(q), bool)
    t, other = first_touch(body, q[known], after[known])
    again[known] = (t < within) & (other != corner[known])
    return again


def contact_residuals(
    model: DiceModel, contacts: MeasuredContacts, settings: DiceStudySettings
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Compute the residuals of a model at measured contacts, at `duration` after the first touch.

    Left out are contacts slower than `slowest`, contacts whose next flight begins later than twice the duration after
    the touch, and contacts with a hit later than the duration, through which the next flight would be traced back.
    Returns indices (m,) of the contacts used, pose and velocity (m, 3) at the touch, residual (m, 6) in the contact
    map's units, and the model's normal impulse (m,) per unit mass in m/s.
    """
    body = model.body
    t, q_0, v_0, _, approach = touch_down(model, contacts)
    # the flight after the contact, traced back to the end of the duration
    back = contacts.span - t - settings.duration
    soon = (np.abs(back) < 2.0 * settings.duration) & (t < contacts.span)
    soon &= contacts.last_hit - t < settings.duration
    rows = np.flatnonzero((approach > settings.slowest) & soon)
    q_0, v_0, back = q_0[rows], v_0[rows], back[rows]
    path_q, path_v = contact_path(model, q_0, v_0, settings.duration, settings.throw)
    after_q = contacts.q_after[rows] - [0.0, 0.0, model.d_theta]
    reached_q, reached_v = fly(body, after_q, contacts.v_after[rows], -back)
    residual = np.hstack([reached_q - path_q, reached_v - path_v])
    residual = residual / residual_unit(v_0, body.k_g, settings.duration)
    c_n = path_v[:, 1] - v_0[:, 1] + body.gravity * settings.duration
    return rows, q_0, v_0, residual, c_n


def scattered(name: str, model: DiceModel, contacts: MeasuredContacts, settings: DiceStudySettings) -> Thrower:
    """Make a law with the scatter of its training residuals (Δv_x, Δv_y, k Δω)/c_n, robust against lost contacts."""
    _, _, v_0, residual, c_n = contact_residuals(model, contacts, settings)
    relative = residual[:, 3:] * (velocity_error(v_0, model.k_g) / np.maximum(c_n, settings.slowest))[:, None]
    # means are included: a systematic error counts as scatter
    size = MAD_TO_STD * np.median(np.abs(relative), axis=0)
    # as a wrench about the centre: the couple per normal impulse is k times the share of the spin
    wrench = np.diag(size * [1.0, 1.0, model.k_g]) ** 2
    return Thrower(name, model, ScatteredLaw(model.body, model.impact, relative=wrench))


def train_missed(
    model: DiceModel, contacts: MeasuredContacts, settings: DiceStudySettings, rng: np.random.Generator, learned: bool
) -> tuple[dict, int]:
    """Train a contact map on a model's residuals at training contacts; its keywords, and the number of outliers.

    `regimes` have processes (if not `learned`, the scatter alone); `freedom` is for Student's t of their residuals.
    """
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
        # processes are not trained on outliers, but these occur and belong to the tails
        wild = np.setdiff1d(rows, good)
        if len(wild):
            mean, variance = process.predict(contact_features(q_0[wild], v_0[wild], model.k_g), noise=True)
            parts[-1] = np.vstack([parts[-1], (residual[wild] - mean) / np.sqrt(variance)])
    scales, freedom = student(parts)
    return {"regimes": tuple(map(Regime, edges, processes, scales)), "freedom": freedom}, outliers


def contact_map(name: str, model: DiceModel, missed: dict, settings: DiceStudySettings) -> Thrower:
    """Make a thrower with the contact map of the residuals of `model`, trained by `train_missed`."""
    path = partial(contact_path, model, settings=settings.throw)
    limits = {"duration": settings.duration, "slowest": settings.slowest}
    return Thrower(name, model, ContactMap(model.body, model.impact, path=path, **limits, **missed))


def mean_miss(thrower: Thrower, releases: ThrowReleases, settings: DiceStudySettings) -> float:
    """Mean |error| in m of the final position of training throws, simulated without uncertainty."""
    rng = np.random.default_rng(0)
    out = throw_starts(thrower.model, thrower.certain, releases.q, releases.v, settings.throw, rng)
    return float(np.mean(np.abs(releases.end[:, 0] - out.q[:, 0])))


def throw_starts(
    model: DiceModel, contact: Sampled, q: np.ndarray, v: np.ndarray, settings: ThrowSettings, rng: np.random.Generator
) -> Throws:
    """Simulate throws from measured poses and velocities (n, 3) to rest with a contact of the model."""
    return simulate_throws(model.body, model.seen(q), v, contact, model.mu, settings, rng)


def perturbed(releases: ThrowReleases, copies: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw poses and velocities (n copies, 3) from the covariance of each start, grouped by throw."""
    root = covariance_root(releases.cov)
    noise = np.einsum("nij,ncj->nci", root, rng.standard_normal((len(root), copies, 6)))
    state = (np.hstack([releases.q, releases.v])[:, None, :] + noise).reshape(-1, 6)
    return state[:, :3], state[:, 3:]


def noise_limit(
    thrower: Thrower, releases: ThrowReleases, side: float, settings: DiceStudySettings, rng: np.random.Generator
) -> pd.DataFrame:
    """Spread of the end due to noise of the measured start alone: trial, spread (in sides of `side` m), face_kept.

    The model without uncertainty is thrown from each measured state and from states drawn from its covariance.  No
    prediction from these measurements can be better than the spread: the root mean square of (x_end − x_end of the
    measured state).  If the model's throws are less sensitive than the true ones, the limit is too low.  `face_kept` is
    the share of drawn starts that end on the same side as the measured state.
    """
    copies = settings.limit_copies
    still = throw_starts(thrower.model, thrower.certain, releases.q, releases.v, settings.throw, rng)
    moved = throw_starts(thrower.model, thrower.certain, *perturbed(releases, copies, rng), settings.throw, rng)
    away = (moved.q[:, 0].reshape(-1, copies) - still.q[:, :1]) / side
    kept = moved.face.reshape(-1, copies) == still.face[:, None]
    return pd.DataFrame({"trial": releases.trial, "spread": np.sqrt((away**2).mean(1)), "face_kept": kept.mean(1)})
