"""Posterior over states and abstraction of a push by the No-U-Turn sampler (NUTS), for the pushes of figure 5-8.

    p(s_{0:t}, c | z_{0:t}) ∝ b_0(c) Π_i Normal(z_i; s_i, Σ_z) Π_i Normal(s_{i+1}; f_c(s_i, a_i), Q_c(s_i, a_i))
    each abstraction has its own states s^k, and the states of the others follow pseudo-priors ψ:
    log Σ_k exp[log b_0(k) + log p(z, s^k | k) − log ψ_k(s^k)] + Σ_k log ψ_k(s^k),   p(c | z) = E [p(c | s^1 … s^K)]

States common to all abstractions mix badly: chains do not cross from the prediction of one abstraction to another.
With separate states and ψ_k the Laplace approximation of p(s^k | z, k), the terms of the sum hardly vary, and chains
sample near-normals.  The target is exact for any ψ (Carlin and Chib 1995, doi 10.1111/j.2517-6161.1995.tb02042.x).
States are e = (s − z)/σ_z = mode_k + L_k u_k; the readings' density is Normal(e; 0, 1), ψ_k is Normal(u; 0, 1).  The
networks enter with their mean weights, as `Hma.at_mean` gives them to the filter.

Sources: thesis, section 5.5.4; Hoffman and Gelman 2014, arXiv 1111.4246 (NUTS); Vehtari et al. 2021,
doi 10.1214/20-BA1221 (R̂ of split chains).
"""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import numpyro
from jax.scipy.special import logsumexp
from numpyro.diagnostics import effective_sample_size, split_gelman_rubin
from scipy.optimize import minimize

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.kalman import KalmanBank, process_variance
from thesis_lib.jenga.learners.learner import SEEN
from thesis_lib.jenga.learners.networks import N_OUT, soft_clamp
from thesis_lib.jenga.learners.settings import NutsSettings
from thesis_lib.jenga.robot.samples import ADVANCE

LEAST_CURVATURE = 0.5


@dataclass(frozen=True)
class Posterior:
    """Posterior distribution of one push.

    belief: p(c | z) (K,).  state_mean, state_std: s (t + 1, 7), mm and N; `advance` is known exactly.  r_hat, ess:
    largest R̂ and smallest effective sample size over states and abstraction probabilities.  divergences: of all draws.
    """

    belief: np.ndarray
    state_mean: np.ndarray
    state_std: np.ndarray
    r_hat: float
    ess: float
    divergences: int


def log_transitions(layers: list, scaling: Any, noise: Any, states: Any, actions: Any, context: Any) -> Any:
    """Σ_i log Normal(s_{i+1}; f(s_i), Q) in JAX, for states (t + 1, 7) and the mean weights of one network."""
    x = scaling.inputs(states[:-1], actions, context, jnp)

    def affine(h: Any, w: Any) -> Any:
        return h @ w[:-1] + w[-1]

    h = x
    for w in layers[:-2]:
        h = jnp.tanh(affine(h, w))
    out = affine(h, layers[-2]) + affine(x, layers[-1])
    log_var = soft_clamp(out[..., N_OUT:], jnp)
    dims = jnp.array(SEEN)
    change = jnp.asarray(scaling.change)
    mean = scaling.next_state(states[:-1], out[..., :N_OUT])[..., dims]
    var = process_variance(change**2 * jnp.exp(log_var), jnp.asarray(noise), jnp)[..., dims]
    return -0.5 * ((states[1:, dims] - mean) ** 2 / var + jnp.log(2 * jnp.pi * var)).sum()


