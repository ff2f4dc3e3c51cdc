"""Collection of samples by the base exploration policy: random block, contact locations and headings; early retreat.

A run on one tower tries blocks in random order until one falls, all 45 have been tried, or there are enough samples.
A push ends when the robot gives up (at random, so that 100 samples contain stuck and free blocks), measures that the
tower moves too far, a force is above the limit (if any) or the block leaves its path, has pushed as far as allowed, or
has the block far enough out, which is then extracted and placed.  A fall ends the run, and the sample in which it
happens is discarded.  If `miss` is set, some pushes touch nothing and have no hidden label.  Each tower has its own
random stream.  The hidden label of a push (`PushSamples.truth`) comes from a trial push just before it, about as long
as the push itself.  Training samples are collected without it (`UNKNOWN`), otherwise identical to the last bit.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from thesis_lib.jenga.play.policies import explored
from thesis_lib.jenga.play.settings import SampleChoice, TowerChoice
from thesis_lib.jenga.robot.movable import hidden_label
from thesis_lib.jenga.robot.primitives import Gripper
from thesis_lib.jenga.robot.robot import Robot
from thesis_lib.jenga.robot.samples import F_N, MM, RANGE, STATE, TOWER, UNKNOWN, YAW, PushSamples, Y, join
from thesis_lib.jenga.tower.settings import Setup
from thesis_lib.jenga.tower.tower import REACHABLE, TowerError, check_standing, reduce, settled_tower

APART = 1000  # difference between the first seeds of successive training sets
REFUSED = 3  # number of unusable towers in a row that indicates faulty settings rather than a faulty tower
ATTEMPT = ("tower", "block", "layer", "side", "truth", "steps", "pushed", "extracted", "placed", "reason")


class _Run:
    """One tower under exploration."""

    def __init__(self, seed: int, rng: np.random.Generator, setup: Setup, label: bool):
        self.seed, self.rng, self.setup, self.label = seed, rng, setup, label
        self.rows: list[tuple] = []
        self.attempts: list[tuple] = []
        self.tower = settled_tower(seed, setup)

    def try_block(self, block: int, limit: int) -> bool:
        """Try one block, and return whether the run continues."""
        reduced = self.setup.collect.reduced
        tower = reduce(self.tower, block) if reduced else self.tower
        share = self.setup.collect.miss
        missed = share > 0.0 and self.rng.random() < share
        if self.label and not missed:
            truth = hidden_label(tower, block, self.setup.movable)
        else:
            truth = UNKNOWN
            tower.load(tower.save())  # recompute the poses from the present state, as after a trial push
        robot = Robot(tower, self.setup.sensing, self.rng)
        first, where = len(self.rows), (tower.layer[block], int(tower.is_side(block)))
        # simulate a missing block: the finger starts further off than the longest push
        off = 2.0 * tower.robot_settings.longest_push if missed else None
        reason = self._push(robot, block, truth, limit, off)
        fell = reason in ("dropped", "tower toppled")
        if not fell:
            robot.retract()
        extracted = placed = -1  # not tried
        if reason == "goal" and not reduced:
            gripper = Gripper(tower)
            outcome = gripper.extract(block)
            extracted = int(outcome.success)
            if gripper.held is not None and not outcome.ends_run:
                outcome = gripper.place(self.rng)
                placed = int(outcome.success)
            fell = outcome.ends_run
            reason = outcome.reason or reason
        steps = len(self.rows) - first
        pushed = int(reason == "goal" or extracted >= 0)
        self.attempts.append((self.seed, block, *where, truth, steps, pushed, extracted, placed, reason))
        if reduced:
            return True
        if not fell:
            check_standing(self.tower)
        return not fell

    def _push(self, robot: Robot, block: int, truth: int, limit: int, off: float | None) -> str:
        """Push until there is a reason to stop, and return it."""
        settings, push = self.setup.collect, len(self.attempts)
        offset, heading = explored(settings, self.rng)
        robot.start(block, offset, off)
        context = robot.tower.context(block)
        for step in range(limit - len(self.rows)):
            if self.rng.random() < settings.change:
                offset, heading = explored(settings, self.rng)
            before, after = robot.push_step(offset, heading)
            if robot.tower.fallen().size:
                return "tower toppled" if robot.tower.toppled(block) else "dropped"
            if not (_in_range(before) and _in_range(after)):
                return "left its way"
            self.rows.append((push, step, block, truth, before, (MM * offset, heading), after, context))
            if robot.reached_goal():
                return "goal"
            if robot.at_end():
                return "longest push"
            if after[TOWER] > MM * settings.tower_limit:
                return "tower moves"
            if settings.force_limit is not None and after[F_N] > settings.force_limit:
                return "force"
            if max(abs(after[Y]), abs(after[YAW])) > MM * settings.stray_limit:
                return "left its way"
            if step + 1 >= settings.fewest and self.rng.random() < settings.retract:
                return "gave up"
        return "enough samples"

    def samples(self) -> PushSamples:
        push, step, block, truth, before, action, after, context = (np.array(column) for column in zip(*self.rows))
        tower = np.full(len(push), self.seed)
        return PushSamples(push, step, before, action, after, context, truth, tower, block)


def _in_range(state: np.ndarray) -> bool:
    return all(RANGE[name][0] <= value <= RANGE[name][1] for name, value in zip(STATE, state))


def explore_tower(
    seed: int,
    base_seed: int,
    setup: Setup | None = None,
    limit: int = 10**6,
    blocks: Sequence[int] = tuple(REACHABLE),
    *,
    label: bool = True,
) -> tuple[PushSamples | None, pd.DataFrame]:
    """Collect at most `limit` samples of one tower (None if there are none), with a table of the blocks tried.

    blocks: candidates, tried in random order.  seed: of the tower; with base_seed, it also fixes the policy's choices
    and the noise.  label: determine each block's hidden label before it is pushed.  Columns of the table: `ATTEMPT`;
    extracted and placed are -1 if not tried.  TowerError if the tower does not stand when settled, or the simulation
    breaks down.
    """
    rng = np.random.default_rng(np.random.SeedSequence(base_seed, spawn_key=(5, seed)))
    run = _Run(seed, rng, setup or Setup(), label)
    for block in rng.permutation(blocks):
        if len(run.rows) >= limit or not run.try_block(int(block), limit):
            break
    return run.samples() if run.rows else None, pd.DataFrame(run.attempts, columns=list(ATTEMPT))


def collect(
    n: int, first_seed: int, base_seed: int, setup: Setup | None = None, per_tower: int = 100, *, label: bool = True
) -> tuple[PushSamples, pd.DataFrame]:
    """Collect `n` samples from towers first_seed, first_seed + 1, …, at most `per_tower` of each; samples and table.

    An unusable tower gives no samples and one row of the table, with block -1 and the error as reason.  TowerError for
    `REFUSED` unusable towers in a row.
    """
    parts, tables, seed, refused = [], [], first_seed, 0
    while (have := sum(map(len, parts))) < n:
        try:
            samples, table = explore_tower(seed, base_seed, setup, min(per_tower, n - have), label=label)
        except TowerError as error:
            refused += 1
            if refused == REFUSED:
                raise
            row = dict.fromkeys(ATTEMPT, -1) | {"tower": seed, "reason": str(error)}
            samples, table = None, pd.DataFrame([row])
        else:
            refused = 0
        parts += [samples] if samples is not None else []
        tables.append(table)
        seed += 1
    joined = join(parts)
    joined.check_resistance()
    return joined, pd.concat(tables, ignore_index=True)


def collect_named(
    name: str, most: int, setup: Setup, towers: TowerChoice, choice: SampleChoice, seed: int
) -> tuple[PushSamples, pd.DataFrame]:
    """Collect "set_0", "set_1", ... (`most` samples, unlabelled) or "held_out"; samples and table of blocks tried."""
    if name == "held_out":
        return collect(choice.held_out, towers.first_held_out + 1, seed, setup, choice.per_tower)
    first = towers.first_training + int(name.split("_")[1]) * APART
    return collect(most, first, seed, setup, choice.per_tower, label=False)
