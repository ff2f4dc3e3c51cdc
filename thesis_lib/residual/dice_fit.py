"""Body and law of a thrown square, fitted to the contacts of training throws by simulation error.

Each training contact is simulated from the measured flight before it to the measured flight after it (all hits between
them included); with e the kinetic norm of the velocity error,

    minimise over (a, ρ, h, k, d_θ, c_x, c_y, μ, ε)    Σ min(e_i, e_max)

by CMA-ES from the believed body (and μ = 0.1, ε = 0.5), seeded.  The cap keeps contacts that the camera lost from
bending everything.  Drag is no part of it: contacts are too short for it, flights tell it directly
(`dice_data.flight_drag`).  Unlike a fit to isolated impacts this one uses double hits, and it counts geometry by what
it does.

| on paper | in code   | unit | meaning                                                                      |
|----------|-----------|------|------------------------------------------------------------------------------|
| a        | `half`    | m    | half the length of a side between the arcs of its corners                    |
| ρ        | `rho`     | m    | radius of the corners                                                        |
| h        | `height`  | m    | height of the surface in the camera's frame                                  |
| k        | `k_g`     | m    | radius of gyration                                                           |
| d_θ      | `d_theta` | rad  | measured minus true angle                                                    |
| c        | `c_x`,`c_y`| m   | tracked point (taken as centre of mass) from the centre of the square        |
| c_v, c_w | `c_v`,`c_w`| 1/s | drag in flight                                                               |
|          | `mu_slide`| 1    | friction of slow contacts and of sliding; that of impacts (μ) if None       |

Source of CMA-ES: Hansen, arXiv 1604.00772 (constants as in its table 1); the fit by simulation is an own choice.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.contact import LAWS
from thesis_lib.contact.space import velocity_error
from thesis_lib.residual.dice_data import Contacts
from thesis_lib.residual.dice_settings import DiceFitSettings, ThrowSettings
from thesis_lib.residual.flight import ThrownBody
from thesis_lib.residual.throw import LawImpact, state_at

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
# start (None: as believed) and first step of each parameter: a few times what a rig is off by
STEPS = {
    "half": 2e-3,
    "rho": 2e-3,
    "height": 1e-3,
    "k_g": 2e-3,
    "d_theta": 0.02,
    "c_x": 5e-4,
    "c_y": 5e-4,
    "mu": 0.03,
    "epsilon": 0.05,
}
TOUCHES = 1e-5  # m, by which a body that already touches at the last sample of a flight is lifted


@dataclass(frozen=True)
class DiceModel:
    """A square with rounded corners, its drag and its law; see the module's table."""

    half: float
    rho: float
    height: float
    k_g: float
    law: str
    mu: float
    epsilon: float
    gravity: float
    d_theta: float = 0.0
    c_x: float = 0.0
    c_y: float = 0.0
    c_v: float = 0.0
    c_w: float = 0.0
    mu_slide: float | None = None

    @property
    def body(self) -> ThrownBody:
        """What flies."""
        corners = CORNERS * self.half - np.array([self.c_x, self.c_y])
        return ThrownBody(
            tuple(map(tuple, corners.tolist())),
            self.rho,
            self.k_g,
            self.gravity,
            self.height,
            self.c_v,
            self.c_w,
        )

    @property
    def impact(self) -> LawImpact:
        """What hits."""
        return LawImpact(LAWS[self.law], self.mu, self.epsilon, self.k_g, self.mu_slide)

    def seen(self, q: np.ndarray) -> np.ndarray:
        """True poses (n, 3) of measured ones, lifted where they touch already."""
        q = np.array(q, float)
        q[:, 2] -= self.d_theta
        q[:, 1] += np.maximum(TOUCHES - self.body.gap(q), 0.0)
        return q

    def face(self, theta: np.ndarray) -> np.ndarray:
        """Side (n,) that is down at the measured angle `theta` (n,)."""
        return self.body.face(np.asarray(theta) - self.d_theta)


def contact_errors(model: DiceModel, contacts: Contacts, settings: ThrowSettings) -> np.ndarray:
    """Velocity after contact, measured minus simulated (n, 3); NaN where the simulation does not get there."""
    _, v, _ = state_at(
        model.body,
        model.seen(contacts.q),
        contacts.v,
        contacts.span,
        model.impact,
        settings,
        np.random.default_rng(0),
    )
    return contacts.v_after - v


