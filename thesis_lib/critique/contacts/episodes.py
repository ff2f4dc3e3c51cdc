"""Simulation of episodes: sequences of hits between two observable flights.

A body that lands on a corner often lands on the next corner before the camera has observed a flight.  The state after
such an episode is predicted from the state before it: the law is applied at each touch, with flights in between.

A contact point touches when its gap φ_n becomes 0 as it approaches.  The arcs before and after the hit meet at the
centroid of its impulse, t̄ later (`contact_time`).

If a hit begins before the previous contact has ended, two corners press at the same time.  This is not a sequence of
impacts; the motion is then integrated from the first touch with springs at all corners (`pressing`).

The kind of contact (`kinds`) determines how contacts are integrated, and whether all of them are.
"""

import numpy as np

from thesis_lib.critique.contacts.contact_time import duration
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.contacts.pressing import all_points, contact_points, one_point
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.state import State

MOST_HITS = 12  # a body with more hits has come to rest
FASTEST = 5e3  # m/s and rad/s; faster flights cannot be integrated
LEAD, MOST_BACK = 2e-3, 8  # time in s by which a body is flown back, and how often at most
LATEST = 8e-3  # s
LONGEST = 2e-2  # s; longer contacts do not count as hits
STEP = 1e-3  # s; a corner 0.05 m from the centre that turns at 60 rad/s deviates from a line by 0.02 mm
ON = 1e-9  # m; a nearer point lies on the surface
SLOWEST, LATER = 1e-6, 0.125  # least approach speed at a touch, m/s; below it, advance by this fraction of a step
NEWTON = 3  # Newton steps to the instant of a touch: the gap is then below 1 nm
LARGEST = 400_000  # greatest number of contact points of paths that are advanced together
AHEAD, IN_CACHE = 16, 16_000  # steps, and contact points, that are evaluated at once
AT_FIRST = 4  # steps that are evaluated first: a body starts `LEAD` before its approximate first touch
_NOW = 1e-9  # s


def contact(dynamics: Dynamics, touch: State) -> State:
    """True states (n,) at the end of a contact of finite duration, from true states of bodies at touch.

    A body is placed on the surface, flies to the centroid of the impulse, receives the impulse, and flies until the
    contact has ended and the body is back at the surface, at most `LONGEST` later.  Corners that hit earlier are part
    of the contact.  Bodies that do not approach the surface are unchanged.
    """
    place = np.array(touch.position)
    place[-1] -= dynamics.gap(touch)
    down = touch.changed(position=place)
    span = np.clip(duration(1.0, dynamics.values["epsilon"]) * dynamics.delay(down), 10.0 * _NOW, LONGEST)
    for _ in range(2):  # another corner may hit before the body returns to the surface
        played = Played(dynamics, down, span, touches=True)
        end = played.after
        left = np.maximum(np.where(played.hits > 0, played.over, 0.0) - span, 0.0)
        end = dynamics.flown(end, left)
        a, rise = played.rise(end)
        end, span = end.flown(a, rise), span + left + rise
    comes = dynamics.approaches(down) & (played.hits > 0)
    pose, motion = (np.where(comes, now, then) for now, then in ((end.pose, touch.pose), (end.motion, touch.motion)))
    return State(pose, motion, touch.trial, np.where(comes, end.t, touch.t), touch.surface, touch.space)


