"""Bank of extended Kalman filters: belief over states and abstractions of one push, an exact sum over abstractions.

    s_{t+1} = f_k(s_t, a_t) + w,  w ~ Normal(0, Q_k)        z_t = s_t + v,  v ~ Normal(0, Σ_z)
    predict:  m⁻ = f_k(m),  P⁻ = F P Fᵀ + Q_k,  F = ∂f_k/∂s (central differences)
    update:   S = P⁻ + Σ_z,  G = P⁻ S⁻¹,  m = m⁻ + G (z − m⁻),  P = (I − G) P⁻ (I − G)ᵀ + G Σ_z Gᵀ
    weight:   b(k) ∝ b(k) Normal(z; m⁻, S)

Learners predict readings from readings, with variance Q + 2 Σ_z if f is the identity plus a nearly constant change, so
Q = max(var − 2 Σ_z, `LEAST` var).  The prior of the first state (equation 5.3) is flat, so the first reading is its
mean and Σ_z its covariance.  One abstraction holds for the whole push (the thesis's plate).  The weights are exact for
linear f_k.

Source: thesis, section 5.5.4 (which samples by Hamiltonian Monte Carlo: `showcase_nuts`); the bank: Magill 1965,
doi 10.1109/TAC.1965.1098191.
"""

from typing import Any

import numpy as np

from thesis_lib.jenga.learners.learner import SEEN, Learner, bayes

LEAST = 0.1  # least share of process noise in a predicted variance
# mm, N: half widths of the finite differences, below sensor noise
STEP = np.array([0.1, 0.1, 0.1, 0.02, 0.02, 0.1, 0.1])


def process_variance(var: Any, noise: Any, xp: Any = np) -> Any:
    """Process noise Q (…, 7), mm² and N², from the variance of a predicted reading (…, 7) and Σ_z (7,)."""
    return xp.maximum(var - 2.0 * noise, LEAST * var)


class KalmanBank:
    """One filter per abstraction of a fitted learner, for one push that starts with the reading `first` (7,).

    mean, cov: m (K, 7) and P (K, 7, 7), in mm and N.  belief: b (K,).  noise: diagonal of Σ_z (7,), mm² and N²,
    positive.  context: (2,).
    """

    def __init__(self, learner: Learner, context: np.ndarray, noise: np.ndarray, first: np.ndarray) -> None:
        self.learner, self.context, self.noise = learner, context, noise
        self.belief = learner.initial_belief(context[None])[0]
        self.mean = np.tile(first, (learner.n_abstractions, 1))
        self.cov = np.tile(np.diag(noise), (learner.n_abstractions, 1, 1))

    def step(self, action: np.ndarray, observation: np.ndarray) -> np.ndarray:
        """Belief (K,) after `action` (2,) and the reading (7,) that follows."""
        mean, jacobian, var = self._linearised(action)
        cov = jacobian @ self.cov @ jacobian.transpose(0, 2, 1)
        cov = cov + np.eye(7) * process_variance(var, self.noise)[:, None]
        spread = cov + np.diag(self.noise)
        dims = np.ix_(range(len(mean)), SEEN, SEEN)
        part, error = spread[dims], (observation - mean)[:, SEEN]
        square = np.einsum("ki,ki->k", error, np.linalg.solve(part, error[..., None])[..., 0])
        log_like = -0.5 * (square + np.linalg.slogdet(2 * np.pi * part)[1])
        self.belief = bayes(self.belief[None], log_like[None])[0]
        gain = np.linalg.solve(spread, cov).transpose(0, 2, 1)
        rest = np.eye(7) - gain
        self.mean = mean + np.einsum("kij,kj->ki", gain, observation - mean)
        # Joseph's form stays symmetric and positive
        self.cov = rest @ cov @ rest.transpose(0, 2, 1) + (gain * self.noise) @ gain.transpose(0, 2, 1)
        return self.belief

    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (7,) and covariance (7, 7) of the state, mixed over abstractions."""
        mean = self.belief @ self.mean
        apart = self.mean - mean
        return mean, np.einsum("k,kij->ij", self.belief, self.cov + apart[:, :, None] * apart[:, None])

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
