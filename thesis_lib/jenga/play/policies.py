"""Policies of a game: a common interface for rules, exploration, learned controllers and the oracle.

At each step a policy gets the last reading z_t and returns a push a_t of 1 mm or a retreat; after a push it gets
the next reading.  Policies see readings only, except the oracle, which has the true tower (`SEES_TOWER`).  Readings
are (7,), mm and N (`samples.STATE`); contexts are (2,) (`samples.CONTEXT`).

Source: thesis, sections 5.4.3 (execution loop, base exploration policy) and 5.5.3 (the exploration's supervisor).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from thesis_lib.jenga.play.settings import RuleSettings, SupervisorSettings
from thesis_lib.jenga.robot.samples import F_N, MM, TOWER, YAW, Y
from thesis_lib.jenga.tower.settings import CollectSettings


@dataclass(frozen=True)
class Push:
    """Advance by 1 mm: contact location (mm from the centre of the end face) and heading (rad, 0 along the block)."""

    offset: float = 0.0
    heading: float = 0.0


@dataclass(frozen=True)
class Retract:
    """Give up the block, for the reason stated."""

    reason: str = "gave up"


STRAIGHT = Push()
Action = Push | Retract


class Policy:
    """Base class: plays one game at a time, block by block; stateless unless a subclass keeps a state."""

    name: str
    SEES_TOWER: ClassVar[bool] = False

    def begin(self, rng: np.random.Generator) -> None:
        """Begin a new game; the policy's random choices come from `rng`."""
        self.rng = rng

    def start(self, block: int, context: np.ndarray) -> None:
        """Begin with a new block that has not been touched yet."""

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        """Return the next action after the last reading (7,)."""
        raise NotImplementedError

    def observe(self, state: np.ndarray, action: Push, next_state: np.ndarray) -> None:
        """Take in the readings (7,) before the push, in contact, and after it."""


def beyond(state: np.ndarray, settings: RuleSettings | SupervisorSettings) -> Retract | None:
    """Retreat if force or tower perturbation of a reading (7,) exceeds its threshold, else None."""
    if state[F_N] > settings.force:
        return Retract("force")
    return Retract("tower moves") if state[TOWER] > settings.tower else None


def explored(settings: CollectSettings, rng: np.random.Generator) -> tuple[float, float]:
    """Draw a contact location (m) and a heading (rad) for the base exploration policy."""
    offset, heading = settings.offset, settings.heading
    return float(rng.uniform(-offset, offset)), float(rng.uniform(-heading, heading))


class AlwaysPush(Policy):
    """Pushes straight and centred and never gives up."""

    name = "always_push"

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        return STRAIGHT


class RulePolicy(Policy):
    """Pushes straight and centred; gives up when force or tower perturbation exceeds a threshold."""

    name = "rule"

    def __init__(self, settings: RuleSettings | None = None):
        self.settings = settings or RuleSettings()

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        return beyond(state, self.settings) or STRAIGHT


class Exploration(Policy):
    """The base exploration policy (random contact locations and headings) under the thesis's supervisor.

    Unlike in collection, pushes are never given up at random: only the supervisor ends them.
    """

    name = "exploration"

    def __init__(self, settings: SupervisorSettings | None = None, collect: CollectSettings | None = None):
        self.settings, self.random = settings or SupervisorSettings(), collect or CollectSettings()

    def start(self, block: int, context: np.ndarray) -> None:
        self.last = self._draw()

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        if retreat := beyond(state, self.settings):
            return retreat
        if max(abs(state[Y]), abs(state[YAW])) > self.settings.stray:
            return Retract("left its way")
        if self.rng.random() < self.random.change:
            self.last = self._draw()
        return self.last

    def _draw(self) -> Push:
        offset, heading = explored(self.random, self.rng)
        return Push(MM * offset, heading)
