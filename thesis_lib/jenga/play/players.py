"""Construction of policies from their names, trained on samples if they learn.

Learners are hma, mor and network.  The controller penalises growth of p(no move) for hma only; hma_without_cost,
mor_with_cost and network_with_cost are the same learners, fitted with the same random numbers, without and with
it.  hma_one_shot learns abstractions and transitions jointly.  Rule, always_push, exploration, oracle need no training.

The oracle simulates each push on the tower before making it: an upper bound for the other policies.  For each block a
straight push to the goal and the extraction are simulated, and the tower is restored.  The push is made only if no
damage was done.  The oracle judges each block alone and ignores what follows for the tower, so it bounds policies that
push straight and decide block by block.  If pushes start in contact, simulated and real push agree to the last bit.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.play.policies import Action, AlwaysPush, Exploration, Policy, Push, Retract, RulePolicy
from thesis_lib.jenga.play.settings import Chapter5, OracleSettings
from thesis_lib.jenga.robot.movable import comes_out
from thesis_lib.jenga.robot.samples import MM, PushSamples
from thesis_lib.jenga.tower.tower import Tower, TowerError

if TYPE_CHECKING:  # learners need torch, which takes longer to import than a rule takes to play a block
    from thesis_lib.jenga.learners.hma import Hma
    from thesis_lib.jenga.learners.learner import Learner


# policy -> the policy with the same learner, from which it differs in the controller only
LEARNS_AS = {"hma_without_cost": "hma", "mor_with_cost": "mor", "network_with_cost": "network"}
WITHOUT_COST = ("hma_without_cost", "mor", "network")


class Oracle(Policy):
    """Policy with access to the true tower, which simulates each push before it is made."""

    name = "oracle"
    SEES_TOWER: ClassVar[bool] = True
    tower: Tower

    def __init__(self, settings: OracleSettings | None = None):
        self.settings = settings or OracleSettings()

    def start(self, block: int, context: np.ndarray) -> None:
        pushes = map(Push, self.settings.offsets)
        good = (push for push in pushes if would_succeed(self.tower, block, push, self.settings.damage))
        self.plan: Action = next(good, Retract("would do damage"))

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        return self.plan


def would_succeed(tower: Tower, block: int, push: Push, damage: float) -> bool:
    """Whether repeating `push` and gripping extract the block while others move by at most `damage` (mm)."""
    try:
        return comes_out(tower, block, lambda apart, _: MM * apart > damage, push.offset / MM, push.heading)
    except TowerError:  # a collapse too violent to simulate is still a collapse
        return False


def learner_of(name: str, settings: Chapter5) -> "Learner":
    """Unfitted learner of the policy `name`; UserError for an unknown name."""
    from thesis_lib.jenga.learners.hma import Hma
    from thesis_lib.jenga.learners.mor import Mor
    from thesis_lib.jenga.learners.networks import Network

    learners = {"hma": Hma, "hma_one_shot": Hma, "mor": Mor, "network": Network}
    learns = LEARNS_AS.get(name, name)
    if learns not in learners:
        raise UserError(f"there is no learner {name}; choose one of {', '.join([*learners, *LEARNS_AS])}.")
    one_shot = settings.learner.one_shot or name == "hma_one_shot"
    return learners[learns](settings.learner.model_copy(update={"one_shot": one_shot}))


def policy_of(
    name: str, samples: PushSamples | None, size: int, settings: Chapter5, rng: np.random.Generator
) -> Policy:
    """Policy of this name, trained on the first `size` samples if it learns.

    UserError for an unknown name, or fewer than `size` samples.
    """
    play = settings.play
    fixed = {
        "rule": lambda: RulePolicy(play.rule),
        "always_push": AlwaysPush,
        "exploration": lambda: Exploration(play.supervisor, settings.setup.collect),
        "oracle": lambda: Oracle(play.oracle),
    }
    if name in fixed:
        return fixed[name]()
    from thesis_lib.jenga.play.controller import Learned

    learner = learner_of(name, settings)
    if samples is None or len(samples) < size:
        have = 0 if samples is None else len(samples)
        raise UserError(f"{name} needs {size} training samples, but there are {have}; collect more.")
    controller = play.controller
    if name in WITHOUT_COST:
        controller = controller.model_copy(update={"no_move": 0.0})
    return Learned(learner.fit(samples.first(size), rng), controller, name)


def fitted(sets: Sequence[PushSamples], settings: Chapter5, rng: np.random.Generator) -> "dict[tuple[int, int], Hma]":
    """HMA fitted for every size and training set, by (size, number of the set)."""
    return {
        (size, i): learner_of("hma", settings).fit(samples.first(size), rng)
        for size in settings.games.sizes
        for i, samples in enumerate(sets)
    }
