"""Whole tosses in space by a model: flights, hits at corners, edges and faces, sliding, and rest, from frame to frame.

Flights and hits are those of episodes (`thesis_lib/critique/contacts/episodes.py`), where the law acts at one contact
point after the other.  Where no sequence of impacts describes what happens, all points press at once with springs, as
there: in hits slower than `REST`, in more than `MOST_HITS` a frame, and in all contacts that are integrated.  In hits
slower than `REST` the surface supports the body, with the friction of `sliding_friction` if the model has it.  A
contact that is not over at a frame goes on from the surface.  A body rests that stays within `STILL` for `STAYS`.
Within a contact that takes time a frame shows the cubic that joins the states at its ends.
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
PRESSING = 1e-3  # s, a central contact of a law that takes no time, where it has to press
STILL, STAYS = 1e-4, 0.03  # m of the centre and of the body's farthest point, s
EVER = 10**9  # hits of a toss


@dataclass(frozen=True)
class Tosses:
    """n tosses at k instants.

    Attributes:
        true: the states (k n,), first those of all bodies at their first instant.
        hits: (k, n) faster than `REST` until then.
        rests: (n,) bodies that have come to rest.
    """

    true: State
    hits: np.ndarray
    rests: np.ndarray


def toss(dynamics: ByImpulse, start: State, times: np.ndarray) -> Tosses:
    """The tosses of n bodies from true states `start` on, at times (k, n) in s after it, which do not fall."""
    played = _Toss(_able_to_press(dynamics, start), start)
    states, hits = [], []
    for t in times:
        states.append(played.at(t))
        hits.append(played.struck.copy())
    return Tosses(State.joined(states), np.array(hits), played.rests)


def reported(dynamics: Dynamics, tosses: Tosses) -> State:
    """Measured states of true ones, which may depend on all that the body has turned since the first."""
    true, n = tosses.true, tosses.hits.shape[1]
    if "rotation_scale.s_R" in dynamics.values:
        by_toss = np.arange(len(true)).reshape(-1, n).T.ravel()
        frames = WholeTosses.of(true.select(by_toss), np.zeros(0), np.zeros(0))
        summed = replace(frames, turn=(1.0 + dynamics.values["rotation_scale.s_R"]) * frames.turn)
        dynamics = dynamics.on(replace(dynamics.rig, recorded=summed))
    return dynamics.to_measured(true)


def _able_to_press(dynamics: ByImpulse, start: State) -> ByImpulse:
    """The dynamics with a contact time to press with, and with first touches that nobody has seen yet."""
    n = len(start)
    order = np.argsort(start.trial)
    none = WholeTosses(start.trial[order], np.zeros(n), np.zeros((3, n)), np.full(n, np.inf))
    values = {"tau": PRESSING} | dict(dynamics.values)
    return bind(dynamics.model, values, replace(dynamics.rig, recorded=none))


class _Toss(Played):
    """Bodies from frame to frame, which start above the surface or on it."""

    def __init__(self, dynamics: ByImpulse, start: State) -> None:
        n = len(start)
        super().__init__(dynamics, start, np.zeros(n), EVER, touches=True)
        self.rests, self.struck, self.before = np.zeros(n, bool), np.zeros(n, int), np.zeros(n, int)
        self.there, self.since = self.motion.copy(), np.zeros(n)  # where a body was when it last moved
        self.order = np.argsort(np.argsort(start.trial))
        self.striking, values = dynamics, dynamics.values
        self.supported = (
            bind(dynamics.model, {**values, "mu": values[SLIDING]}, dynamics.rig) if SLIDING in values else dynamics
        )

    def at(self, t: np.ndarray) -> State:
        """The states at times t (n,) in s, later than all before."""
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
        """Find the bodies that have not moved for long, and stop them."""
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
