"""Model predictive control with a learned model: where to push, and when to give up.

At each step, n action sequences a^j of H steps are simulated with the learner from the last reading.  Each rollout has
one branch per abstraction k, which starts with certainty in k and then follows the learner's weights:

    s^{jk}_0 = z_t,   s^{jk}_{h+1} = Σ_l p(l | s^{jk}_h, a^j_h, e_k) μ_l(s^{jk}_h, a^j_h)
    J_j = Σ_k p(k | z_t, a^j_0, b_t) C(s^{jk}) + w_a |a^j|² + w_c [contact elsewhere] + w_n g_t
    C = w_p (1 − (x_H − x_0)/H)₊ + w_g (T_H − T_0)₊/H + (T_H / T_d)² + (y_H² + ψ_H²)/y_d²
    g_t = (p_t(no move) − p_0(no move))₊ / (1 − p_0(no move)),   p_0: before contact

The first action of the cheapest sequence is executed.  If it costs more than giving up, J* > J_g, the robot retracts,
but not before `probe` pushes: nothing is known about a block before contact.  All learners share costs and weights.

The term g of p(no move) can be switched off, or a comparison of learners would measure its effect.  `abstractions`
defines p for each learner.  g is the same for all pushes, so it only weighs pushing against giving up.  Predicted
variances enter only g: C is nearly linear where it matters, and the branches represent the spread that decides.

Sequences: all pairs of a few contact locations and headings held for H steps, the straight push and the present contact
among them, and random pairs that switch from one to the other midway.  x, y, ψ, T: see `samples.STATE`, in mm.

Source: thesis, section 5.5.4, figure 5-9, which names the costs without equations; their form is an own choice.
"""

import numpy as np

from thesis_lib.jenga.learners.abstractions import no_move
from thesis_lib.jenga.learners.learner import Learner
from thesis_lib.jenga.play.policies import Action, Policy, Push, Retract
from thesis_lib.jenga.play.settings import ControllerSettings
from thesis_lib.jenga.robot.samples import STATE, TOWER, YAW, X, Y

OFFSETS, HEADINGS = 5, 5  # values of each in the held pairs, from one extreme to the other


