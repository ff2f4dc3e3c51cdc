"""Bank of extended Kalman filters: belief over states and abstractions of one push, an exact sum over abstractions.

    s_{t+1} = f_k(s_t, a_t) + w,  w ~ Normal(0, Q_k)        z_t = s_t + v,  v ~ Normal(0, Σ_z)
    predict:  m⁻ = f_k(m),  P⁻ = F P Fᵀ + Q_k,  F = ∂f_k/∂s (central differences)
    update:   S = P⁻ + Σ_z,  G = P⁻ S⁻¹,  m = m⁻ + G (z − m⁻),  P = (I − G) P⁻ (I − G)ᵀ + G Σ_z Gᵀ
    weight:   b(k) ∝ b(k) Normal(z; m⁻, S)

Learners predict readings from readings, with variance Q + 2 Σ_z if f is the identity plus a nearly constant change; so
Q = max(var − 2 Σ_z, `LEAST` var).  The weights are exact for linear f_k and an abstraction that lasts the whole push
(`stay` = 1, the thesis's plate); with `stay` < 1 weights mix and each filter keeps its state (own choice).
The prior of the first state is flat, so the first reading is its mean and Σ_z its covariance.

Source: thesis, section 5.5.4 (which samples by Hamiltonian Monte Carlo: `showcase_nuts`); the bank: Magill 1965,
doi 10.1109/TAC.1965.1098191.
"""

from typing import Any

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.learner import SEEN, Learner, bayes, log_likelihood, mix
from thesis_lib.jenga.learners.settings import BeliefSettings

LEAST = 0.1  # least share of process noise in a predicted variance
STEP = np.array(
    [0.1, 0.1, 0.1, 0.02, 0.02, 0.1, 0.1]
)  # mm, N: half widths of the finite differences, below sensor noise


def process_variance(var: Any, noise: Any, xp: Any = np) -> Any:
    """Q (…, 7), mm² and N², from the variance of a predicted reading (…, 7) and Σ_z (7,)."""
    return xp.maximum(var - 2.0 * noise, LEAST * var)


class KalmanBank:
    """One filter per abstraction of a fitted learner, for one push.

    mean, cov: m (K, 7) and P (K, 7, 7), in mm and N.  belief: b (K,).  noise: diagonal of Σ_z (7,), mm² and N².
    context: (2,).  wild: outlier model of the weights (None: normal, as in the equations).  stay: probability that the
    abstraction lasts another step.

    Raises:
        UserError: noise that is not positive.
    """

    def __init__(
        self,
        learner: Learner,
        context: np.ndarray,
        noise: np.ndarray,
        wild: BeliefSettings | None = None,
        stay: float = 1.0,
    ) -> None:
        if not np.all(np.asarray(noise) > 0):
            raise UserError(f"the variance of readings must be positive in every dimension, got {noise}.")
        self.learner, self.context, self.noise, self.wild, self.stay = learner, context, noise, wild, stay
        k = learner.n_abstractions
        self.prior = learner.initial_belief(context[None])[0]
        self.belief = self.prior.copy()
        self.mean = np.zeros((k, 7))
        self.cov = np.tile(np.diag(noise), (k, 1, 1))

    def start(self, observation: np.ndarray) -> None:
        """Restart from the first reading (7,) of a push."""
        k = self.learner.n_abstractions
        self.belief = self.prior.copy()
        self.mean = np.tile(observation, (k, 1))
        self.cov = np.tile(np.diag(self.noise), (k, 1, 1))

    def step(self, action: np.ndarray, observation: np.ndarray) -> np.ndarray:
        """Belief (K,) after `action` (2,) and the reading (7,) that follows."""
        mean, jacobian, var = self._linearised(action)
        cov = jacobian @ self.cov @ jacobian.transpose(0, 2, 1)
        cov = cov + np.eye(7) * process_variance(var, self.noise)[:, None]
        spread = cov + np.diag(self.noise)
        if self.wild is None:
            dims = np.ix_(range(len(mean)), SEEN, SEEN)
            part, error = spread[dims], (observation - mean)[:, SEEN]
            square = np.einsum("ki,ki->k", error, np.linalg.solve(part, error[..., None])[..., 0])
            log_like = -0.5 * (square + np.linalg.slogdet(2 * np.pi * part)[1])
        else:
            marginal = np.diagonal(spread, axis1=1, axis2=2)
            log_like = log_likelihood(mean[None], marginal[None], observation[None], self.wild)[0]
        self.belief = bayes(mix(self.belief, self.stay, self.prior)[None], log_like[None])[0]
        self._update(mean, cov, observation)
        return self.belief

    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (7,) and covariance (7, 7) of the state, mixed over abstractions."""
        mean = self.belief @ self.mean
        apart = self.mean - mean
        return mean, np.einsum("k,kij->ij", self.belief, self.cov + apart[:, :, None] * apart[:, None])

    def _update(self, mean: np.ndarray, cov: np.ndarray, observation: np.ndarray) -> None:
        spread = cov + np.diag(self.noise)
        gain = np.linalg.solve(spread, cov).transpose(0, 2, 1)
        rest = np.eye(7) - gain
        self.mean = mean + np.einsum("kij,kj->ki", gain, observation - mean)
        # Joseph's form stays symmetric and positive
        self.cov = rest @ cov @ rest.transpose(0, 2, 1) + (gain * self.noise) @ gain.transpose(0, 2, 1)

    def _linearised(self, action: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """f_k (K, 7), Jacobian (K, 7, 7) and variance (K, 7) of a predicted reading, each at its filter's mean."""
        k = len(self.mean)
        shifts = np.concatenate([np.zeros((1, 7)), np.diag(STEP), -np.diag(STEP)])
        states = (self.mean[:, None] + shifts).reshape(-1, 7)
        rows = len(states)
        out = self.learner.predict(
            states, np.tile(action, (rows, 1)), np.tile(self.context, (rows, 1)), np.full((rows, k), 1.0 / k)
        )
        abstraction = np.repeat(np.arange(k), 15)
        mean = out.mean[np.arange(rows), abstraction].reshape(k, 15, 7)
        var = out.var[np.arange(rows), abstraction].reshape(k, 15, 7)[:, 0]
        jacobian = ((mean[:, 1:8] - mean[:, 8:]) / (2 * STEP[:, None])).transpose(0, 2, 1)
        return mean[:, 0], jacobian, var
