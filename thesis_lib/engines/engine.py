"""What a physics engine is to a critique: the state before an impact or an episode in, the state after it out, batched.

An engine only presses: it steps bodies that touch with its own contact, through one model that all of them share.  What
engines have in common is here.  A contact begins where the gap φ_n of the undeformed body is 0 and ends where it is 0
again; between two contacts bodies fly on parabolas, in closed form.  The end of a contact is found by bisection on the
cubic Hermite path of the step in which the gap opens.

Parameters have the same meaning for all engines: μ; ε and the contact time T of a central impact (at any speed in
MuJoCo and Bullet, at `REFERENCE_SPEED` in Drake, whose ε falls with the speed).  What acts outside the contact force is
a property of body and rig (`OUTSIDE`), and every engine has it.

| on paper | in code                         | unit                | shape  |                                       |
|----------|---------------------------------|---------------------|--------|---------------------------------------|
| q, v     | `q`, `v`                        | m, rad; m/s, rad/s  | (n, 3) | pose and velocity of the body's origin |
| μ, ε, T  | `mu`, `epsilon`, `contact_time` | 1, 1, s             |        | fields of the contact                 |
| φ_n      | `gap`                           | m                   | (n,)   | gap between body and surface          |
| t        | `t`                             | s                   | (n,)   | since the states that were given      |
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant.forces import Mechanics
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

# causes outside the contact force; a moving plate is a change of frame, for whoever calls
OUTSIDE = (
    *("com_offset_x", "com_offset_y", "inertia_error", "size_error", "corner_radius"),
    *("tilt", "gravity_error", "surface_height"),
)
LONGEST = 20.0  # contact times; a body that is still on the surface then stays there
MOST_HITS = 12  # a body that hits more often has come to rest
FLIGHT_STEP = 5e-4  # s; a corner 0.05 m from the centre turning with 60 rad/s dips by 6 µm between two looks
BISECTIONS = 40


class Press(Protocol):
    """An engine: n bodies on its surface."""

    name: str
    mechanics: Mechanics  # geometry and flight of the true body; its states are those of the true centre of mass
    h: float  # s, between two states of a path

    def press(self, rows: np.ndarray, q: np.ndarray, v: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Paths q, v (m, steps + 1, 3) of the bodies `rows` (m,) from states (m, 3) of their centres of mass."""
        ...


@dataclass(frozen=True)
class EngineResult:
    """What an engine makes of n states.

    Attributes:
        q: (n, 3) poses of the body's origin at the end, m and rad.
        v: (n, 3) velocities there, m/s and rad/s.
        t: (n,) s from the state that was given to the end.
        hits: (n,) contacts that have begun.
        left: (n,) whether the body is off the surface at the end.
    """

    q: np.ndarray
    v: np.ndarray
    t: np.ndarray
    hits: np.ndarray
    left: np.ndarray


def mechanics(body: Body, contact: CompliantContact, causes: HiddenCauses, gravity: float, n: int) -> Mechanics:
    """Geometry and flight of the true body for n impacts; UserError for causes that are not `OUTSIDE`, or no mass."""
    if body.mass is None:
        raise UserError("An engine needs the mass of the body in kg; give Body(mass=...).")
    off = HiddenCauses()
    asked = [name for name in HiddenCauses.model_fields if getattr(causes, name) != getattr(off, name)]
    if other := [name for name in asked if name not in OUTSIDE]:
        raise UserError(f"An engine as a model has no {', '.join(other)}; what it can have is {', '.join(OUTSIDE)}.")
    return Mechanics(body, contact, causes, gravity, n, np.zeros(n))


def impacts(engine: Press, q: np.ndarray, v: np.ndarray) -> EngineResult:
    """The end of one contact of each body, from poses and velocities (n, 3) of its origin at the first touch.

    Bodies are set down where they touch: heights q[:, 1] need not.  Those that do not come down stay as they are, with
    no hit.  A contact that lasts longer than `LONGEST` contact times ends there, not `left`.
    """
    c, w = _centre(engine, *_checked(engine, q, v))
    c = _set_down(engine, c)
    made = _Run(engine, c, w, np.full(len(c), np.inf))
    rows = np.flatnonzero(made.rate() < 0.0)
    made.press(rows)
    return made.outcome()


