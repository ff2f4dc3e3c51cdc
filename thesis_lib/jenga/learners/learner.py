"""Common interface of all learners of the push dynamics, with their scaling and windows.

    s_{t+1} = s_t + Δ,   Δ | s_t, a_t, c = k  ~  Normal(μ_k, Σ_k)        (learners predict changes; equation 5.5)
    b_{t+1}(k) ∝ p(z_{t+1} | s_t, a_t, k) Σ_j b_t(j) P(k | j),   P(k | j) = ρ δ_jk + (1 − ρ) π_k

| paper | code      | unit  | shape     |                                                                      |
|-------|-----------|-------|-----------|----------------------------------------------------------------------|
| s, z  | `state`   | mm, N | (n, 7)    | `samples.STATE`                                                      |
| a     | `action`  | mm, rad | (n, 2)  | `samples.ACTION`                                                     |
| c     | –         |       |           | abstraction, 0 … K−1                                                 |
| b     | `belief`  | 1     | (n, K)    | probabilities of the abstractions                                    |
| D     | `depth`   | 1     |           | steps in a window                                                    |
| ρ     | `stay`    | 1     |           | probability that the abstraction lasts another step                  |

Inputs of all learners (own choice): lag of the block behind the pusher (advance − x), y, yaw, asinh of both forces over
`force_scale`, advance, root of the tower's displacement, contact offset, heading, and the context, standardised with
the training samples and clipped at `CLIP` standard deviations.  Outputs are the standardised changes of the state.

Features of a window (top-down step; as in the thesis, order within a window does not matter): means over its steps of
force, rise of force, the block's displacement per advance, lag as a share of the advance, and the tower's displacement
per advance.  The window of sample i is the up to D samples of the push that end with i.

The likelihood omits `advance`, which the robot controls.  Each other dimension may be an outlier (`BeliefSettings`):
otherwise a single stick-slip jump would fix the belief for the rest of the push.

Source: thesis, section 5.3 and figure 5-3 (equations 5.1 to 5.10 are the lines of section 5.3.1, in their order);
N. Fazeli et al. 2019, doi 10.1126/scirobotics.aav3123.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.special import softmax

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.settings import BeliefSettings, LearnerSettings, PushWindowSettings
from thesis_lib.jenga.robot.samples import ADVANCE, F_N, F_T, TOWER, YAW, PushSamples, X, Y

SEEN = (X, Y, YAW, F_N, F_T, TOWER)  # dimensions whose prediction counts in the belief
FEATURES = ("force", "rise", "move", "lag", "drag")
# features averaged over a window's steps; the others are changes per step
LEVELS = ("force", "lag")
CLIP = 4.0
MIN_SAMPLES = 20
LAG_START = 3.0  # mm added to the advance in the denominator of the lag: the first poses of a push are the noisiest
# mm, N: below the resolution of all sensors; avoids division by zero in a constant dimension
SMALLEST = np.array([0.02, 0.02, 0.02, 0.01, 0.01, 0.01, 0.02])


@dataclass(frozen=True)
class PushPrediction:
    """Next state by abstraction: mean (n, K, 7), mm, N; weight (n, K); `variance`: var or a function returning it."""

    mean: np.ndarray
    variance: np.ndarray | Callable[[], np.ndarray]
    weight: np.ndarray

    @cached_property
    def var(self) -> np.ndarray:
        """Variance (n, K, 7), mm² and N²; computed on first access only: the controller needs just the means."""
        return self.variance() if callable(self.variance) else self.variance

    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance (n, 7) of the mixture."""
        mean = np.einsum("nk,nkd->nd", self.weight, self.mean)
        spread = (self.mean - mean[:, None]) ** 2
        return mean, np.einsum("nk,nkd->nd", self.weight, self.var + spread)


