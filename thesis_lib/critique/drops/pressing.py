"""Contacts that overlap: springs at all corners of a body, integrated from touch until none presses any more.

Each corner has the contact that the simulators have and that τ stands for (`model`): a linear spring that returns the
share ε² of its work, and Coulomb friction.  Per unit mass, with δ the depth and δ_m the greatest depth so far:

    loading    f_n = Ω² δ
    unloading  f_n = Ω² δ_m (δ − δ_0)₊ / (δ_m − δ_0),   δ_0 = (1 − ε²) δ_m
    friction   what ends the slip within the step, at most μ f_n
    Ω = (π/2) (1 + ε) / T                               T: duration of a central contact

Effects act on the frame, on the contact points and on (μ, ε) as in a single contact.  What they add to the impulse of
the law is added to the impulse of each corner, at the velocity with which it touched.

Source: Walton and Braun 1986, doi:10.1122/1.549893.
"""

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from thesis_lib.bodies.shapes import Corner
from thesis_lib.contact.space import ContactSpace
from thesis_lib.critique.drops.model import Model, duration
from thesis_lib.effects.effect import Rig, State

STEPS = 24  # in one central contact
LONGEST = 4  # central contacts; a body that presses longer rests


def press(model: Model, values: Mapping[str, float], rig: Rig, true: State) -> tuple[State, np.ndarray]:
    """True states (n,) after the corners have pressed, from true states at first touch, and the time (n,) in s."""
    active, n = model.active(values), len(true.x)
    corners = len(rig.shape.corners)  # pyright: ignore[reportAttributeAccessIssue]
    index = np.repeat(np.arange(corners), n)
    at_corner = replace(rig, shape=Corner(rig.shape, index))  # pyright: ignore[reportArgumentType]
    tiled = State(*(np.tile(getattr(true, item.name), corners) for item in fields(State)))
    seen, r_x, r_y, k_g = model.contact_at(tiled, active, at_corner)
    gap = model.gap(tiled, values, at_corner)
    w = 1.0 / (k_g * k_g)

    def space_of(v: np.ndarray, r_x: np.ndarray, r_y: np.ndarray) -> ContactSpace:
        vx, vy, omega = v.T
        K = (1.0 + r_y * r_y * w, 1.0 + r_x * r_x * w, -r_x * r_y * w)
        return ContactSpace((vx - r_y * omega).ravel(), (vy + r_x * omega).ravel(), *(k.ravel() for k in K))

    mu, epsilon = (np.full(corners * n, values[name]) for name in ("mu", "epsilon"))
    first = ContactSpace(
        seen.vx - r_y * seen.omega, seen.vy + r_x * seen.omega, 1.0 + r_y**2 * w, 1.0 + r_x**2 * w, -r_x * r_y * w
    )
    for effect, p in active:
        mu, epsilon = effect.coefficients(mu, epsilon, first, seen, p, rig)
    shape = (corners, n)
    mu, epsilon, r_x, r_y, gap = (np.reshape(a, shape) for a in (mu, epsilon, r_x, r_y, gap))
    frame = seen.select(np.arange(n))
    T = duration(values["tau"], values["epsilon"])
    stiffness, h = (0.5 * np.pi * (1.0 + values["epsilon"]) / T) ** 2, T / STEPS

    x, y, turn = np.zeros((3, n))
    v, elapsed = frame.v.copy(), np.zeros(n)
    deepest, c_t, c_n = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    pressing = np.ones(n, bool)
    share = epsilon * epsilon
    for _ in range(LONGEST * STEPS):
        # half a drift, a kick, half a drift
        x_m, y_m, turn_m = x + 0.5 * h * v[:, 0], y + 0.5 * h * v[:, 1], turn + 0.5 * h * v[:, 2]
        cos, sin = np.cos(turn_m), np.sin(turn_m)
        rx, ry = cos * r_x - sin * r_y, sin * r_x + cos * r_y
        depth = -(gap + y_m + ry - r_y)
        deepest = np.maximum(deepest, depth)
        f = np.where(depth < deepest, np.maximum(depth - (1.0 - share) * deepest, 0.0) / np.maximum(share, 1e-9), depth)
        dc_n = np.where(deepest > 0.0, h * stiffness * f, 0.0)
        v_n = v.copy()
        v_n[:, 1] += dc_n.sum(0) - h * rig.gravity
        v_n[:, 2] += w * (rx * dc_n).sum(0)
        slip = v_n[:, 0] - ry * v_n[:, 2]
        several = np.maximum((dc_n > 0.0).sum(0), 1)
        dc_t = np.clip(-slip / ((1.0 + ry * ry * w) * several), -mu * dc_n, mu * dc_n)
        v_n[:, 0] += dc_t.sum(0)
        v_n[:, 2] -= w * (ry * dc_t).sum(0)
        go = pressing
        v[go] = v_n[go]
        x, y, turn = (
            np.where(go, b + 0.5 * h * v[:, i], a) for i, (a, b) in enumerate(((x, x_m), (y, y_m), (turn, turn_m)))
        )
        c_t, c_n, elapsed = c_t + dc_t * go, c_n + dc_n * go, elapsed + h * go
        over = (deepest > 0.0) & (depth <= (1.0 - share) * deepest)
        deepest = np.where(over & (depth <= 0.0), 0.0, deepest)
        pressing = pressing & ~((depth <= 0.0).all(0) | (dc_n == 0.0).all(0) & (elapsed > h))
        if not pressing.any():
            break
    pose = frame.q + np.stack([x, y, turn], axis=1)
    after = State.of(pose, v, frame.trial, frame.t + elapsed)
    before_origin, origin = frame, after
    for effect, p in reversed(active):
        before_origin, origin = effect.from_contact(before_origin, p, rig), effect.from_contact(origin, p, rig)
    # the origin moves by its own mean velocity, where that is not the one that the contact sees
    extra = 0.5 * elapsed[:, None] * ((before_origin.v - frame.v) + (origin.v - after.v))
    return State.of(true.q + np.stack([x, y, turn], axis=1) + extra, origin.v, true.trial, true.t + elapsed), elapsed
