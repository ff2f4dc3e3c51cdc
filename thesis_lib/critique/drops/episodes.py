"""Episodes: all that happens between two measurable flights.

A body that lands on a corner often lands on the next one before the camera has seen it fly.  The state after such an
episode follows from the state before it: the law is applied as often as the body touches, with flight between.

The arcs before and after a hit meet at the centroid of its impulse, where the contact point is t̄ |v_n| below the
surface (`model`).  So the next hit is where a corner that comes down is that deep:

    f = φ_n + t̄ |v_n| = 0,    v_n < 0

A hit that begins before the one before it is over presses two corners at once.  No sequence of impacts describes that;
the motion is then integrated from the touch of the first with springs at all corners (`pressing`).

A body without corners has one contact point, the lowest.  So has a polygon with more than `MOST_CORNERS`, which is a
curve drawn with corners.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from thesis_lib.bodies.shapes import Corner, Polygon
from thesis_lib.critique.drops.model import Model, contact_space_of, duration
from thesis_lib.critique.drops.pressing import press
from thesis_lib.effects.effect import Rig, State

MOST_CORNERS = 12
MOST_HITS = 12  # a body that hits more often has come to rest
LEAD, MOST_BACK = 2e-3, 8  # s, and times that a body may fly back by it
STEP = 1e-3  # s; a corner 0.05 m from the centre that turns with 60 rad/s is off a straight line by 0.02 mm
NEWTON = 3  # steps to the instant of a hit within a step: f to 1 nm
LARGEST = 400_000  # contact points that are looked at in one call
_NOW = 1e-9  # s


@dataclass(frozen=True)
class Outcome:
    """What follows from n states: the true state at the end, hits (n,), and masks of what is no sequence of impacts."""

    after: State
    hits: np.ndarray
    pressed: np.ndarray  # two corners at once
    rests: np.ndarray  # the body has come to rest, or touches at the end


def contact_points(rig: Rig) -> int:
    """Number of points of the body that may touch one after the other."""
    if isinstance(rig.shape, Polygon) and len(rig.shape.corners) <= MOST_CORNERS:
        return len(rig.shape.corners)
    return 1


def play(model: Model, values: Mapping[str, float], rig: Rig, true: State, span: np.ndarray) -> Outcome:
    """True states (n,) near the first touch, flown for `span` (n,) in s with every hit on the way.

    The states belong to the flight before the first hit, continued below the surface where it must: each body first
    flies back by `LEAD`, and until nothing that comes down is deep.
    """
    return _Play(model, values, rig, true, span).outcome()


class _Play:
    """n bodies, each with its own clock `t` (n,) in s; `motion` (n, 6) are true poses and velocities."""

    def __init__(self, model: Model, values: Mapping[str, float], rig: Rig, true: State, span: np.ndarray) -> None:
        self.model, self.values, self.rig, self.span, self.start = model, values, rig, span, true
        self.active, self.points, n = model.active(values), contact_points(rig), len(span)
        self.motion, self.t = np.concatenate([true.q, true.v], axis=1), np.zeros(n)
        self.hits, self.pressed = np.zeros(n, int), np.zeros(n, bool)
        # of the last hit: its contact point, motion and time at its touch, and the time at which it is over
        self.last = np.full(n, -1)
        self.touch, self.touch_t, self.over = self.motion.copy(), np.zeros(n), np.full(n, -np.inf)
        self._rewind()
        rows = np.arange(n)
        while len(rows := rows[(self.t[rows] < span[rows] - _NOW) & (self.hits[rows] < MOST_HITS)]):
            steps = int(np.ceil((span[rows] - self.t[rows]).max() / STEP))
            for part in np.array_split(rows, 1 + len(rows) * steps * self.points // LARGEST):
                self._advance(part)

    def _rewind(self) -> None:
        """Fly back to where no contact point that comes down has reached the surface."""
        rows = np.arange(len(self.t))
        for _ in range(MOST_BACK):
            state, back = self._state(rows), np.full(len(rows), -LEAD)
            self._set(rows, state.flown(self._acceleration(state, back), back))
            self.t[rows] -= LEAD
            rows = rows[_lands(*self._depths(self._state(rows))[:2]).any(axis=0)]
            if not len(rows):
                return

    def outcome(self) -> Outcome:
        rests = (self.hits >= MOST_HITS) | (self.over > self.span)
        return Outcome(self._state(np.arange(len(self.t))), self.hits, self.pressed, rests)

    def _state(self, rows: np.ndarray) -> State:
        q, v = self.motion[rows, :3], self.motion[rows, 3:]
        return State.of(q, v, self.start.trial[rows], self.start.t[rows] + self.t[rows])

    def _set(self, rows: np.ndarray, state: State) -> None:
        self.motion[rows, :3], self.motion[rows, 3:] = state.q, state.v

    def _advance(self, rows: np.ndarray) -> None:
        """Fly the bodies `rows` to the end, or to the next hit, which is resolved."""
        n, left = len(rows), self.span[rows] - self.t[rows]
        steps = int(np.ceil(left.max() / STEP))
        h = left / steps
        path = self._path(self._state(rows), h, steps)
        f, v_n, _ = self._depths(path)
        lands = _lands(f, v_n).any(axis=0).reshape(steps + 1, n)
        hit, step = np.flatnonzero(lands.any(axis=0)), lands.argmax(axis=0)
        self._set(rows, path.select(np.arange(steps * n, (steps + 1) * n)))
        self.t[rows] = self.span[rows]
        if not len(hit):
            return
        rows, step, h = rows[hit], np.maximum(step[hit] - 1, 0), h[hit]
        start = path.select(step * n + hit)
        a = self._acceleration(start, h)
        t = self._instant(start, a, h)
        self._set(rows, start.flown(a, t))
        self.t[rows] = self.span[rows] - left[hit] + step * h + t
        self._hit(rows)

    def _path(self, state: State, h: np.ndarray, steps: int) -> State:
        """The states (n,) after 0, 1, ... steps of h (n,) in s, ((steps + 1) n,)."""
        if not self.model.has_varying_flight:
            times = np.multiply.outer(np.arange(steps + 1), h).ravel()
            a = self.model.true_acceleration(state.select(np.zeros(1, int)), self.active, self.rig)
            return _joined([state] * (steps + 1)).flown(a, times)
        path = [state]
        for _ in range(steps):
            path.append(path[-1].flown(self._acceleration(path[-1], h), h))
        return _joined(path)

    def _instant(self, start: State, a: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Times (n,) in s after `start`, at most `h`, at which the first point hits; it has hit after `h`."""
        t, rows = h, np.arange(len(h))
        for _ in range(NEWTON):
            f, v_n, _ = self._depths(start.flown(a, t))
            point = _first(f, v_n)
            t = np.clip(t - f[point, rows] / v_n[point, rows], 0.0, h)
        return t

    def _acceleration(self, state: State, h: np.ndarray) -> np.ndarray:
        a = self.model.true_acceleration(state, self.active, self.rig)
        if self.model.has_varying_flight:
            a = self.model.true_acceleration(state.flown(a, 0.5 * h), self.active, self.rig)
        return a

    def _depths(self, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """f in m, v_n in m/s and t̄ in s of all contact points, each (p, n)."""
        n, p = len(state.x), self.points
        if p > 1:
            state = _joined([state] * p)
        rig = self._touching(np.repeat(np.arange(p), n))
        contact = self.model.contact_at(state, self.active, rig)
        space = contact_space_of(*contact)
        delay = self.model.delay(space, contact[0], self.values, rig)
        f = self.model.gap(state, self.values, rig) + delay * np.maximum(-space.v_n, 0.0)
        return f.reshape(p, n), space.v_n.reshape(p, n), delay.reshape(p, n)

    def _touching(self, index: np.ndarray) -> Rig:
        """The rig with one contact point for each body, by its index (n,)."""
        if self.points == 1:
            return self.rig
        return replace(self.rig, shape=Corner(self.rig.shape, index))  # pyright: ignore[reportArgumentType]

    def _hit(self, rows: np.ndarray) -> None:
        state = self._state(rows)
        f, v_n, delay = self._depths(state)
        point = _first(f, v_n)
        delay = delay[point, np.arange(len(rows))]
        self.hits[rows] += 1
        again = (self.t[rows] - delay < self.over[rows]) & (point != self.last[rows])
        if again.any():
            self._press(rows[again])
            rows, state, point, delay = rows[~again], state.select(~again), point[~again], delay[~again]
        if not len(rows):
            return
        touch = state.flown(self._acceleration(state, -delay), -delay)
        self.touch[rows] = np.concatenate([touch.q, touch.v], axis=1)
        self.touch_t[rows], self.last[rows] = self.t[rows] - delay, point
        after, _ = self.model.collide(state, self.values, self._touching(point))
        self._set(rows, after)
        if self.model.takes_time:
            whole = duration(1.0, self.values["epsilon"])
            self.over[rows] = self.touch_t[rows] + whole * delay

    def _press(self, rows: np.ndarray) -> None:
        self.pressed[rows] = True
        after, elapsed = press(
            self.model,
            self.values,
            self.rig,
            State.of(
                self.touch[rows, :3],
                self.touch[rows, 3:],
                self.start.trial[rows],
                self.start.t[rows] + self.touch_t[rows],
            ),
        )
        self._set(rows, after)
        self.t[rows] = self.over[rows] = self.touch_t[rows] + elapsed


def _joined(states: Sequence[State]) -> State:
    """The states one after the other."""
    return State(*(np.concatenate([getattr(state, item.name) for state in states]) for item in fields(State)))


def _lands(f: np.ndarray, v_n: np.ndarray) -> np.ndarray:
    """Mask (p, n) of points that come down and are as deep as where arcs meet."""
    return (f <= 0.0) & (v_n < 0.0)


def _first(f: np.ndarray, v_n: np.ndarray) -> np.ndarray:
    """Index (n,) of the point that has hit, or is about to: the deepest of those that come down."""
    return np.where(v_n < 0.0, f, np.inf).argmin(axis=0)
