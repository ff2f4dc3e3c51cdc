"""Interface between a physics engine and a critique: it maps the states before impacts to the states after, in batches.

An engine simulates only the contact: it steps the touching bodies with its own contact law, in one model that they all
share.  This module holds the rest.  A contact begins where the gap φ_n of the undeformed body is 0 and ends where it
is 0 again, found by bisection on the cubic Hermite path of the step in which the gap opens.

Parameters have the same meaning for all engines: μ; ε and the contact time T of a central impact (at any speed in
MuJoCo and Bullet, at `REFERENCE_SPEED` in Drake, whose ε falls with the speed).  Causes outside the contact force are
properties of body and experimental set-up (`OUTSIDE`), and every engine models them.

| on paper | in code                         | unit                | shape  |                                       |
|----------|---------------------------------|---------------------|--------|---------------------------------------|
| q, v     | `q`, `v`                        | m, rad; m/s, rad/s  | (n, 3) | pose and velocity of the body's origin |
| μ, ε, T  | `mu`, `epsilon`, `contact_time` | 1, 1, s             |        | fields of the contact                 |
| φ_n      | `gap`                           | m                   | (n,)   | gap between body and surface          |
| t        | `t`                             | s                   | (n,)   | time since the given states           |
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.bisection import bisected
from thesis_lib.simulate.compliant.forces import Mechanics
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

# causes outside the contact force; a moving plate is a change of frame, which is left to the caller
OUTSIDE = (
    *("com_offset_x", "com_offset_y", "inertia_error", "size_error", "corner_radius"),
    *("tilt", "gravity_error", "surface_height"),
)
LONGEST = 20.0  # contact times; a body that is still on the surface then stays there
BISECTIONS = 40


class Press(Protocol):
    """Interface of an engine with n bodies on its surface."""

    name: str
    mechanics: Mechanics  # geometry and flight of the true body; its states are those of the true centre of mass
    h: float  # s, between two states of a path

    def press(self, rows: np.ndarray, q: np.ndarray, v: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Return paths q, v (m, steps + 1, 3) of the bodies `rows` (m,) from states (m, 3) of the centres of mass."""
        ...


@dataclass(frozen=True)
class EngineResult:
    """Result of an engine for n states.

    Attributes:
        q: (n, 3) poses of the body's origin at the end, m and rad.
        v: (n, 3) velocities there, m/s and rad/s.
        t: (n,) s from the given state to the end.
        left: (n,) whether the body is off the surface at the end.
    """

    q: np.ndarray
    v: np.ndarray
    t: np.ndarray
    left: np.ndarray


def mechanics(body: Body, contact: CompliantContact, causes: HiddenCauses, gravity: float, n: int) -> Mechanics:
    """Return geometry and flight of the true body for n impacts; UserError for causes not in `OUTSIDE`, or no mass."""
    if body.mass is None:
        raise UserError("An engine needs the mass of the body in kg: set Body(mass=...).")
    off = HiddenCauses()
    asked = [name for name in HiddenCauses.model_fields if getattr(causes, name) != getattr(off, name)]
    if other := [name for name in asked if name not in OUTSIDE]:
        raise UserError(f"An engine does not model {', '.join(other)}; it models {', '.join(OUTSIDE)}.")
    return Mechanics(body, contact, causes, gravity, n, np.zeros(n))


def impacts(engine: Press, q: np.ndarray, v: np.ndarray) -> EngineResult:
    """Simulate one contact of each body, from poses and velocities (n, 3) of its origin at the first touch.

    The bodies are first moved vertically to touch the surface, whatever the heights q[:, 1].  Bodies that do not
    approach keep their states.  A contact longer than `LONGEST` contact times is cut off, with `left` false.
    """
    mechanics, h = engine.mechanics, engine.h
    q, v = _checked(engine, q, v)
    centre, rate = mechanics.centre_state(q, v)
    c, w = np.column_stack([centre, q[:, 2]]), np.column_stack([rate, v[:, 2]])
    c[:, 1] -= _gap(engine, c)
    T, t = mechanics.contact.contact_time, np.zeros(len(c))
    steps = int(np.ceil(T / h))
    left = w[:, 1] + mechanics.lowest_point(c[:, 2])[:, 0] * w[:, 2] >= 0.0
    waiting = np.flatnonzero(~left)
    while len(waiting):
        c_path, w_path = engine.press(waiting, c[waiting], w[waiting], steps)
        if not (np.isfinite(c_path).all() and np.isfinite(w_path).all()):
            raise UserError(f"{engine.name} returned a state that is not finite, with {mechanics.contact}.")
        gap = _gap(engine, c_path)
        # in the first step of a contact a body may lie above the surface by a rounding error
        opens = (gap[:, :-1] < 0.0) & (gap[:, 1:] >= 0.0)
        free = opens.any(axis=1)
        rows, off, on = np.flatnonzero(free), waiting[free], waiting[~free]
        c[on], w[on] = c_path[~free, -1], w_path[~free, -1]
        t[on] += steps * h
        j = opens[free].argmax(axis=1)
        ends = (c_path[rows, j], c_path[rows, j + 1], w_path[rows, j], w_path[rows, j + 1])
        both = np.ones(len(rows)), np.zeros(len(rows))
        part, _ = bisected(lambda u, e=ends: _gap(engine, _hermite(*e, h, u)[0]) >= 0.0, *both, BISECTIONS)
        c[off], w[off] = _hermite(*ends, h, part)
        t[off] += (j + part) * h
        left[off] = True
        waiting = on[t[on] < LONGEST * T]
    return EngineResult(*mechanics.origin_state(c, w), t, left)


def _checked(engine: Press, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    q, v = np.array(q, dtype=float), np.array(v, dtype=float)
    n = len(engine.mechanics.epsilon)
    if q.shape != (n, 3) or v.shape != (n, 3):
        raise ValueError(f"the engine has {n} bodies, so q and v must be ({n}, 3); got {q.shape} and {v.shape}")
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        raise ValueError("an engine needs finite poses q and velocities v")
    return q, v


def _gap(engine: Press, c: np.ndarray) -> np.ndarray:
    """Return the gaps (...) in m at states (..., 3) of the centre of mass."""
    flat = c.reshape(-1, 3)
    return engine.mechanics.gap(flat, np.zeros(len(flat)), np.zeros(len(flat), int)).reshape(c.shape[:-1])


def _hermite(
    c0: np.ndarray, c1: np.ndarray, w0: np.ndarray, w1: np.ndarray, h: float, part: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the states (n, 3) at fractions `part` (n,) of steps of h s, by the cubic through both ends and rates."""
    u = part[:, None]
    d = c1 - c0
    c = c0 + h * w0 * u + (3.0 * d - h * (2.0 * w0 + w1)) * u**2 + (h * (w0 + w1) - 2.0 * d) * u**3
    w = w0 + (2.0 * u * (3.0 * d - h * (2.0 * w0 + w1)) + 3.0 * u**2 * (h * (w0 + w1) - 2.0 * d)) / h
    return c, w
