"""Showcases: belief over abstractions during pushes of a stuck and an easy block, and frames of a game.

Figure 5-8 shows straight, centred pushes of the first stuck and the first free block of a held-out tower; the hidden
label only selects the blocks.  It has each abstraction's prediction of the next reading and the belief of the filter
after each step and, every few steps, the belief of the No-U-Turn sampler from the same readings.

Source: thesis, section 5.5.4, figure 5-8.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.kalman import KalmanBank
from thesis_lib.jenga.learners.settings import NutsSettings
from thesis_lib.jenga.play.game import Game
from thesis_lib.jenga.robot.movable import hidden_label
from thesis_lib.jenga.robot.robot import Robot
from thesis_lib.jenga.robot.samples import F_N, KINDS, TOWER, X
from thesis_lib.jenga.study.showcase_nuts import Sampler, agreement
from thesis_lib.jenga.tower.settings import Setup
from thesis_lib.jenga.tower.tower import REACHABLE, settled_tower

SHOWN = 1  # seed of the development tower whose game is drawn; test towers are not shown
STEERED = (1, 2, 3, 4, 0)  # seeds of the development towers whose blocks are steered
PICTURES = 6


def straight_pushes(seed: int, setup: Setup, steps: int, rng: np.random.Generator) -> dict[str, dict[str, np.ndarray]]:
    """Readings (steps + 1, 7), mm and N, actions (steps, 2), context (2,), block by kind; UserError without one."""
    tower = settled_tower(seed, setup)
    settled = tower.save()
    pushes: dict[str, dict[str, np.ndarray]] = {}
    for block in map(int, rng.permutation(REACHABLE)):
        tower.load(settled)
        case = KINDS[hidden_label(tower, block, setup.movable)]
        if case in pushes:
            continue
        robot = Robot(tower, setup.sensing, rng)
        readings, context = [robot.start(block)], tower.context(block)
        for _ in range(steps):
            readings.append(robot.push_step(0.0, 0.0)[1])
            if robot.reached_goal() or tower.fallen().size:
                break
        push = {"readings": np.array(readings), "actions": np.zeros((len(readings) - 1, 2))}
        pushes[case] = push | {"context": context, "block": np.array(block)}
        if len(pushes) == len(KINDS):
            return pushes
    missing = ", ".join(set(KINDS.values()) - set(pushes))
    raise UserError(f"tower {seed} has no {missing} block to show; choose another seed.")


def showcase_table(
    learner: Hma,
    pushes: dict[str, dict[str, np.ndarray]],
    every: int,
    nuts: NutsSettings,
    rng: np.random.Generator,
    say: Callable[[str], None] = lambda _: None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Data of figure 5-8 (a row per case, step and abstraction) and diagnostics of the sampler (a row per run).

    Columns belief (filter), belief_nuts (NaN between runs), f_n, x, tower (readings), f_n_pred, x_pred.
    """
    rows, runs = [], []
    mean, sampler = learner.at_mean(), Sampler(learner, nuts)
    for case, push in pushes.items():
        readings, actions, context = push["readings"], push["actions"], push["context"]
        bank = KalmanBank(mean, context, learner.noise, readings[0])
        k = learner.n_abstractions
        for step, (action, reading) in enumerate(zip(actions, readings[1:]), start=1):
            before = readings[step - 1]
            out = mean.predict(before[None], action[None], context[None], np.full((1, k), 1.0 / k))
            belief = bank.step(action, reading)
            sampled = np.full(k, np.nan)
            if step % every == 0:
                posterior = sampler.sample(readings[: step + 1], actions[:step], context, rng)
                sampled = posterior.belief
                quality = {name: getattr(posterior, name) for name in ("r_hat", "ess", "divergences")}
                runs.append({"case": case, "step": step} | quality | agreement(bank, posterior))
                say(f"{case}: NUTS at step {step}, R-hat {posterior.r_hat:.3f}, ESS {posterior.ess:.0f}")
            for i, name in enumerate(learner.names):
                seen, predicted = (reading[F_N], reading[X], reading[TOWER]), out.mean[0, i, [F_N, X]]
                rows.append((case, int(push["block"]), step, name, belief[i], sampled[i], *seen, *predicted))
    names = ["case", "block", "step", "abstraction", "belief", "belief_nuts", "f_n", "x", "tower", "f_n_pred", "x_pred"]
    return pd.DataFrame(rows, columns=names), pd.DataFrame(runs)


def frames(game: Game) -> tuple[list[np.ndarray], np.ndarray, list[str], list[int]]:
    """Choose at most `PICTURES` frames: poses (54, 7) of each, sizes (54, 3), titles, extracted blocks (-1: none)."""
    chosen = np.unique(np.linspace(0, len(game.frames) - 1, PICTURES).astype(int))
    shown = [game.frames[i] for i in chosen]
    titles = [f"{title} ({i} out)" if i else title for i, (title, _, _) in zip(chosen, shown)]
    return [np.array(poses) for _, _, poses in shown], np.array(game.sizes), titles, [block for _, block, _ in shown]
