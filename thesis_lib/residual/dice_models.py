"""Contact models that can be thrown: the law, its residuals, the critique's, and those fitted to training contacts.

Each is a geometry with a flight, an uncertain contact, and its side without uncertainty (`Thrower`).  What a model's
law misses is measured on contacts between two flights, double hits included: it simulates the time T after the first
touch, the flight after the contact is traced back to that instant, and the difference is

    residual = ((Δx, Δy, k Δθ)/(s T), (Δv_x, Δv_y, k Δω)/s),    s = √(v_x² + v_y² + k² ω²) at the touch

Its size (1.48 median |.|) is the scatter of a law; a Gaussian process of it is the contact map (`propagation`).

| on paper | in code    | unit | shape  | meaning                                             |
|----------|------------|------|--------|-----------------------------------------------------|
| T        | `duration` | s    |        | of the contact map                                  |
|          | `residual` | 1    | (m, 6) | see above                                           |
| α, K_y   |            |      |        | of the process, Rasmussen and Williams, eq. 2.25    |

Source of the leave-one-out residuals: Rasmussen and Williams 2006, eq. 5.12; the rest is our own.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.saved_model import SavedModel
from thesis_lib.datasets.impacts import Impacts
from thesis_lib.errors import UserError
from thesis_lib.identify.cost import target_of
from thesis_lib.identify.ensemble import fit_ensemble
from thesis_lib.residual.bases import LawBase
from thesis_lib.residual.dice_data import Contacts, Releases
from thesis_lib.residual.dice_fit import DiceModel
from thesis_lib.residual.dice_settings import DiceStudySettings
from thesis_lib.residual.flight import first_touch, fly
from thesis_lib.residual.gaussian_process import GaussianProcess, fit_gaussian_process
from thesis_lib.residual.learners import ImpulseLearner
from thesis_lib.residual.propagation import (
    ContactMap,
    LearnedImpact,
    Sampled,
    ScatteredLaw,
    contact_features,
    law_path,
    residual_unit,
)
from thesis_lib.residual.throw import Throws, simulate_throws

KNOWN_EFFECTS = ("rounded_corners", "angle_offset", "linear_drag", "wrong_inertia")


@dataclass(frozen=True)
class Thrower:
    """A model that can be thrown: geometry, uncertain contact and its side without uncertainty."""

    name: str
    model: DiceModel
    contact: Sampled
    certain: Sampled
    note: str = ""


def critique_model(saved: SavedModel, side: float) -> DiceModel:
    """The critique's body and law as a model that can be thrown.

    Raises:
        UserError: it has effects other than `KNOWN_EFFECTS`.
    """
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
    contacts: Contacts,
    settings: DiceStudySettings,
    rng: np.random.Generator,
) -> tuple[list[Thrower], pd.DataFrame]:
    """Law with the least error on isolated training impacts, and its two residuals."""
    target = target_of(impacts)
    fits = {name: fit_ensemble(LAWS[name], target, "velocity") for name in SIX_LAWS}
    name = min(fits, key=lambda law: fits[law].cost)
    model = replace(believed, law=name, mu=fits[name].mu, epsilon=fits[name].epsilon)
    throwers = [scattered("law", model, contacts, settings)]
    some = impacts.sample(settings.training_contacts, rng)
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


def contact_residuals(
    model: DiceModel, contacts: Contacts, settings: DiceStudySettings
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What a model's law misses of measured contacts, at `duration` after the first touch.

    Returns:
        rows (m,) of the contacts used, pose and velocity (m, 3) at the touch, the residual (m, 6) in the units of the
        contact map, and the law's normal impulse (m,) per unit mass.  Left out are contacts that approach more slowly
        than `slowest`, or whose next flight starts later than twice the duration after the touch.
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
    path_q, path_v = law_path(body, model.impact, q_0, v_0, settings.duration, settings.throw)
    after_q = contacts.q_after[rows] - [0.0, 0.0, model.d_theta]
    reached_q, reached_v = fly(body, after_q, contacts.v_after[rows], -back)
    residual = np.hstack([reached_q - path_q, reached_v - path_v])
    residual = residual / residual_unit(v_0, body.k_g, settings.duration)
    c_n = path_v[:, 1] - v_0[:, 1] + body.gravity * settings.duration
    return rows, q_0, v_0, residual, c_n


def scattered(name: str, model: DiceModel, contacts: Contacts, settings: DiceStudySettings) -> Thrower:
    """A law with the scatter of its training residuals: (Δv_x, Δv_y, k Δω)/c_n, robust against lost contacts."""
    _, _, v_0, residual, c_n = contact_residuals(model, contacts, settings)
    relative = residual[:, 3:] * (velocity_error(v_0, model.k_g) / np.maximum(c_n, settings.slowest))[:, None]
    # 1.48 median |z| is the standard deviation of a normal; means are not taken off: what is always missed is
    # scatter, too
    size = 1.4826 * np.median(np.abs(relative), axis=0)
    # as a wrench about the centre: the couple per normal impulse is k times the spin's share
    wrench = np.diag(size * [1.0, 1.0, model.k_g]) ** 2
    return Thrower(
        name,
        model,
        ScatteredLaw(model.body, model.impact, relative=wrench),
        Sampled(model.body, model.impact, draws=1, deterministic=True),
    )


def train_contact_map(
    model: DiceModel, contacts: Contacts, settings: DiceStudySettings, rng: np.random.Generator
) -> tuple[GaussianProcess, np.ndarray, int]:
    """The process of the contact map, the factor (6,) on its standard deviations, and how many outliers were left out.

    The factor makes the central 80 % of the leave-one-out residuals of training what a Gaussian says they are.
    """
    _, q_0, v_0, residual, _ = contact_residuals(model, contacts, settings)
    size = np.linalg.norm(residual[:, 3:], axis=1)
    good = np.flatnonzero(size < settings.outlier * np.median(size))
    rows = rng.permutation(good)[: settings.training_contacts]
    process = fit_gaussian_process(
        contact_features(q_0[rows], v_0[rows], model.k_g),
        residual[rows],
        rng,
        settings.process,
        centred=False,
    )
    z = leave_one_out(process)
    return process, np.quantile(np.abs(z), 0.8, axis=0) / 1.28155, len(size) - len(good)


def leave_one_out(process: GaussianProcess) -> np.ndarray:
    """Leave-one-out residuals over their standard deviations (n, p): α_i/√(K_y⁻¹)_ii (R. & W., eq. 5.12)."""
    z = np.empty_like(process.y)
    for i in range(z.shape[1]):
        x = process.x / process.lengthscale[i]
        square = (x * x).sum(1)
        K = process.signal[i] * np.exp(-0.5 * np.maximum(square[:, None] + square - 2.0 * x @ x.T, 0.0))
        inverse = np.linalg.inv(K + process.noise[i] * np.eye(len(x)))
        z[:, i] = inverse @ process.y[:, i] / np.sqrt(np.diag(inverse))
    return z


def contact_map(
    name: str, model: DiceModel, process: GaussianProcess, spread: np.ndarray, settings: DiceStudySettings
) -> Thrower:
    """A thrower with the contact map of `propagation`."""
    parts = {
        "body": model.body,
        "law": model.impact,
        "process": process,
        "duration": settings.duration,
        "slowest": settings.slowest,
        "settings": settings.throw,
        "spread": spread,
    }
    return Thrower(name, model, ContactMap(**parts), ContactMap(**parts, draws=1, deterministic=True))


def slide_fitted(
    make: Callable[[DiceModel], Thrower],
    model: DiceModel,
    releases: Releases,
    side: float,
    settings: DiceStudySettings,
) -> Thrower:
    """The thrower with the friction of sliding that gives the least mean |error| of training throws."""
    best = None
    for mu in settings.slide_grid:
        thrower = make(replace(model, mu_slide=mu))
        out = throw_starts(
            thrower, thrower.certain, releases.q, releases.v, settings, np.random.default_rng(0)
        )
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
    model = thrower.model
    return simulate_throws(model.body, model.seen(q), v, contact, model.impact.mu_slide, settings.throw, rng)