def rollout(
    learner: Learner, state: np.ndarray, context: np.ndarray, belief: np.ndarray, sequences: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Predicted s^{jk}_h (H + 1, n, K, 7) of each branch, mm and N, and weights (n, K) of the branches.

    state: (7,), mm and N.  context: (2,).  belief: (K,).  sequences: a^j (n, H, 2), mm and rad.
    """
    n, horizon, _ = sequences.shape
    k = len(belief)
    states = np.empty((horizon + 1, n, k, len(STATE)))
    states[0] = state
    alike = _alike(sequences)
    for h, (one, of) in enumerate(alike):
        rows = len(one) * k
        actions, certain = np.repeat(sequences[one, h], k, axis=0), np.tile(np.eye(k), (len(one), 1))
        place = np.tile(context, (rows, 1))
        out = learner.predict(states[h, one].reshape(rows, -1), actions, place, certain)
        states[h + 1] = np.einsum("nk,nkd->nd", out.weight, out.mean).reshape(len(one), k, -1)[of]
    one, of = alike[0]
    start, place, known = (np.tile(row, (len(one), 1)) for row in (state, context, belief))
    return states, learner.predict(start, sequences[one, 0], place, known).weight[of]


def _alike(sequences: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Group sequences (n, H, 2) that agree up to each step: one member (m,) of each group, and the group (n,) of each.

    Sequences that agree so far lead to the same state, so one prediction serves the whole group.
    """
    n, horizon, _ = sequences.shape
    _, action = np.unique(sequences[..., 0] + 1j * sequences[..., 1], return_inverse=True)
    action, kind, found = action.reshape(n, horizon), np.zeros(n, dtype=int), []
    for h in range(horizon):
        _, one, kind = np.unique(kind * action.size + action[:, h], return_index=True, return_inverse=True)
        found.append((one, kind))
    return found


def branch_costs(states: np.ndarray, settings: ControllerSettings) -> np.ndarray:
    """Costs C (n, K) of rollouts (H + 1, n, K, 7), mm and N."""
    first, last, horizon = states[0], states[-1], len(states) - 1
    shortfall = np.maximum(1.0 - (last[..., X] - first[..., X]) / horizon, 0.0)
    growth = np.maximum(last[..., TOWER] - first[..., TOWER], 0.0) / horizon
    return (
        settings.progress * shortfall
        + settings.growth * growth
        + (np.maximum(last[..., TOWER], 0.0) / settings.damage) ** 2
        + (last[..., Y] ** 2 + last[..., YAW] ** 2) / settings.stray**2
    )


class Learned(Policy):
    """Policy that plans with a fitted learner.

    belief: (K,), of the pushed block.
    """

    def __init__(self, learner: Learner, settings: ControllerSettings | None = None, name: str = "learned"):
        self.learner, self.settings, self.name = learner, settings or ControllerSettings(), name
        offsets = np.linspace(-self.settings.offset, self.settings.offset, OFFSETS)
        headings = np.linspace(-self.settings.heading, self.settings.heading, HEADINGS)
        self._held = np.array([(offset, heading) for offset in offsets for heading in headings])

    def start(self, block: int, context: np.ndarray) -> None:
        self.context, self.contact, self.steps = context, 0.0, 0
        self.belief = self.learner.initial_belief(context[None])[0]
        self._first: float | None = None

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        sequences = self.sequences()
        costs = self.costs(state, sequences)
        best = int(np.argmin(costs))
        if self.steps >= self.settings.probe and costs[best] > self.settings.give_up:
            return Retract()
        return Push(*map(float, sequences[best, 0]))

    def observe(self, state: np.ndarray, action: Push, next_state: np.ndarray) -> None:
        self.steps, self.contact = self.steps + 1, action.offset
        step = (state[None], np.array([[action.offset, action.heading]]), self.context[None])
        self.belief = self.learner.update(self.belief[None], *step, next_state[None])[0]

    def sequences(self) -> np.ndarray:
        """Candidate action sequences (n, H, 2), mm and rad; the first pushes straight at the present contact."""
        settings = self.settings
        held = self._held.copy()
        # the location nearest to the finger is replaced by the finger's, to include pushing on at the same contact
        away = np.abs(held[:, 0] - self.contact)
        held[away == away.min(), 0] = self.contact
        pairs = np.concatenate([[[self.contact, 0.0], [0.0, 0.0]], held])[: settings.sequences]
        sequences = np.repeat(pairs[:, None], settings.horizon, axis=1)
        more = settings.sequences - len(sequences)
        if more <= 0:
            return sequences
        first, second = pairs[self.rng.integers(len(pairs), size=(2, more))]
        switch = self.rng.integers(1, settings.horizon, size=more) if settings.horizon > 1 else np.ones(more)
        later = np.arange(settings.horizon) >= np.reshape(switch, (-1, 1))
        return np.concatenate([sequences, np.where(later[..., None], second[:, None], first[:, None])])

    def costs(self, state: np.ndarray, sequences: np.ndarray) -> np.ndarray:
        """Costs J (n,) of the sequences (n, H, 2) from a reading (7,)."""
        settings = self.settings
        states, weights = rollout(self.learner, state, self.context, self.belief, sequences)
        cost = (weights * branch_costs(states, settings)).sum(axis=1)
        scale = np.array([max(settings.offset, 1e-9), max(settings.heading, 1e-9)])
        cost += settings.effort * ((sequences / scale) ** 2).sum(axis=2).mean(axis=1)
        cost += settings.change * (np.abs(sequences[:, 0, 0] - self.contact) > 1e-9)
        return cost + settings.no_move * self.growth(state)

    def growth(self, state: np.ndarray) -> float:
        """Growth g of p(no move) since the first reading (7,) of this block; 0 if the term is switched off."""
        if not self.settings.no_move:
            return 0.0
        now = no_move(self.learner, self.belief, state, self.context, self.contact)
        first = self._first = now if self._first is None else self._first
        return max(0.0, (now - first) / max(1.0 - first, 1e-9))