class Sampler:
    """Samples posteriors with one learner; pushes of equal length share one compilation, slower than the sampling."""

    def __init__(self, learner: Hma, settings: NutsSettings):
        self.learner, self.settings = learner, settings
        self._layers = [jnp.asarray(w) for w in learner.networks.arrays()]
        self._dims = jnp.array(SEEN)
        self._sigma = jnp.sqrt(jnp.asarray(learner.noise))[self._dims]
        self._value = jax.jit(jax.value_and_grad(lambda *of: -self._log_joint(*of)))
        self._curvature = jax.jit(jax.hessian(lambda *of: -self._log_joint(*of)))
        self._draw = jax.jit(self._chains)

    def sample(
        self, readings: np.ndarray, actions: np.ndarray, context: np.ndarray, rng: np.random.Generator
    ) -> Posterior:
        """Posterior given readings z_0 … z_t (t + 1, 7), actions (t, 2) and context (2,) of one push.

        UserError if readings and actions do not match, or there is no step.
        """
        if len(actions) < 1 or len(readings) != len(actions) + 1:
            raise UserError(
                f"showcase: {len(readings)} readings need {len(readings) - 1} actions (at least 1), got {len(actions)}."
            )
        contexts = jnp.broadcast_to(jnp.asarray(context), (len(actions), 2))
        push = (jnp.asarray(readings), jnp.asarray(actions), contexts)
        prior = jnp.log(jnp.asarray(self.learner.initial_belief(context[None])[0]))
        shape = (len(readings), len(SEEN))
        key = jax.random.key(int(rng.integers(2**31)))
        samples, diverging = self._draw(key, prior, push, *self._laplace(push, shape[0] * shape[1]))
        drawn = {name: np.asarray(value, float) for name, value in samples.items()}
        belief = drawn["c"]
        # a probability that stays at 0 or 1 has no variance, so its R̂ and ESS are undefined
        moving = belief.std(axis=(0, 1)) > 1e-4
        all_of = np.concatenate([drawn["e"], belief[..., moving]], axis=2)
        mean, std, sigma = readings.copy(), np.zeros_like(readings), np.asarray(self._sigma)
        shift = drawn["e"].mean(axis=(0, 1))
        mean[:, SEEN] += shift.reshape(shape) * sigma
        std[:, SEEN] = np.sqrt(drawn["square"].mean(axis=(0, 1)) - shift**2).reshape(shape) * sigma
        return Posterior(
            belief=belief.mean(axis=(0, 1)),
            state_mean=mean,
            state_std=std,
            r_hat=float(np.max(split_gelman_rubin(all_of))),
            ess=float(np.min(effective_sample_size(all_of))),
            divergences=int(np.asarray(diverging).sum()),
        )

    def _log_joint(self, e: Any, weights: list, push: tuple) -> Any:
        """log p(z, s | k) up to a constant, e (size,)."""
        z, actions, contexts = push
        states = z.at[:, self._dims].add(self._sigma * e.reshape(len(z), len(SEEN)))
        learner = self.learner
        return log_transitions(weights, learner.scaling, learner.noise, states, actions, contexts) - 0.5 * (e**2).sum()

    def _laplace(self, push: tuple, size: int) -> tuple[Any, Any, Any]:
        """Mode (K, size), root of the covariance (K, size, size) and its log determinant (K,) for each network."""
        modes, roots, dets = [], [], []
        for k in range(self._layers[0].shape[0]):
            layers = [w[k] for w in self._layers]
            optimum = minimize(
                lambda e, own=layers: tuple(np.asarray(part, float) for part in self._value(jnp.asarray(e), own, push)),
                np.zeros(size),
                jac=True,
                method="L-BFGS-B",
            )
            values, vectors = np.linalg.eigh(np.asarray(self._curvature(jnp.asarray(optimum.x), layers, push), float))
            # readings alone give curvature 1; networks may lower it, so a bound keeps the spread of ψ finite
            deviation = 1.0 / np.sqrt(np.maximum(values, LEAST_CURVATURE))
            modes.append(optimum.x)
            roots.append(vectors * deviation)
            dets.append(np.log(deviation).sum())
        return jnp.asarray(np.array(modes)), jnp.asarray(np.array(roots)), jnp.asarray(np.array(dets))

    def _chains(self, key: Any, prior: Any, push: tuple, mode: Any, root: Any, log_det: Any) -> tuple[dict, Any]:
        """Run NUTS over u: derived quantities (chains, draws, …), and a mask of divergent draws."""

        def model() -> None:
            u: Any = numpyro.sample("u", numpyro.distributions.Normal(0.0, 1.0).expand(mode.shape).to_event(2))
            e = mode + jnp.einsum("kij,kj->ki", root, u)
            terms = jax.vmap(lambda own, weights: self._log_joint(own, weights, push))(e, self._layers)
            joint = prior + terms + log_det + 0.5 * (u**2).sum(axis=1)
            numpyro.factor("abstraction", logsumexp(joint))
            belief = numpyro.deterministic("c", jax.nn.softmax(joint))
            numpyro.deterministic("e", belief @ e)
            numpyro.deterministic("square", belief @ e**2)

        settings = self.settings
        mcmc = numpyro.infer.MCMC(
            numpyro.infer.NUTS(
                model, target_accept_prob=settings.target_accept, max_tree_depth=settings.max_tree_depth
            ),
            num_warmup=settings.warm_up,
            num_samples=settings.draws,
            num_chains=settings.chains,
            chain_method="vectorized",
            progress_bar=False,
        )
        mcmc.run(key, extra_fields=("diverging",))
        return mcmc.get_samples(group_by_chain=True), mcmc.get_extra_fields()["diverging"]


def agreement(bank: KalmanBank, posterior: Posterior) -> dict[str, float]:
    """Distance between the results of filter bank and sampler after the same readings.

    belief_apart: total variation; state_apart: largest difference of the last state's means, in posterior deviations.
    """
    dims = [d for d in SEEN if d != ADVANCE]
    apart = np.abs(bank.moments()[0] - posterior.state_mean[-1])[dims] / posterior.state_std[-1][dims]
    belief = 0.5 * np.abs(bank.belief - posterior.belief).sum()
    return {"belief_apart": float(belief), "state_apart": float(apart.max())}
