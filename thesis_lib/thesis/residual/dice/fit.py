"""Fit of body and contact of a thrown square to training contacts, by simulation error.

Each contact is simulated from the measured flight before it to the measured flight after it, with all hits between
them.  With e the kinetic norm of the velocity error,

    minimise over body and contact    Σ min(e_i, e_max)

by seeded CMA-ES, from the assumed body and a contact that is the same at every place and angle.  The cap limits the
influence of contacts that the camera lost.  Contacts are too short to determine drag, which is fitted to flights
(`data.flight_drag`).  Unlike a fit to isolated impacts, this fit uses double hits and weights geometry by its effect on
them.

The `MECHANISMS`, by which damping depends on place or angle, are also chosen on the training throws: the fewest whose
error is near the least on contacts of throws that were not used in the fit, each half of the throws in turn.

Source of CMA-ES: Hansen, arXiv 1604.00772 (constants of its table 1).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.effects.effect import Effect, Parameters, Rig
from thesis_lib.thesis.residual.dice.data import MeasuredContacts
from thesis_lib.thesis.residual.dice.settings import DiceFitSettings
from thesis_lib.thesis.residual.throwing.compliant_contact import CornerContact, compliant_path
from thesis_lib.thesis.residual.throwing.flight import ThrownBody, first_touch, fly
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings
from thesis_lib.thesis.residual.throwing.throw import LawImpact, state_at

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
# first step of each parameter: a few times the error of a set-up, enough to change a contact visibly
BODY_STEPS = {"half": 2e-3, "rho": 2e-3, "height": 1e-3, "k_g": 2e-3, "d_theta": 0.02, "c_x": 5e-4, "c_y": 5e-4}
CONTACT_STEPS = {"omega": 200.0, "damping": 0.1, "dashpot": 0.05, "mu": 0.03, "tau": 0.2, "dashpot_t": 0.05}
MECHANISMS = {
    "place": {"place": 0.05, "width": 0.03, "far": 0.5, "far_dashpot": 0.3},  # p(x) of `compliant_contact`
    "flat": {"flat": 0.3, "flat_dashpot": 0.3},  # o(θ)
}
ALL = tuple(MECHANISMS)
MATERIAL = 0.02  # relative fall of the error on unseen contacts that justifies a mechanism (the two of the dice: 20 %)
TOUCHES = 1e-5  # m, clearance given to a body that already touches at the last sample of a flight


@dataclass(frozen=True)
class DiceModel:
    """Model of a die: a square with rounded corners, its drag and its contact."""

    half: float  # m, half the length of a side between the arcs of its corners
    rho: float  # m, radius of the corners
    height: float  # m, of the surface in the camera's frame
    k_g: float  # m, radius of gyration
    law: str  # law, mu, epsilon: of all contacts if `contact` is None, else of the slowest contacts
    mu: float
    epsilon: float
    gravity: float  # m/s²
    d_theta: float = 0.0  # rad, measured minus true angle
    c_x: float = 0.0  # c_x, c_y: m, tracked point (taken as centre of mass) from the centre of the square
    c_y: float = 0.0
    c_v: float = 0.0  # c_v, c_w: 1/s, drag in flight
    c_w: float = 0.0
    contact: CornerContact | None = None
    effects: tuple[tuple[Effect, Parameters], ...] = ()  # effects on contacts, with parameters; they use `rig`
    rig: Rig | None = None

    @property
    def body(self) -> ThrownBody:
        """Return the thrown body."""
        u = CORNERS * self.half - np.array([self.c_x, self.c_y])
        return ThrownBody(u, self.rho, self.k_g, self.gravity, self.height, self.c_v, self.c_w)

    @property
    def impact(self) -> LawImpact:
        """Return the impact law with its parameters."""
        return LawImpact(BASES[self.law], self.mu, self.epsilon, self.k_g, self.effects, self.rig)

    def seen(self, q: np.ndarray) -> np.ndarray:
        """Convert measured poses `q` (n, 3) to true poses (n, 3), lifted where they already touch."""
        q = np.array(q, float)
        q[:, 2] -= self.d_theta
        q[:, 1] += np.maximum(TOUCHES - self.body.gap(q), 0.0)
        return q

    def face(self, theta: np.ndarray) -> np.ndarray:
        """Return the side (n,) that is down at the measured angle `theta` (n,) in rad."""
        return self.body.face(np.asarray(theta) - self.d_theta)


def touch_down(
    model: DiceModel, contacts: MeasuredContacts
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """First touch after measured states: time (n,) in s, pose and velocity (n, 3), contact point (n, 2), approach (n,).

    The approach is the speed of the contact point towards the surface, m/s.
    """
    q = model.seen(contacts.q)
    t, corner = first_touch(model.body, q, contacts.v)
    q, v = fly(model.body, q, contacts.v, t)
    r = model.body.contact_point(q[:, 2], corner)
    return t, q, v, r, -(v[:, 1] + r[:, 0] * v[:, 2])


def contact_path(
    model: DiceModel, q: np.ndarray, v: np.ndarray, until: np.ndarray | float, settings: ThrowSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate to times `until` (s); true pose, velocity (n, 3); a body that chatters throughout stays, at rest."""
    until = np.broadcast_to(until, len(q))
    if model.contact is not None:
        end_q, end_v = compliant_path(model.body, model.contact, q, v, until)
    else:
        end_q, end_v = state_at(model.body, q, v, until, model.impact, settings)
    stuck = ~np.isfinite(end_v).all(1)
    end_q[stuck], end_v[stuck] = q[stuck], 0.0
    return end_q, end_v


