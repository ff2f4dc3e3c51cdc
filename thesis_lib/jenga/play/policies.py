"""Policies of a game: one interface for rules, exploration, learned controllers and the oracle.

At each step a policy gets the last reading z_t and answers with a push a_t of 1 mm or a retreat; after a push it gets
the reading that follows.  Policies see readings only, except the oracle, which has the tower (`SEES_TOWER`).  Readings
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
    """Give the block up, for this reason."""

    reason: str = "gave up"


STRAIGHT = Push()
Action = Push | Retract


class Policy:
    """Plays one game at a time, block by block; without memory unless a subclass keeps something."""

    name: str
    SEES_TOWER: ClassVar[bool] = False

    def begin(self, rng: np.random.Generator) -> None:
        """A new game; the policy's random choices come from `rng`."""
        self.rng = rng

    def start(self, block: int, context: np.ndarray) -> None:
        """A new block, not yet touched."""

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        """The next action after the last reading (7,)."""
        raise NotImplementedError

    def observe(self, state: np.ndarray, action: Push, next_state: np.ndarray) -> None:
        """Readings (7,) before the push, in contact, and after it."""


def beyond(state: np.ndarray, settings: RuleSettings | SupervisorSettings) -> Retract | None:
    """A retreat where force or tower perturbation of a reading (7,) exceeds its threshold."""
    if state[F_N] > settings.force:
        return Retract("force")
    return Retract("tower moves") if state[TOWER] > settings.tower else None


def explored(settings: CollectSettings, rng: np.random.Generator) -> tuple[float, float]:
    """Contact (m) and heading (rad) of the base exploration policy, drawn anew."""
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

    Unlike collection it never gives up at random: only the supervisor ends a push.
    """

    def __init__(
        self,
        settings: SupervisorSettings | None = None,
        collect: CollectSettings | None = None,
        name: str = "exploration",
    ):
        self.settings, self.random, self.name = settings or SupervisorSettings(), collect or CollectSettings(), name

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