def fit_dice(
    start: DiceModel,
    contacts: Contacts,
    rng: np.random.Generator,
    settings: DiceFitSettings,
    names: tuple[str, ...] = tuple(STEPS),
) -> tuple[DiceModel, float]:
    """The model that follows training contacts best, and its mean capped error in m/s; see the module's text."""
    quick = ThrowSettings(max_contacts=40, snapshots=0)
    speed = velocity_error(contacts.v, start.k_g)
    rows = np.flatnonzero(speed > settings.slowest)
    if len(rows) > settings.contacts:
        rows = np.sort(rng.choice(rows, settings.contacts, replace=False))
    used = contacts.select(rows)

    def misfit(values: np.ndarray) -> float:
        model = replace(start, **dict(zip(names, map(float, values))))
        bad = min(model.half - 0.2 * start.half, model.rho, model.mu, model.epsilon, 1.0 - model.epsilon)
        bad = min(bad, model.k_g - 0.3 * start.k_g, model.c_v, model.c_w)
        if bad < 0.0:
            return settings.cap - bad  # outside: worse the farther
        error = velocity_error(contact_errors(model, used, quick), start.k_g)
        return float(np.minimum(np.nan_to_num(error, nan=settings.cap), settings.cap).mean())

    first = np.array([getattr(start, name) for name in names])
    steps = np.array([STEPS[name] for name in names])
    best, value = cma_es(misfit, first, steps, settings.evaluations, rng)
    return replace(start, **dict(zip(names, map(float, best)))), value


def cma_es(
    function: Callable[[np.ndarray], float],
    start: np.ndarray,
    steps: np.ndarray,
    evaluations: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, float]:
    """Minimum of a function of d numbers that may have kinks: point (d,) and value of the best one seen."""
    d = len(start)
    lam = 4 + int(3 * np.log(d)) + 2
    n_best = lam // 2
    w = np.log(n_best + 0.5) - np.log(np.arange(1, n_best + 1))
    w /= w.sum()
    mass = 1.0 / (w**2).sum()
    c_c = (4 + mass / d) / (d + 4 + 2 * mass / d)
    c_s = (mass + 2) / (d + mass + 5)
    c_1 = 2 / ((d + 1.3) ** 2 + mass)
    c_m = min(1 - c_1, 2 * (mass - 2 + 1 / mass) / ((d + 2) ** 2 + mass))
    damping = 1 + 2 * max(0.0, np.sqrt((mass - 1) / (d + 1)) - 1) + c_s
    length = np.sqrt(d) * (1 - 1 / (4 * d) + 1 / (21 * d * d))
    centre, sigma, C = np.zeros(d), 0.5, np.eye(d)
    path_c, path_s = np.zeros(d), np.zeros(d)
    best, value = np.array(start, float), function(start)
    for generation in range(max(1, evaluations // lam)):
        root, axes = np.linalg.eigh(C)
        root = np.sqrt(np.maximum(root, 1e-20))
        Y = (rng.standard_normal((lam, d)) * root) @ axes.T
        points = start + steps * (centre + sigma * Y)
        values = np.array([function(point) for point in points])
        order = np.argsort(values, kind="stable")
        if values[order[0]] < value:
            best, value = points[order[0]], float(values[order[0]])
        elite = Y[order[:n_best]]
        move = w @ elite
        centre = centre + sigma * move
        path_s = (1 - c_s) * path_s + np.sqrt(c_s * (2 - c_s) * mass) * (axes @ ((axes.T @ move) / root))
        relative = np.linalg.norm(path_s) / np.sqrt(1 - (1 - c_s) ** (2 * (generation + 1))) / length
        path_c = (1 - c_c) * path_c + (relative < 1.4 + 2 / (d + 1)) * np.sqrt(c_c * (2 - c_c) * mass) * move
        C = (1 - c_1 - c_m) * C + c_1 * np.outer(path_c, path_c) + c_m * (elite.T * w) @ elite
        sigma *= np.exp(c_s / damping * (np.linalg.norm(path_s) / length - 1))
    return best, value