def choose_mechanisms(
    start: DiceModel, contacts: MeasuredContacts, rng: np.random.Generator, settings: DiceFitSettings
) -> tuple[str, ...]:
    """Choose the fewest `MECHANISMS` with which contacts of throws that were not fitted are predicted well."""
    trials = rng.permutation(np.unique(contacts.trial))
    first = np.isin(contacts.trial, trials[: len(trials) // 2])
    halves = contacts.select(first), contacts.select(~first)
    few = settings.model_copy(update={"evaluations": settings.choice_evaluations, "contacts": settings.contacts // 2})
    twice = few.model_copy(update={"evaluations": 2 * settings.choice_evaluations})
    seed = int(rng.integers(2**63))
    combined = [names for size in range(len(ALL) + 1) for names in combinations(ALL, size)]
    errors = dict.fromkeys(combined, 0.0)
    for known, unseen in (halves, halves[::-1]):
        fast = _fast(unseen, start, settings)
        # searches are short: subsets continue from a longer search with all mechanisms, to give all enough steps
        full, _ = fit_dice(start, known, np.random.default_rng(seed), twice, ALL)
        for chosen in combined:
            model = full
            if chosen != ALL:
                model, _ = fit_dice(start, known, np.random.default_rng(seed), few, chosen, full)
            errors[chosen] += float(capped_errors(model, fast, start.k_g, settings).sum())
    most = (1.0 + MATERIAL) * min(errors.values())
    return next(chosen for chosen in combined if errors[chosen] <= most)


def capped_errors(model: DiceModel, contacts: MeasuredContacts, k_g: float, settings: DiceFitSettings) -> np.ndarray:
    """Errors (n,) of the velocity after contacts in the kinetic metric with `k_g` (m), m/s, at most `cap`."""
    quick = ThrowSettings(snapshots=0)
    _, v = contact_path(model, model.seen(contacts.q), contacts.v, contacts.span, quick)
    return np.minimum(velocity_error(contacts.v_after - v, k_g), settings.cap)


def _fast(contacts: MeasuredContacts, start: DiceModel, settings: DiceFitSettings) -> MeasuredContacts:
    return contacts.select(velocity_error(contacts.v, start.k_g) > settings.slowest)


def fit_dice(
    start: DiceModel,
    contacts: MeasuredContacts,
    rng: np.random.Generator,
    settings: DiceFitSettings,
    mechanisms: Sequence[str] = ALL,
    begin: DiceModel | None = None,
) -> tuple[DiceModel, float]:
    """Fit body and compliant contact to training contacts; the model and its mean capped error in m/s.

    The damping of a contact depends on place or angle as `mechanisms` states.  The search begins at the body of `start`
    with a contact that is the same everywhere, or at `begin`.
    """
    used = _fast(contacts, start, settings)
    if len(used) > settings.contacts:
        used = used.select(np.sort(rng.choice(len(used), settings.contacts, replace=False)))
    width = max(float(np.std(used.q[:, 0])), 2.0 * MECHANISMS["place"]["width"])
    even = CornerContact(place=float(np.median(used.q[:, 0])), width=width)
    begin = begin or replace(start, contact=even)
    contact_steps = dict(CONTACT_STEPS)
    for mechanism in mechanisms:
        contact_steps |= MECHANISMS[mechanism]
    names = [*BODY_STEPS, *contact_steps]

    def with_values(values: np.ndarray) -> DiceModel:
        known = dict(zip(names, map(float, values)))
        contact = replace(even, **{name: known.pop(name) for name in contact_steps})
        return replace(start, contact=contact, **known)

    def misfit(values: np.ndarray) -> float:
        model = with_values(values)
        bad = min(model.half / start.half - 0.2, model.rho, model.k_g / start.k_g - 0.3, model.contact.margin)
        if bad < 0.0:
            return settings.cap - bad  # outside the bounds the misfit grows with the distance
        return float(capped_errors(model, used, start.k_g, settings).mean())

    first = np.array([getattr(begin, k) for k in BODY_STEPS] + [getattr(begin.contact, k) for k in contact_steps])
    steps = np.array([*BODY_STEPS.values(), *contact_steps.values()])
    best, value = cma_es(misfit, first, steps, settings.evaluations, rng)
    return with_values(best), value


def cma_es(
    function: Callable[[np.ndarray], float],
    start: np.ndarray,
    steps: np.ndarray,
    evaluations: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, float]:
    """Minimise a function of d numbers, which may have kinks; the best point (d,) found and its value."""
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