class Played:
    """Simulation of true states (n,) near the first touch over `span` (n,) in s, with at most `most` hits.

    The initial states belong to the flight before the first hit, continued below the surface if necessary: each body
    first flies back by `LEAD`, repeatedly until no approaching point is below the surface, unless it `touches` at the
    start.  With `most` = 1 the hit may occur up to `LATEST` after `span`; the arc after it is then followed back.

    Attributes:
        t, motion: (n,) time of each body in s, and its true pose and velocity (n, ·).
        hits: (n,) number of hits.
        pressed, rests: (n,) masks of bodies whose contacts are not impacts: two corners pressed at the same time; the
            body has come to rest, or is in contact at the end.
    """

    def __init__(
        self, dynamics: Dynamics, true: State, span: np.ndarray, most: int = MOST_HITS, touches: bool = False
    ) -> None:
        self.dynamics, self.start, self.most = dynamics, true, most
        self.span = span + LATEST if most == 1 else span
        self.points, n = contact_points(dynamics.rig), len(span)
        self.rigs: dict[int, Rig] = {}  # rigs with all contact points, by the number of bodies
        self.motion, self.t = np.concatenate([true.q, true.v], axis=1), np.zeros(n)
        self.hits, self.pressed = np.zeros(n, int), np.zeros(n, bool)
        # last hit: contact point, motion and time at touch, and the time at which the contact ends
        self.last = np.full(n, -1)
        self.touch, self.touch_t, self.over = self.motion.copy(), np.zeros(n), np.full(n, -np.inf)
        if not touches:
            self._rewind()
        rows = np.arange(n)
        while len(rows := rows[(self.t[rows] < self.span[rows] - _NOW) & (self.hits[rows] < most)]):
            steps = int(np.ceil((self.span[rows] - self.t[rows]).max() / STEP))
            for part in np.array_split(rows, 1 + len(rows) * steps * self.points // LARGEST):
                self._advance(part)
        self.rests = (self.hits >= MOST_HITS) | (self.over > self.span)
        off = np.flatnonzero(np.abs(self.t - span) > _NOW)
        if len(off):
            self._set(off, self.dynamics.select(off).flown(self._state(off), (span - self.t)[off]))
            self.t[off] = span[off]

    def _rewind(self) -> None:
        """Fly back until no approaching contact point has reached the surface."""
        rows = np.arange(len(self.t))
        for _ in range(MOST_BACK):
            self._set(rows, self.dynamics.select(rows).flown(self._state(rows), np.full(len(rows), -LEAD)))
            self.t[rows] -= LEAD
            rows = rows[self._lands(self._state(rows), rows)]
            if not len(rows):
                return

    @property
    def after(self) -> State:
        """True states at the end."""
        return self._state(np.arange(len(self.t)))

    def _state(self, rows: np.ndarray) -> State:
        return self._of(self.motion[rows], self.t[rows], rows)

    def _of(self, motion: np.ndarray, t: np.ndarray, rows: np.ndarray) -> State:
        """States of the bodies `rows` with poses and velocities `motion` at their times t in s."""
        start, poses = self.start, self.start.space.poses
        t = start.t[rows] + t
        return State.of(motion[:, :poses], motion[:, poses:], start.trial[rows], t, self._surface(rows), start.space)

    def _surface(self, rows: np.ndarray) -> np.ndarray | None:
        return None if self.start.surface is None else self.start.surface[rows]

    def _set(self, rows: np.ndarray, state: State) -> None:
        poses, v = state.space.poses, state.v
        # for trial values of an inertia, for example, an impulse may give an extreme spin: stop the body
        possible = (np.abs(v) < FASTEST).all(axis=1, keepdims=True)
        self.motion[rows, :poses], self.motion[rows, poses:] = state.q, np.where(possible, v, 0.0)

    def _advance(self, rows: np.ndarray) -> None:
        """Fly the bodies `rows` to the end, or through the next hit.

        The steps of each body start at its own state, independently of the other bodies in the batch.
        """
        dynamics, end = self.dynamics.select(rows), self.span[rows]
        left = end - self.t[rows]
        steps, h = np.ceil(left / STEP).astype(int), np.full(len(rows), STEP)
        lands, step, start = self._fly(rows, h, steps)
        t, own = self.t[rows] + step * h, np.flatnonzero(lands)
        if len(own):
            struck, at_step = rows[own], start.select(own)
            a = dynamics.select(own).middle_acceleration(at_step, h[own])
            rest = self._instant(at_step, a, h[own], struck)
            self._set(struck, at_step.flown(a, rest))
            self.t[struck] = t[own] + rest
            lands[own] = self.t[struck] <= end[own]
        flies = np.flatnonzero(~lands)
        if len(flies):
            self._set(rows[flies], dynamics.select(flies).flown(start.select(flies), (end - t)[flies]))
            self.t[rows[flies]] = end[flies]
        if lands.any():
            self._hit(rows[lands])

    def _fly(self, rows: np.ndarray, h: np.ndarray, steps: np.ndarray) -> tuple[np.ndarray, np.ndarray, State]:
        """Fly the bodies `rows` by fewer than `steps` (n,) of h (n,) in s, or until they land.

        Returns which of them land (n,), the number of steps (n,) before the one in which they land or end, and their
        states then.  A few steps are evaluated at once, because most bodies land early and small arrays fit the
        processor's cache.
        """
        at, state, done, first = np.arange(len(rows)), self._state(rows), 0, True
        origin, found, after, starts, landed = state, [], [], [], np.zeros(len(rows), bool)
        soon = not self.hits[rows].any()
        while len(at):
            limit = AT_FIRST if soon and first else AHEAD
            left = steps[at] - done
            ahead = min(int(left.max()), limit, max(1, IN_CACHE // (len(at) * self.points)))
            path = self._path(origin, state, h[at], done, ahead, rows[at])
            looked = path if first else path.select(slice(len(at), None))
            count = ahead + first
            lands = self._lands(looked, np.tile(rows[at], count)).reshape(count, len(at))
            lands &= np.arange(1 - first, ahead + 1)[:, None] <= left
            any_lands = lands.any(axis=0)
            ends = np.flatnonzero(any_lands | (left <= ahead))
            before = np.where(any_lands, np.maximum(lands.argmax(axis=0) - first, 0), left - 1)[ends]
            landed[at[any_lands]] = True
            found.append(at[ends])
            after.append(done + before)
            starts.append(path.select(before * len(at) + ends))
            fly = np.flatnonzero(~any_lands & (left > ahead))
            state, origin = path.select(ahead * len(at) + fly), origin.select(fly)
            at, done, first = at[fly], done + ahead, False
        order = np.argsort(np.concatenate(found))
        return landed, np.concatenate(after)[order], State.joined(starts).select(order)

    def _path(self, origin: State, state: State, h: np.ndarray, done: int, ahead: int, rows: np.ndarray) -> State:
        """States ((ahead + 1) n,) after `done`, `done` + 1, ... `done` + `ahead` steps of h (n,) in s.

        `origin` (n,) are the states before the first step, `state` (n,) the states after `done` steps.
        """
        dynamics = self.dynamics.select(rows)
        if dynamics.model.has_varying_flight:
            return dynamics.stepped(state, h, ahead)
        times = np.multiply.outer(np.arange(done, done + ahead + 1), h)
        if not origin.space.is_plane:
            return dynamics.along(origin, times)
        path = origin.tiled(ahead + 1)
        return path.flown(dynamics.rig.fall(path).T, times.ravel())

    def _instant(self, start: State, a: np.ndarray, h: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Times (n,) in s after `start` at which the first point touches, at most `h`.

        A point that starts below the surface and rises touches when it next comes down.
        """
        (before, rate), (after, last) = self._gaps(start, rows), self._gaps(start.flown(a, h), rows)
        each, bend = np.arange(len(h)), (after - before - rate * h) / (h * h)
        before, above = np.where(np.abs(before) < ON, 0.0, before), before > -ON
        # when the parabola through both crosses the surface downwards
        root = np.sqrt(np.maximum(rate * rate - 4.0 * bend * before, 0.0))
        late = np.divide(root + rate, -2.0 * bend, out=np.array(np.broadcast_to(h, rate.shape)), where=bend < 0.0)
        when = np.divide(2.0 * before, root - rate, out=late, where=rate < 0.0)
        when = np.where(above, np.clip(when, 0.0, h), h * (rate >= 0.0))
        point = np.where((after <= 0.0) & (last < 0.0), when, np.inf).argmin(axis=0)
        t, above = when[point, each], above[point, each]
        dynamics = self.dynamics.select(rows)
        touching = dynamics.on(one_point(dynamics.rig, point))
        for k in range(NEWTON + 1):
            now = start.flown(a, t)
            gap, v_n = touching.gap(now), touching.contact(now)[1].v_n
            falls = v_n < -SLOWEST
            step = np.divide(-gap, v_n, out=np.zeros_like(gap), where=above & falls) * (k < NEWTON)
            t = np.clip(np.where(falls, t + step, t + LATER * h), 0.0, h)
        return t

    def rise(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Acceleration (n, 3) in m/s², m/s², rad/s² and time (n,) in s until the body leaves the surface.

        The time is 0 s for bodies that have left it, and for bodies that do not leave it within `LONGEST`.
        """
        rows, a = np.arange(len(state)), self.dynamics.true_acceleration(state)
        h = np.zeros(len(state))
        for _ in range(NEWTON):
            gap, v_n = self._gaps(state.flown(a, h), rows)
            point = np.where(v_n > 0.0, gap, np.inf).argmin(axis=0)  # the lowest of the rising points
            gap, v_n = gap[point, rows], v_n[point, rows]
            h = np.maximum(h - np.divide(gap, v_n, out=np.zeros_like(h), where=v_n > 0.0), 0.0)
        return a, np.where((h < LONGEST) & (v_n > 0.0), h, 0.0)

    def _lands(self, state: State, rows: np.ndarray) -> np.ndarray:
        """Mask (n,) of the bodies `rows` with a point that has reached the surface in states (n,) and approaches it."""
        dynamics, rig, lands = self.dynamics, self.dynamics.rig, np.zeros(len(rows), bool)
        if self.points == 1:
            gap = dynamics.select(rows).gap(state)[None]
        elif dynamics.model.acting("gap"):
            every, states = self._of_points(state, rows)
            gap = every.gap(states).reshape(self.points, -1)
        elif state.space.is_plane:
            gap = rig.shape.gaps(state.y, state.theta, rig.height)  # pyright: ignore[reportAttributeAccessIssue]
        else:
            points = rig.shape.minkowski  # pyright: ignore[reportAttributeAccessIssue]
            gap = points.heights(state.attitude) + (state.height - rig.height)
        point, low = np.nonzero(gap <= 0.0)
        if len(low):
            at = dynamics.select(rows[low]).on(one_point(rig, point)).contact(state.select(low))[1]
            lands[low[at.v_n < 0.0]] = True
        return lands

    def _gaps(self, state: State, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gap in m and v_n in m/s of all contact points of the bodies `rows` in states (n,), each (p, n)."""
        every, states = self._of_points(state, rows)
        gap, v_n = every.gap(states), every.contact(states)[1].v_n
        return gap.reshape(self.points, -1), v_n.reshape(self.points, -1)

    def _of_points(self, state: State, rows: np.ndarray) -> tuple[Dynamics, State]:
        """Dynamics and states (p n,) of the bodies `rows` with their first contact point, then the second, ..."""
        n, p = len(state), self.points
        every = self.dynamics.select(rows if p == 1 else np.tile(rows, p))
        if n not in self.rigs:
            self.rigs[n] = all_points(every.rig, n)
        return every.on(self.rigs[n]), state if p == 1 else state.tiled(p)

    def _hit(self, rows: np.ndarray) -> None:
        """Resolve the hits of the bodies `rows`, which touch at this instant."""
        point, now = _first(*self._gaps(self._state(rows), rows)), self.t[rows]
        self.hits[rows] += 1
        if self.dynamics.integrated:
            self.touch[rows], self.touch_t[rows] = self.motion[rows], now
            return self._press(rows)
        # a corner may touch at the very instant at which another separates
        again = (now < self.over[rows] - _NOW) & (point != self.last[rows])
        if again.any():
            self._press(rows[again])
            rows, point, now = rows[~again], point[~again], now[~again]
        if not len(rows):
            return
        self.touch[rows], self.touch_t[rows], self.last[rows] = self.motion[rows], now, point
        touch, dynamics = self._state(rows), self.dynamics.select(rows)
        struck = dynamics.on(one_point(dynamics.rig, point))
        delay = struck.delay(touch)
        after, _ = struck.collide(dynamics.flown(touch, delay))
        self._set(rows, after)
        self.t[rows] += delay
        if dynamics.model.takes_time:
            self.over[rows] = now + duration(1.0, dynamics.values["epsilon"]) * delay

    def _press(self, rows: np.ndarray) -> None:
        """Integrate the contacts of the bodies `rows` from the touch of their last hit."""
        self.pressed[rows] = True
        t = self.touch_t[rows]
        touch = self._of(self.touch[rows], t, rows)
        # if a contact ends after the next arc has begun, that arc is followed back to the end of the span
        left = 0.0 if self.most == 1 else self.span[rows] - t
        after, elapsed = self.dynamics.select(rows).press(touch, left)
        self._set(rows, after)
        self.t[rows] = self.over[rows] = t + elapsed


def _first(gap: np.ndarray, v_n: np.ndarray) -> np.ndarray:
    """Index (n,) of the point that touches: the lowest approaching point."""
    return np.where(v_n < 0.0, gap, np.inf).argmin(axis=0)
