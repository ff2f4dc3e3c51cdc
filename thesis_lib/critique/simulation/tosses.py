"""Simulation of whole tosses in space with a model: flights, hits at corners, edges and faces, sliding, and rest.

Flights and hits are computed as in episodes (`thesis_lib/critique/contacts/episodes.py`): the law acts at one contact
point after another.  If no sequence of impacts describes the contact, springs act at all points at the same time, also
as in episodes: in hits slower than `REST`, with more than `MOST_HITS` hits per frame, and in all contacts that are
integrated.  In hits slower than `REST` the surface supports the body, with the friction of `sliding_friction` if the
model has this effect.  A contact that continues at a frame is resumed at the surface.  A body that stays within `STILL`
for `STAYS` is at rest.  In a contact of finite duration, frames lie on the cubic through the states at its ends.
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.contacts.episodes import _NOW, MOST_HITS, Played, _first
from thesis_lib.critique.contacts.kinds import ByImpulse, bind
from thesis_lib.critique.simulation.law_drops import REST, on_cubic
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State

SLIDING = "sliding_friction.mu_s"
PRESSING = 1e-3  # s, duration of a central contact for spring contact if the law itself has none
STILL, STAYS = 1e-4, 0.03  # m, for the centre and the body's farthest point; s
EVER = 10**9  # limit on the hits of a toss: none


@dataclass(frozen=True)
class Tosses:
    """n tosses at k instants.

    Attributes:
        true: states (k n,), instant by instant for all bodies.
        hits: (k, n) number of hits faster than `REST` so far.
        rests: (n,) whether each body has come to rest.
    """

    true: State
    hits: np.ndarray
    rests: np.ndarray


def toss(dynamics: ByImpulse, start: State, times: np.ndarray) -> Tosses:
    """Simulate n bodies from true states `start`, at non-decreasing times (k, n) in s after the start."""
    played = _Toss(_able_to_press(dynamics, start), start)
    states, hits = [], []
    for t in times:
        states.append(played.at(t))
        hits.append(played.struck.copy())
    return Tosses(State.joined(states), np.array(hits), played.rests)


def reported(dynamics: Dynamics, tosses: Tosses) -> State:
    """Return the measured states of true states; they may depend on the total rotation since the first state."""
    true, n = tosses.true, tosses.hits.shape[1]
    if "rotation_scale.s_R" in dynamics.values:
        by_toss = np.arange(len(true)).reshape(-1, n).T.ravel()
        even = dynamics.with_active([(e, p) for e, p in dynamics.active if e.name != "rotation_scale"])
        frames = WholeTosses.of(even.to_measured(true.select(by_toss)), np.zeros(0), np.zeros(0))
        summed = replace(frames, turn=(1.0 + dynamics.values["rotation_scale.s_R"]) * frames.turn)
        dynamics = dynamics.on(replace(dynamics.rig, recorded=summed))
    return dynamics.to_measured(true)


def _able_to_press(dynamics: ByImpulse, start: State) -> ByImpulse:
    """Return the dynamics with a contact time for spring contacts, and with no first touch recorded yet."""
    n = len(start)
    order = np.argsort(start.trial)
    none = WholeTosses(start.trial[order], np.zeros(n), np.zeros((3, n)), np.full(n, np.inf))
    values = {"tau": PRESSING} | dict(dynamics.values)
    return bind(dynamics.model, values, replace(dynamics.rig, recorded=none))


class _Toss(Played):
    """Bodies that are simulated from frame to frame, starting above the surface or on it."""

    def __init__(self, dynamics: ByImpulse, start: State) -> None:
        n = len(start)
        super().__init__(dynamics, start, np.zeros(n), EVER, touches=True)
        self.rests, self.struck, self.before = np.zeros(n, bool), np.zeros(n, int), np.zeros(n, int)
        self.there, self.since = self.motion.copy(), np.zeros(n)  # state and time at which a body last moved
        self.order = np.argsort(np.argsort(start.trial))
        self.striking, values = dynamics, dynamics.values
        self.supported = (
            bind(dynamics.model, {**values, "mu": values[SLIDING]}, dynamics.rig) if SLIDING in values else dynamics
        )

    def at(self, t: np.ndarray) -> State:
        """Return the states at times t (n,) in s, which must not decrease from call to call."""
        self.span, self.before = np.asarray(t, float), self.hits.copy()
        rows = np.flatnonzero(~self.rests)
        while len(rows := rows[self.t[rows] < self.span[rows] - _NOW]):
            self._advance(rows)
        self._settle()
        now = self._state(np.arange(len(t)))
        over = np.maximum(self.t, self.over)
        rows = np.flatnonzero((over > t + _NOW) & (self.touch_t < t) & (self.hits > 0))
        if len(rows):
            end = now.select(rows)
            end = self.dynamics.select(rows).flown(end, over[rows] - self.t[rows])
            touch, when = self._of(self.touch[rows], self.touch_t[rows], rows), self.start.t[rows] + t[rows]
            now = now.put(rows, on_cubic(touch, end, when))
        return State(now.pose, now.motion, now.trial, self.start.t + t, now.surface, now.space)

    def _settle(self) -> None:
        """Find the bodies that have not moved for `STAYS`, and stop them."""
        poses = SPACE.poses
        moved = SPACE.difference(self.motion[:, :poses].T, self.there[:, :poses].T)
        moved[3:] *= self.dynamics.rig.shape.extent
        moves = (np.abs(moved).max(axis=0) > STILL) | (self.hits == 0)
        self.there[moves], self.since[moves] = self.motion[moves], self.t[moves]
        self.rests = self.t - self.since > STAYS
        self.motion[self.rests, poses:] = 0.0

    def _hit(self, rows: np.ndarray) -> None:
        gap, v_n = self._gaps(self._state(rows), rows)
        slow = supported = v_n[_first(gap, v_n), np.arange(len(rows))] > -REST
        self.struck[rows] += ~slow
        of = self.order[rows]
        assert self.dynamics.rig.recorded is not None
        touched = self.dynamics.rig.recorded.touched
        touched[of] = np.minimum(touched[of], self.start.t[rows] + self.t[rows])
        slow = (slow | (self.hits[rows] - self.before[rows] >= MOST_HITS)) & (not self.dynamics.integrated)
        for dynamics, chosen in ((self.supported, supported), (self.striking, ~supported)):
            self.dynamics = dynamics
            pressed, struck = rows[slow & chosen], rows[~slow & chosen]
            if len(pressed):
                self.hits[pressed] += 1
                self.touch[pressed], self.touch_t[pressed] = self.motion[pressed], self.t[pressed]
                self._press(pressed)
            if len(struck):
                super()._hit(struck)

    def _press(self, rows: np.ndarray) -> None:
        super()._press(rows)
        lowest = self._gaps(self._state(rows), rows)[0].min(axis=0)
        self.motion[rows, SPACE.dimension - 1] -= np.minimum(lowest, 0.0)
