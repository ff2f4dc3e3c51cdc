"""A small predictor to compare with: the stages of effects/effect.py one after the other.

It is written from the description of the stages and shares no code with the critique's model.
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.contact import LAWS
from thesis_lib.effects.effect import Impulse, Rig, in_order
from thesis_lib.extensions.effect_probe import EPSILON, MU, Active
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.state import State

STEP = 1e-3  # s, of the flight; the camera's map is linear in the velocity, so that it does not matter


@dataclass(frozen=True)
class StagePrediction:
    """What is measured: velocity after impact (n, 3), jump of the pose (n, 3), gap (n,), acceleration (n, 3) in flight,
    and (n,) along the surface, if it slides."""

    impact: np.ndarray
    meet: np.ndarray
    touch: np.ndarray
    flight: np.ndarray
    slide: np.ndarray
    impulse: Impulse
    contact: Contact
    after: State


def predict(
    active: Active,
    measured: State,
    rig: Rig,
    law: str = "anitescu_potra_newton",
    mu: float = MU,
    epsilon: float = EPSILON,
    contact_time: float = 0.0,
    turned: np.ndarray | float = 0.0,
) -> StagePrediction:
    """Predict all four channels from the measured state before the impact; `contact_time` is τ in s.

    The effects act in their own order, whatever that of `active`.

    `turned` (n,): how much further than in its pose the body has turned where the impulse acts, in rad.
    """
    n = len(measured.x)
    given = dict(active)
    active = [(effect, given[effect]) for effect in in_order(given)]
    true = measured
    for effect, p in reversed(active):
        true = effect.to_true(true, p, rig)

    def seen_by_camera(state: State) -> State:
        for effect, p in active:
            state = effect.to_measured(state, p, rig)
        return state

    seen = true.moved(theta=true.theta + turned)
    for effect, p in active:
        seen = effect.to_contact(seen, p, rig)
    seen = seen.moved(theta=seen.theta - turned)
    r, G = rig.shape.contact_point(true.theta + turned).T, rig.k_g**2
    for effect, p in active:
        r = effect.contact_point(r, seen.moved(theta=seen.theta + turned), p, rig)
        G = effect.inertia(G, p)
    r_x, r_y = r
    K_tt, K_nn, K_tn = 1.0 + r_y * r_y / G, 1.0 + r_x * r_x / G, -r_x * r_y / G
    v_c = seen.vx - r_y * seen.omega, seen.vy + r_x * seen.omega
    contact = Contact(v_c, ((K_tt, K_tn), (K_tn, K_nn)), r, 1.0 / G)
    mus, epsilons = np.full(n, mu), np.full(n, epsilon)
    for effect, p in active:
        mus, epsilons = effect.coefficients(mus, epsilons, contact, seen, p, rig)
    contact = contact.with_coefficients(mus, epsilons)
    with np.errstate(all="ignore"):  # laws compute branches that they do not take
        impulse = Impulse(LAWS[law].impulse(contact, mus, epsilons), np.zeros(n))
    for effect, p in active:
        impulse = effect.impulse(impulse, contact, seen, p, rig)
    pushes = contact.v_n < 0.0
    c_t, c_n, couple = (np.where(pushes, a, 0.0) for a in (*impulse.c, impulse.couple))
    after = seen.moved(vx=seen.vx + c_t, vy=seen.vy + c_n, omega=seen.omega + (r_x * c_n - r_y * c_t + couple) / G)
    if contact_time:
        taus = np.full(n, contact_time)
        for effect, p in active:
            taus = effect.contact_time(taus, contact, seen, p, rig)
        # the mass that the contact sees, from how fast the contact point gains normal velocity
        gained = (after.vy + r_x * after.omega) - contact.v_n
        delay = np.where(pushes, taus * np.sqrt(c_n / np.where(pushes, gained, 1.0)), 0.0)
        made = predict(active, measured, rig, law, mu, epsilon, turned=0.25 * delay * (after.omega - seen.omega))
        earlier = true.flown(np.tile([0.0, -rig.gravity, 0.0], (n, 1)), -delay)
        sunk = rig.shape.gap(earlier.y, earlier.theta) - rig.shape.gap(true.y, true.theta)
        return replace(made, touch=made.touch + sunk)
    for effect, p in reversed(active):
        after = effect.from_contact(after, p, rig)
    seen_after = seen_by_camera(after)
    slides = mus
    for effect, p in active:
        slides = effect.sliding(slides, contact, seen, p, rig)

    jump, gap = np.zeros((3, n)), np.zeros(n)
    a = np.tile([[0.0], [-rig.gravity], [0.0]], n)
    for effect, p in active:
        jump = effect.meet(jump, measured, seen_after, p)
        gap = effect.gap(gap, true, p, rig)
        a = effect.acceleration(a, true, p, rig)
    one, two = (seen_by_camera(true.flown(a.T, h)) for h in (-STEP, STEP))
    return StagePrediction(
        impact=seen_after.v,
        meet=jump.T,
        touch=rig.shape.gap(true.y, true.theta, rig.height) - gap,
        slide=a[0] - slides * np.maximum(-a[1], 0.0) * np.sign(contact.v_t),
        flight=(two.v - one.v) / (2.0 * STEP),
        impulse=impulse,
        contact=contact,
        after=seen_after,
    )