@dataclass(frozen=True)
class Scaling:
    """Standardisation by the training samples.

    centre, spread: (d,), of inputs.  drift, change: (7,), mean and deviation of the state's changes, mm and N.
    """

    centre: np.ndarray
    spread: np.ndarray
    drift: np.ndarray
    change: np.ndarray
    force_scale: float
    with_context: bool

    @classmethod
    def of(cls, samples: PushSamples, force_scale: float, with_context: bool) -> "Scaling":
        """Scaling estimated from these samples; UserError for fewer than `MIN_SAMPLES`."""
        if len(samples) < MIN_SAMPLES:
            raise UserError(f"a learner needs at least {MIN_SAMPLES} samples, got {len(samples)}; collect more pushes.")
        raw = raw_inputs(samples.state, samples.action, samples.context, force_scale, with_context)
        change = samples.next_state - samples.state
        spread = raw.std(axis=0)
        # an input that is constant in training carries no information: unit spread avoids huge values later
        return cls(
            raw.mean(axis=0),
            np.where(spread > 1e-6, spread, 1.0),
            change.mean(axis=0),
            np.maximum(change.std(axis=0), SMALLEST),
            force_scale,
            with_context,
        )

    def inputs(self, state: Any, action: Any, context: Any, xp: Any = np) -> Any:
        """Scaled inputs (n, d); `xp` is NumPy or a library with the same names."""
        raw = raw_inputs(state, action, context, self.force_scale, self.with_context, xp)
        return xp.clip((raw - self.centre) / self.spread, -CLIP, CLIP)

    def outputs(self, state: np.ndarray, next_state: np.ndarray) -> np.ndarray:
        """Scaled changes (n, 7)."""
        return (next_state - state - self.drift) / self.change

    def next_state(self, state: Any, outputs: Any) -> Any:
        """Inverse of `outputs`, for shapes that broadcast to (…, 7)."""
        return state + self.drift + self.change * outputs


class Learner(ABC):
    """A learner of the push dynamics.

    After `fit` it has `scaling`, the `shares` (K,) of its abstractions, and `first` (K,), the belief before contact.
    """

    scaling: Scaling
    shares: np.ndarray
    first: np.ndarray

    def __init__(self, settings: LearnerSettings | None = None):
        self.settings = settings or LearnerSettings()

    @property
    def n_abstractions(self) -> int:
        """Number of abstractions K."""
        return len(self.shares)

    def scale(self, samples: PushSamples) -> tuple[np.ndarray, np.ndarray]:
        """Set `scaling` from these samples and return their scaled inputs (n, d) and outputs (n, 7)."""
        self.scaling = Scaling.of(samples, self.settings.window.force_scale, self.settings.context)
        inputs = self.scaling.inputs(samples.state, samples.action, samples.context)
        return inputs, self.scaling.outputs(samples.state, samples.next_state)

    @abstractmethod
    def fit(self, samples: PushSamples, rng: np.random.Generator) -> Self:
        """Learn from samples of whole pushes in order, and return self; UserError for fewer than `MIN_SAMPLES`."""

    @abstractmethod
    def predict(self, state: np.ndarray, action: np.ndarray, context: np.ndarray, belief: np.ndarray) -> PushPrediction:
        """Predict the next reading for each abstraction; rows (n, ·) as in the module's table, context (n, 2)."""

    def initial_belief(self, context: np.ndarray) -> np.ndarray:
        """Belief (n, K) before contact."""
        return np.tile(self.first, (len(context), 1))

    def update(
        self, belief: np.ndarray, state: np.ndarray, action: np.ndarray, context: np.ndarray, next_state: np.ndarray
    ) -> np.ndarray:
        """Belief (n, K) after the reading `next_state` (n, 7)."""
        out = self.predict(state, action, context, belief)
        return bayes(out.weight, log_likelihood(out.mean, out.var, next_state, self.settings.belief))


def raw_inputs(state: Any, action: Any, context: Any, force_scale: float, with_context: bool, xp: Any = np) -> Any:
    """Inputs (n, 9), or (n, 11) with context, before standardisation; `force_scale` in N."""
    x, y, yaw, f_n, f_t, advance, tower = (state[..., i] for i in range(7))
    # square root of a length (mm) that noise may make negative, with slope 1 at zero
    root = 2.0 * xp.sign(tower) * (xp.sqrt(xp.abs(tower) + 1.0) - 1.0)
    forces = [xp.arcsinh(f_n / force_scale), xp.arcsinh(f_t / force_scale)]
    columns = [advance - x, y, yaw, *forces, advance, root, action[..., 0], action[..., 1]]
    columns += [context[..., 0], context[..., 1]] if with_context else []
    return xp.stack(columns, axis=-1)


