"""Block steering (figure 5-9): an off-centre push makes a block turn and drift; does the controller bring it back?

Free blocks of development towers are pushed near one edge of the end face until they begin to rotate, as in the figure.
About half of them are held by a neighbour and hardly turn; these are left out before steering begins.  The others
continue from the same state and noise in two ways: straight at the centre, or by model predictive control with the
learned model and the weights `ShowcaseChoice.steering` (in the games a misaligned block costs little).

    stray = (y² + ψ²)^½ of the true state at the end, ψ = yaw · r_g, in mm

The hidden label and the true state select and evaluate the pushes; the controller sees readings only.

Source: thesis, section 5.5.4, figure 5-9; disturbance and comparison are own choices.
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.learner import Learner
from thesis_lib.jenga.play.controller import Learned
from thesis_lib.jenga.play.policies import AlwaysPush, Policy, Push, Retract
from thesis_lib.jenga.play.settings import ShowcaseChoice
from thesis_lib.jenga.robot.movable import hidden_label
from thesis_lib.jenga.robot.robot import Robot
from thesis_lib.jenga.robot.samples import ADVANCE, FREE, MM, YAW, X, Y
from thesis_lib.jenga.tower.settings import Setup
from thesis_lib.jenga.tower.tower import REACHABLE, settled_tower
from thesis_lib.statistics.intervals import mean_row, wilson, wilson_std

MOST = 60  # steps after which an unfinished push ends
FIRST = 5  # first steps of the controller, as many as its horizon, that show its response to the disturbance
HALF_WIDTH = 12.5  # mm, of a block
PUSH = ["tower", "block", "edge"]  # identifies a pair of a steered and a straight push


def steering_pushes(
    learner: Learner, seeds: Iterable[int], setup: Setup, choice: ShowcaseChoice, rng: np.random.Generator
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Push `choice.steered_blocks` free blocks that turn; tables of all steps and of the ends of the pushes.

    Blocks are taken from the towers `seeds` in turn until there are enough.  steps: tower, block, edge (mm,
    contact of the disturbance), steered (0 or 1), step, advance, x, y, yaw (mm, as read before the step), offset (mm),
    heading (rad), controlled (0 or 1: after the disturbance).  ends: tower, block, edge, steered, steps, out (0 or 1),
    stray (mm).  UserError if the towers have fewer such blocks, TowerError if a tower does not stand.
    """
    steps, ends, tried = [], [], []
    for seed in seeds:
        tower = settled_tower(seed, setup)
        tried.append(str(seed))
        settled = tower.save()
        for block in map(int, rng.permutation(REACHABLE)):
            tower.load(settled)
            if hidden_label(tower, block, setup.movable) != FREE:
                continue
            for edge in (choice.edge, -choice.edge):
                noise = int(rng.integers(2**31))
                for steered in (0, 1):
                    tower.load(settled)
                    policy = Learned(learner, choice.steering) if steered else AlwaysPush()
                    case = {"tower": seed, "block": block, "edge": edge, "steered": steered}
                    robot = Robot(tower, setup.sensing, np.random.default_rng(noise))
                    rows, end = _push(robot, block, edge, policy, choice)
                    if not end:
                        break
                    steps += [case | row for row in rows]
                    ends.append(case | end)
            if len({(end["tower"], end["block"]) for end in ends}) == choice.steered_blocks:
                return pd.DataFrame(steps), pd.DataFrame(ends)
    raise UserError(f"towers {', '.join(tried)} have fewer than {choice.steered_blocks} free blocks that turn.")


def _push(
    robot: Robot, block: int, edge: float, policy: Policy, choice: ShowcaseChoice
) -> tuple[list[dict], dict[str, float]]:
    """Rows and end of one push: at `edge` (mm) until the block has turned, then by the policy; end {} if not."""
    reading, context, rows, turned = robot.start(block), robot.tower.context(block), [], False
    policy.begin(robot.rng)
    policy.start(block, context)
    for step in range(MOST):
        turned = turned or abs(robot.state()[YAW]) >= choice.turned
        if not turned and step == choice.disturbed:
            return rows, {}
        action = policy.act(reading, context) if turned else Push(edge)
        if isinstance(action, Retract):
            break
        before, after = robot.push_step(action.offset / MM, action.heading)
        policy.observe(before, action, after)
        seen = {"advance": reading[ADVANCE], "x": reading[X], "y": reading[Y], "yaw": reading[YAW]}
        done = {"offset": action.offset, "heading": action.heading, "controlled": int(turned)}
        rows.append({"step": step} | seen | done)
        reading = after
        if robot.reached_goal() or robot.at_end() or robot.tower.fallen().size:
            break
    if not turned:
        return rows, {}
    true = robot.state()
    stray = float(np.hypot(true[Y], true[YAW]))
    return rows, {"steps": len(rows), "out": int(robot.reached_goal()), "stray": stray}


def steering_summary(steps: pd.DataFrame, ends: pd.DataFrame) -> pd.DataFrame:
    """Summary of `steering_pushes`: rows of quantity, value, std (standard error), low, high (95 %), n.

    stray_saved: stray (mm) of the straight push minus that of the steered push, mean over blocks.  out_saved: share of
    pushes that do not reach the goal, the same difference.  turned_back: share of steered pushes whose contact, mean of
    the controller's first `FIRST` steps, lies on the side that turns the block back (+y turns it to −yaw).  edge: that
    contact's distance from the centre, as a share of half the block's width.
    """
    wide = ends.pivot(index=PUSH, columns="steered", values=["stray", "out"])
    saved = (wide["stray"][0] - wide["stray"][1]).groupby(PUSH[:2]).mean().to_numpy()
    out_saved = (wide["out"][1] - wide["out"][0]).groupby(PUSH[:2]).mean().to_numpy(float)
    controlled = steps[(steps["steered"] == 1) & (steps["controlled"] == 1)]
    chosen = controlled.groupby(PUSH).head(FIRST).groupby(PUSH)
    offset, yaw = chosen["offset"].mean(), chosen["yaw"].first()
    back, edge = (offset * yaw > 0.0).to_numpy(), (offset.abs() / HALF_WIDTH).to_numpy()
    n = len(back)
    rows = [
        ("stray_saved", *mean_row(saved)),
        ("out_saved", *mean_row(out_saved)),
        ("turned_back", float(back.mean()), wilson_std(float(back.mean()), n), *wilson(float(back.sum()), n), n),
        ("edge", *mean_row(edge)),
    ]
    return pd.DataFrame(rows, columns=["quantity", "value", "std", "low", "high", "n"])


def strayed_most(steps: pd.DataFrame, ends: pd.DataFrame) -> pd.DataFrame:
    """Steps of the pair whose straight push strayed most, if both blocks came out; UserError if there is none."""
    pairs = ends.pivot(index=PUSH, columns="steered", values=["stray", "out"])
    both = pairs[(pairs["out"] == 1).all(axis=1)]
    if both.empty:
        raise UserError("no block came out both straight and steered, so there is nothing to show; use another tower.")
    return steps.set_index(PUSH).loc[[both["stray"][0].idxmax()]].reset_index()
