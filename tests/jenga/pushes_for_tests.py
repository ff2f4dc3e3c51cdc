"""Made pushes with known abstractions, for the tests of the learners: no tower and no solver, only what a push does.

A spring (the pusher's position control, 0.65 N/mm) loads a block until it gives: an easy one at about 0.15 N, a hard
one at 0.7 N; a stuck one climbs to the robot's limit; a dragging one gives at about 1.2 N and takes the tower along;
no block gives nothing at all.  Slips are gamma distributed, so nothing here is Gaussian as the learners assume.
"""

import numpy as np

from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.kalman import process_variance
from thesis_lib.jenga.learners.settings import LearnerSettings, NetworkSettings
from thesis_lib.jenga.robot.samples import UNKNOWN, PushSamples

FAST = LearnerSettings(network=NetworkSettings(iterations=500))
KINDS = ("none", "easy", "hard", "stuck", "drag")
SHARES = (0.04, 0.32, 0.19, 0.25, 0.20)
STIFFNESS, LIMIT = 0.65, 4.0  # N/mm, N
POSE, START_POSE, FORCE, TOWER = (0.15, 0.4, 0.05, 0.2)  # sigma of the sensors: mm, extra mm at the start, N, mm


def make_push(kind: str, rng: np.random.Generator, steps: int = 45, retract: float = 0.05, noise: float = 1.0):
    """States (m, 7), next states (m, 7) as seen, actions (m, 2), context (2,) of one push."""
    layer, side = rng.integers(3, 18), rng.integers(0, 2)
    heavy = layer / 10.0
    gives = {
        "none": 0.0,
        "easy": 0.15 * np.exp(0.3 * rng.normal()),
        "hard": (0.45 + 0.25 * heavy) * np.exp(0.15 * rng.normal()),
        "stuck": 3.6 + heavy * rng.uniform(0.5, 1.0),
        "drag": 0.9 + 0.4 * heavy * rng.uniform(0.5, 1.5),
    }[kind]
    share = rng.uniform(0.6, 1.0) if kind == "drag" else rng.uniform(0.0, 0.1)
    s = np.zeros(7)

    def see():
        pose = noise * (POSE + START_POSE * np.exp(-s[5] / 5.0))
        sigma = np.array([pose, pose, pose, FORCE * noise, FORCE * noise, 0.0, TOWER * noise])
        return s + sigma * rng.normal(size=7)

    states, nexts, actions = [], [], []
    seen, offset = see(), 0.0
    for t in range(steps):
        if t % 4 == 0:
            offset = rng.uniform(-8, 8)
        heading = rng.uniform(-0.2, 0.2)
        s[5] += np.cos(heading)
        if kind != "none":
            load = STIFFNESS * (s[5] - s[0])
            slip = 0.0
            if load > gives and gives < LIMIT:  # beyond the limit the pusher stands still, and so does the block
                slip = (load - gives) / STIFFNESS * rng.gamma(6.0, 1 / 6.0)
            s[0] += slip
            s[2] += 0.05 * slip * offset * rng.gamma(4.0, 0.25) * 0.3
            s[1] += slip * np.sin(heading) * 0.5
            s[3] = np.clip(STIFFNESS * (s[5] - s[0]), 0.0, LIMIT)
            s[4] = 0.35 * s[3] * np.tanh(3 * np.sin(heading))
            s[6] += slip * share + (0.02 if kind == "stuck" else 0.0) * rng.gamma(1.0)
        after = see()
        states.append(seen), nexts.append(after), actions.append([offset, heading])
        seen = after
        if rng.random() < retract or s[6] > 5.0:
            break
    return np.array(states), np.array(nexts), np.array(actions), np.array([layer, side], float)


def make_samples(
    n: int, rng: np.random.Generator, kinds=KINDS, shares=SHARES, **options
) -> tuple[PushSamples, np.ndarray]:
    """The first `n` samples of random pushes, and the kind (n,) of each."""
    parts, labels, count = [], [], 0
    while count < n:
        kind = rng.choice(len(kinds), p=np.array(shares) / np.sum(shares))
        parts.append(make_push(kinds[kind], rng, **options))
        labels.append(KINDS.index(kinds[kind]))
        count += len(parts[-1][0])
    sizes = [len(part[0]) for part in parts]
    push = np.repeat(np.arange(len(parts)), sizes)
    label = np.repeat(labels, sizes)
    samples = PushSamples(
        push=push,
        step=np.concatenate([np.arange(size) for size in sizes]),
        state=np.concatenate([part[0] for part in parts]),
        action=np.concatenate([part[2] for part in parts]),
        next_state=np.concatenate([part[1] for part in parts]),
        context=np.concatenate([np.tile(part[3], (size, 1)) for part, size in zip(parts, sizes)]),
        truth=(label >= KINDS.index("stuck")).astype(int),
        tower=np.full(len(push), UNKNOWN),
        block=np.full(len(push), UNKNOWN),
    )
    return samples.first(n), label[:n]


def sample_push(
    learner: Hma, rng: np.random.Generator, actions: np.ndarray, context: np.ndarray, c: int
) -> tuple[np.ndarray, np.ndarray]:
    """A push of abstraction c from the generative model: states (t + 1, 7), readings (t + 1, 7), mm and N.

    actions: (t, 2).  context: (2,).
    """
    steps = len(actions)
    states = np.zeros((steps + 1, 7))
    belief = np.eye(learner.n_abstractions)[[c]]
    for t in range(steps):
        out = learner.predict(states[None, t], actions[None, t], context[None], belief)
        var = process_variance(out.var[0, c], learner.noise)
        states[t + 1] = out.mean[0, c] + np.sqrt(var) * rng.normal(size=7)
    return states, states + np.sqrt(learner.noise) * rng.normal(size=states.shape)