def step_features(
    start: np.ndarray, next_state: np.ndarray, steps: np.ndarray | float, force_scale: float
) -> np.ndarray:
    """Features (n, 5), see `FEATURES`, of the change from `start` to `next_state`, both (n, 7), in `steps` steps."""
    change = (next_state - start) / np.reshape(steps, (-1, 1))
    force = np.arcsinh(next_state[:, F_N] / force_scale)
    lag = (next_state[:, ADVANCE] - next_state[:, X]) / (next_state[:, ADVANCE] + LAG_START)
    return np.column_stack([force, change[:, F_N], change[:, X], lag, change[:, TOWER]])


def windows(samples: PushSamples, settings: PushWindowSettings) -> np.ndarray:
    """Features (n, 5) of the window that ends with each sample; samples of a push must be consecutive."""
    rows = np.arange(len(samples))
    new = np.concatenate([[True], samples.push[1:] != samples.push[:-1]])
    begin = np.maximum(np.maximum.accumulate(np.where(new, rows, 0)), rows - settings.depth + 1)
    steps = (rows - begin + 1).astype(float)
    features = step_features(samples.state[begin], samples.next_state, steps, settings.force_scale)
    for column in [FEATURES.index(name) for name in LEVELS]:  # means as differences of cumulative sums
        total = np.concatenate([[0.0], np.cumsum(features[:, column])])
        features[:, column] = (total[1:] - total[begin]) / steps
    return features


def push_groups(samples: PushSamples) -> list[np.ndarray]:
    """Rows of each push, in order of collection."""
    return np.split(np.arange(len(samples)), np.flatnonzero(np.diff(samples.push)) + 1) if len(samples) else []


def along_pushes(
    learner: Learner, samples: PushSamples
) -> Iterator[tuple[np.ndarray, tuple[np.ndarray, ...], np.ndarray, np.ndarray]]:
    """Iterate over the steps of all pushes in parallel: rows (m,) of the samples; their state, action and context; and
    the belief (m, K) before and after the sample."""
    groups = push_groups(samples)
    belief = learner.initial_belief(samples.context[[rows[0] for rows in groups]])
    for t in range(max(map(len, groups), default=0)):
        alive = np.array([len(rows) > t for rows in groups])
        now = np.array([rows[t] for rows in groups if len(rows) > t])
        step, before = (samples.state[now], samples.action[now], samples.context[now]), belief[alive]
        belief[alive] = learner.update(before, *step, samples.next_state[now])
        yield now, step, before, belief[alive]


def log_likelihood(
    mean: np.ndarray, var: np.ndarray, observed: np.ndarray, settings: BeliefSettings, seen: Sequence[int] = SEEN
) -> np.ndarray:
    """Log density (n, K) of the `seen` dimensions of `observed` (n, 7) for each abstraction; mean, var (n, K, 7)."""
    dims = list(seen)
    var = var[..., dims]
    square = (observed[:, None, dims] - mean[..., dims]) ** 2 / var
    normal = -0.5 * (square + np.log(2 * np.pi * var))
    if settings.outlier_share == 0:
        return normal.sum(axis=2)
    scale, share = settings.outlier_scale, settings.outlier_share
    wild = -0.5 * (square / scale**2 + np.log(2 * np.pi * var)) - np.log(scale)
    return np.logaddexp(np.log1p(-share) + normal, np.log(share) + wild).sum(axis=2)


def bayes(belief: np.ndarray, log_like: np.ndarray) -> np.ndarray:
    """Posterior (n, K) from the prior `belief` and the log likelihood (n, K)."""
    return softmax(np.log(np.maximum(belief, 1e-300)) + log_like, axis=1)


def mix(belief: np.ndarray, stay: float, weights: np.ndarray) -> np.ndarray:
    """Belief (n, K) one step later: the abstraction stays with probability `stay` or is redrawn from `weights` (K,)."""
    return stay * belief + (1.0 - stay) * weights
