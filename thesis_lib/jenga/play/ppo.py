"""Proximal policy optimisation (PPO) with stable-baselines3: the model-free baseline.

    max_θ  E[min(ρ_t A_t, clip(ρ_t, 1 − ε, 1 + ε) A_t)],   ρ_t = π_θ(a_t | o_t) / π_old(a_t | o_t)
    A_t = Σ_l (γ λ)^l δ_{t+l},   δ_t = r_t + γ V(o_{t+1}) − V(o_t)
    π_θ = Normal(m_θ(o), diag e^{2 s_θ}),   in a game:  a = m_θ(o)

o_t is `push_env.observation` (9,), m_θ the tanh layers `PpoPolicy.layers`; ε, γ, λ are `clip`, `discount`, `trace`.

One training run passes through all requested numbers of samples and saves a policy at each.  It has segments of at most
`segment` samples.  Each starts from weights and optimiser of the one before, with its own random streams.  A segment of
n samples has ⌈n / `rollout`⌉ rollouts of equal length: no policy has seen more samples than stated, and even 100
samples give an update.  A sample is one step of the environment, retreats included.

Sources: J. Schulman et al. 2017, doi 10.48550/arXiv.1707.06347; A. Raffin et al., JMLR 22 (268), 2021
(stable-baselines3); thesis, section 5.5.2.
"""

import math
import warnings
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.foundation.files import atomic
from thesis_lib.jenga.play.policies import Action, Policy
from thesis_lib.jenga.play.push_env import REASONS, Episode, PushEnv, as_action, observation
from thesis_lib.jenga.play.settings import PpoSettings
from thesis_lib.jenga.tower.settings import Setup

SCHEMA = 2
RECENT = 50  # pushes over which the reported reward is averaged
State = dict[str, Any]


class PpoPolicy(Policy):
    """Trained policy, deterministic and stateless.

    samples: most samples used in training.  layers: weights (out, in) and biases (out,).  settings: of its
    training.  episodes: a row per push of the training so far: samples (total at its end), tower, block, steps, reward
    (before scaling) and reason of its end.
    """

    name = "ppo"

    def __init__(self, state: State):
        self.state = {name: state[name] for name in ("schema", "samples", "settings", "policy", "episodes", "ends")}
        self.samples: int = state["samples"]
        self.settings = PpoSettings.model_validate_json(state["settings"])
        weights = state["policy"]
        names = [f"mlp_extractor.policy_net.{2 * i}" for i in range(len(self.settings.hidden))]
        self.layers = [
            (weights[f"{name}.weight"].numpy(), weights[f"{name}.bias"].numpy()) for name in [*names, "action_net"]
        ]
        tower, block, steps, reward, reason = state["episodes"].numpy().T
        columns = {"samples": state["ends"].numpy(), "tower": tower, "block": block, "steps": steps}
        self.episodes = pd.DataFrame({name: values.astype(int) for name, values in columns.items()}).assign(
            reward=reward, reason=[REASONS[int(number)] for number in reason]
        )

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        """Return the mean action for a reading (7,) and context (2,), mm and N."""
        x = observation(state, context)
        for weight, bias in self.layers[:-1]:
            x = np.tanh(weight @ x + bias)
        weight, bias = self.layers[-1]
        return as_action(weight @ x + bias, self.settings.episode)


def train_ppo(
    checkpoints: Sequence[int],
    settings: PpoSettings | None = None,
    seed: int = 0,
    *,
    setup: Setup | None = None,
    device: str = "auto",
    say: Callable[[str], None] | None = None,
    environment: type[PushEnv] = PushEnv,
) -> dict[int, PpoPolicy]:
    """Train once and return the policies at these numbers of samples.

    device: PyTorch's; "auto" is a GPU if available.  say: receives progress lines.  The library seeds the global
    streams of random, numpy and PyTorch.  UserError for checkpoints that do not increase by at least 2; TowerError
    as in `PushEnv.reset`.
    """
    settings, setup, say = settings or PpoSettings(), setup or Setup(), say or (lambda line: None)
    torch.set_num_threads(1)
    ends = _segment_ends(checkpoints, settings.segment)
    state: State | None = None
    policies: dict[int, PpoPolicy] = {}

    def report(done: int, rewards: list[float]) -> None:
        mean = f"{np.mean(rewards[-RECENT:]):.2f}" if rewards else "none yet"
        say(f"PPO: {done} of {ends[-1]} samples, mean reward of a push {mean}")

    for begin, end in zip([0, *ends], ends):
        env = environment(settings.episode, settings.reward, setup)
        state = _segment(env, state, begin, end, settings, seed, device, report)
        if end in checkpoints:
            policies[end] = PpoPolicy(state)
    return policies