def episodes(engine: Press, q: np.ndarray, v: np.ndarray, span: np.ndarray) -> EngineResult:
    """States `span` (n,) in s after states q, v (n, 3) of the origin in flight or at a touch, with all hits between.

    A body below the surface is taken for one that touches.  At most `MOST_HITS` hits: what follows is flight.
    """
    c, w = _centre(engine, *_checked(engine, q, v))
    made = _Run(engine, c, w, np.asarray(span, dtype=float))
    rows = np.arange(len(c))
    for _ in range(MOST_HITS):
        rows = made.fly(rows)
        rows = made.press(rows[made.rate()[rows] < 0.0])
        rows = rows[made.t[rows] < made.span[rows]]
        if not len(rows):
            break
    made.fly_on()
    return made.outcome()


def _checked(engine: Press, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    q, v = np.array(q, dtype=float), np.array(v, dtype=float)
    n = len(engine.mechanics.epsilon)
    if q.shape != (n, 3) or v.shape != (n, 3):
        raise ValueError(f"the engine was made for {n} bodies: q and v must be ({n}, 3), got {q.shape} and {v.shape}")
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        raise ValueError("an engine needs finite states")
    return q, v


def _centre(engine: Press, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    centre, rate = engine.mechanics.centre_state(q, v)
    return np.column_stack([centre, q[:, 2]]), np.column_stack([rate, v[:, 2]])


def _set_down(engine: Press, c: np.ndarray) -> np.ndarray:
    gap = engine.mechanics.gap(c, np.zeros(len(c)), np.arange(len(c)))
    return c - np.column_stack([0.0 * gap, gap, 0.0 * gap])


class _Run:
    """n bodies, each with its own clock `t` (n,) in s; `c`, `w` (n, 3) are states of the true centre of mass."""

    def __init__(self, engine: Press, c: np.ndarray, w: np.ndarray, span: np.ndarray) -> None:
        self.engine, self.c, self.w, self.span = engine, c.copy(), w.copy(), span
        n = len(c)
        self.t, self.hits, self.left = np.zeros(n), np.zeros(n, int), np.ones(n, bool)

    def outcome(self) -> EngineResult:
        return EngineResult(*self.engine.mechanics.origin_state(self.c, self.w), self.t, self.hits, self.left)

    def rate(self) -> np.ndarray:
        """Normal velocity (n,) in m/s of the lowest points."""
        return self.w[:, 1] + self.engine.mechanics.lowest_point(self.c[:, 2])[:, 0] * self.w[:, 2]

    def _gap(self, c: np.ndarray) -> np.ndarray:
        """Gaps (...) in m at states (..., 3)."""
        flat = c.reshape(-1, 3)
        return self.engine.mechanics.gap(flat, np.zeros(len(flat)), np.zeros(len(flat), int)).reshape(c.shape[:-1])

    # --- contact ---

    def press(self, rows: np.ndarray) -> np.ndarray:
        """Press the bodies `rows` until they are off the surface or at their span; returns those that are off."""
        if not len(rows):
            return rows
        engine, h = self.engine, self.engine.h
        T = engine.mechanics.contact.contact_time
        steps = int(np.ceil(T / h))
        self.hits[rows] += 1
        self.left[rows] = False
        begun = self.t[rows].copy()
        waiting = rows
        while len(waiting):
            c, w = engine.press(waiting, self.c[waiting], self.w[waiting], steps)
            if not (np.isfinite(c).all() and np.isfinite(w).all()):
                raise UserError(f"{engine.name} returned no finite state: {engine.mechanics.contact}.")
            gap = self._gap(c)
            opens = (gap[:, :-1] < 0.0) & (gap[:, 1:] >= 0.0)
            # in the first step of a contact a body may be above the surface by rounding
            free = opens.any(axis=1)
            j = np.where(free, opens.argmax(axis=1), steps - 1)
            late = self.t[waiting] + (j + 1) * h > self.span[waiting]
            s = np.where(late, self.span[waiting] - self.t[waiting], (j + 1) * h)
            for part, at in ((free & ~late, None), (late, s)):
                some = np.flatnonzero(part)
                if at is not None and len(some):
                    j[some] = np.minimum((at[some] / h).astype(int), steps - 1)
                self._end(waiting[some], some, c, w, j[some], None if at is None else at[some])
            rest = np.flatnonzero(~free & ~late)
            self.c[waiting[rest]], self.w[waiting[rest]] = c[rest, -1], w[rest, -1]
            self.t[waiting[rest]] += steps * h
            self.left[waiting[free & ~late]] = True
            waiting = waiting[rest]
            started = begun[np.searchsorted(rows, waiting)]
            waiting = waiting[self.t[waiting] - started < LONGEST * T]
        return rows[self.left[rows]]

    def _end(
        self, rows: np.ndarray, some: np.ndarray, c: np.ndarray, w: np.ndarray, j: np.ndarray, at: np.ndarray | None
    ) -> None:
        """Set the bodies `rows` to where their paths c, w[some] open in step j, or to time `at` after the start."""
        if not len(rows):
            return
        h = self.engine.h
        ends = (c[some, j], c[some, j + 1], w[some, j], w[some, j + 1])
        if at is None:
            low, high = np.zeros(len(rows)), np.ones(len(rows))
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                above = self._gap(_hermite(*ends, h, middle)[0]) >= 0.0
                low, high = np.where(above, low, middle), np.where(above, middle, high)
            part = high
        else:
            part = np.minimum(at / h - j, 1.0)
        self.c[rows], self.w[rows] = _hermite(*ends, h, part)
        self.t[rows] += (j + part) * h

    # --- flight ---

    def fly(self, rows: np.ndarray) -> np.ndarray:
        """Fly the bodies `rows` to their next touch or to their span; returns those that touch."""
        c, w = self.c[rows], self.w[rows]
        left = self.span[rows] - self.t[rows]
        touching = (self._gap(c) <= 0.0) & (self.rate()[rows] < 0.0)
        low, high = np.zeros(len(rows)), np.where(touching, 0.0, np.nan)
        looks = int(np.ceil(left.max(initial=0.0) / FLIGHT_STEP))
        for look in range(1, looks + 1):
            open_ = np.isnan(high)
            if not open_.any():
                break
            s = np.minimum(look * FLIGHT_STEP, left)
            below = open_ & (self._gap(self._flown(c, w, s)) < 0.0) & (s > low)
            high[below] = s[below]
            low = np.where(open_ & ~below, s, low)
        lands = ~np.isnan(high)
        for _ in range(BISECTIONS):
            middle = np.where(lands, 0.5 * (low + high), 0.0)
            under = self._gap(self._flown(c, w, middle)) < 0.0
            low, high = np.where(lands & ~under, middle, low), np.where(lands & under, middle, high)
        s = np.where(touching, 0.0, np.where(lands, low, left))
        self.c[rows], self.w[rows] = self._flown(c, w, s), self._later(w, s)
        self.t[rows] += s
        return rows[lands]

    def fly_on(self) -> None:
        """Fly all that is off the surface to its span."""
        rows = np.flatnonzero(self.left & (self.t < self.span))
        s = self.span[rows] - self.t[rows]
        self.c[rows], self.w[rows] = self._flown(self.c[rows], self.w[rows], s), self._later(self.w[rows], s)
        self.t[rows] += s

    def _flown(self, c: np.ndarray, w: np.ndarray, s: np.ndarray) -> np.ndarray:
        g = np.append(self.engine.mechanics.gravity, 0.0)
        return c + s[:, None] * w + 0.5 * (s * s)[:, None] * g

    def _later(self, w: np.ndarray, s: np.ndarray) -> np.ndarray:
        return w + s[:, None] * np.append(self.engine.mechanics.gravity, 0.0)


def _hermite(
    c0: np.ndarray, c1: np.ndarray, w0: np.ndarray, w1: np.ndarray, h: float, part: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """States (n, 3) at the shares `part` (n,) of steps of h s, by the cubic through both ends and their rates."""
    u = part[:, None]
    d = c1 - c0
    c = c0 + h * w0 * u + (3.0 * d - h * (2.0 * w0 + w1)) * u**2 + (h * (w0 + w1) - 2.0 * d) * u**3
    w = w0 + (2.0 * u * (3.0 * d - h * (2.0 * w0 + w1)) + 3.0 * u**2 * (h * (w0 + w1) - 2.0 * d)) / h
    return c, w