def write_policy(policy: PpoPolicy, path: str | Path) -> None:
    """Write a policy to a file, atomically."""
    with atomic(path) as tmp:
        torch.save(policy.state, tmp)


def read_policy(path: str | Path) -> PpoPolicy:
    """Read a policy of `write_policy`; UserError if the file is missing, CorruptFileError if it contains no policy."""
    path = Path(path)
    if not path.is_file():
        raise UserError(f"{path} does not exist; train PPO first.")
    try:
        # torch does not verify the check sums of its archive
        with zipfile.ZipFile(path) as archive:
            if (bad := archive.testzip()) is not None:
                raise ValueError(f"{bad} is damaged")
        # weights_only: tensors and plain values, so that a file cannot run code
        state = torch.load(path, map_location="cpu", weights_only=True)
        if state["schema"] != SCHEMA:
            raise ValueError("the file has another version")
        return PpoPolicy(state)
    except Exception as error:
        raise CorruptFileError(f"{path} contains no valid policy ({error}); delete it and train again.") from error


def _segment_ends(checkpoints: Sequence[int], segment: int) -> list[int]:
    gaps = np.diff([0, *checkpoints])
    if len(checkpoints) == 0 or (gaps < 2).any():
        raise UserError(
            f"PPO: checkpoints {list(checkpoints)} must increase by at least 2 samples, starting at 2: an update "
            "needs two samples. Sort them and remove duplicates."
        )
    ends: list[int] = []
    for begin, gap in zip([0, *checkpoints], gaps):
        parts = math.ceil(gap / segment)
        ends += [begin + gap * (i + 1) // parts for i in range(parts)]
    return [int(end) for end in ends]


def _segment(
    env: PushEnv,
    state: State | None,
    begin: int,
    end: int,
    settings: PpoSettings,
    seed: int,
    device: str,
    report: Callable[[int, list[float]], None],
) -> State:
    """Train from `begin` to `end` samples, starting from the state at the end of the previous segment."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import Logger

    class Report(BaseCallback):
        def _on_step(self) -> bool:
            return True

        def _on_rollout_end(self) -> None:
            report(begin + self.num_timesteps, [episode.reward for episode in env.episodes])

    rollouts = math.ceil((end - begin) / settings.rollout)
    length = (end - begin) // rollouts
    stream = np.random.SeedSequence(seed, spawn_key=(5, begin)).generate_state(1)[0]
    with warnings.catch_warnings():
        # the mini-batches of a rollout may differ by one sample, which is harmless
        warnings.filterwarnings("ignore", message="You have specified a mini-batch size", category=UserWarning)
        model = PPO(
            "MlpPolicy",
            env,
            learning_rate=settings.rate,
            n_steps=length,
            batch_size=math.ceil(length / math.ceil(length / settings.batch)),
            n_epochs=settings.epochs,
            gamma=settings.discount,
            gae_lambda=settings.trace,
            clip_range=settings.clip,
            policy_kwargs={"net_arch": list(settings.hidden), "log_std_init": settings.spread},
            seed=int(stream % 2**31),
            device=device,
        )
    model.set_logger(Logger(folder=None, output_formats=[]))
    if state is not None:
        model.policy.load_state_dict(state["policy"])
        model.policy.optimizer.load_state_dict(state["optimiser"])
    model.learn(length * rollouts, callback=Report())
    rows = [astuple(episode) for episode in env.episodes]
    episodes = torch.tensor(rows, dtype=torch.float64).reshape(-1, len(fields(Episode)))
    ends = begin + episodes[:, 2].cumsum(0)  # samples so far
    if state is not None:
        episodes, ends = torch.cat([state["episodes"], episodes]), torch.cat([state["ends"], ends])
    return {
        "schema": SCHEMA,
        "samples": end,
        "settings": settings.model_dump_json(),
        "policy": _on_cpu(model.policy.state_dict()),
        "optimiser": _on_cpu(model.policy.optimizer.state_dict()),
        "episodes": episodes,
        "ends": ends,
    }


def _on_cpu(value: Any) -> Any:
    """Copy of nested tensors on the CPU, in plain containers."""
    if isinstance(value, torch.Tensor):
        return value.detach().cpu().clone()
    if isinstance(value, dict):
        return {key: _on_cpu(item) for key, item in value.items()}
    return [_on_cpu(item) for item in value] if isinstance(value, list | tuple) else value
