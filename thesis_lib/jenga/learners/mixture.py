"""Top-down step of HMA: a Dirichlet-process mixture over windows of pushes, merged into a few abstractions.

    π | α ~ GEM(α),   u_i | π ~ Multi(π)         (windows; thesis, equations 5.1 and 5.2, by the sticks of 5.7)
    x_i | u_i ~ Normal(m_{u_i}, S_{u_i})                                       (Gaussians; thesis, section 5.3.2)
    c_j | η ~ Multi(η),   u_i | c_j ~ Multi(φ_{c_j})   for the windows i of push j          (abstractions of pushes)

| paper | code          | unit | shape     |                                                              |
|-------|---------------|------|-----------|--------------------------------------------------------------|
| x     | `features`    | –    | (n, 5)    | features of windows, `learner.FEATURES`                      |
| u     | `words`       | 1    | (n, C)    | component of a window (responsibilities)                     |
| m, S  | `means`, `covariances` | 1 | (C, 5), (C, 5, 5) | in standard deviations of the features        |
| c     | `resp`        | 1    | (n, K)    | abstraction of the push that a window belongs to             |
| φ     | `topics`      | 1    | (K, C)    | share of each component in each abstraction                  |
| η     | `shares`      | 1    | (K,)      | share of each abstraction                                    |

Pushes are not Gaussian (a rising force is a curve), so the process needs a dozen components for four behaviours, and
the first windows of a hard and of a stuck block share a component.  Components are the words, and abstractions the
topics, of the thesis's analogy (section 5.3.3), with a push as the document: p(x | k) = Σ_u φ_ku N_u(x).

Merging criterion (own choice): each push starts as an abstraction, and pairs are merged while the integrated
complete-data likelihood grows.  It has a closed form in counts n_ku of words (Dirichlet-multinomial) and m_k of pushes,

    ICL = Σ_k [log B(a + n_k) − log B(a)] + log B(½ + m) − log B(½),   log B(a) = Σ log Γ(a_u) − log Γ(Σ a_u)

Merging continues in any case down to `max_abstractions`.  Counts are divided by `overlap` because neighbouring windows
share samples.  Mixture components were merged by ICL before (Biernacki et al. 2000, doi 10.1109/34.865189; Baudry et
al. 2010, doi 10.1198/jcgs.2010.08111; Hennig 2010, doi 10.1007/s11634-010-0058-3); here pushes replace single windows.

Sources: thesis; Blei and Jordan 2006, doi 10.1214/06-BA104 (variational Dirichlet process, as in scikit-learn); Nigam
et al. 2000, doi 10.1023/A:1007692713085 (one topic per document).
"""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, softmax

from thesis_lib.jenga.learners.learner import FEATURES
from thesis_lib.jenga.learners.settings import MixtureSettings

# Thresholds of the names (own choices): N; block per advance; tower per advance, as in the criterion of a movable block
# (1 mm in 6 mm, `settings.MovableSettings`); N between easy and hard
NO_FORCE, NO_MOVE, DRAG, HARD = 0.02, 0.5, 1.0 / 6.0, 0.5


@dataclass(frozen=True)
class WindowMixture:
    """A mixture over windows, and the abstractions formed from its components (module's table).

    centre, spread: (5,), of the training windows' features.  resp: (n, K), of the training windows.
    """

    centre: np.ndarray
    spread: np.ndarray
    weights: np.ndarray
    means: np.ndarray
    covariances: np.ndarray
    topics: np.ndarray
    shares: np.ndarray
    resp: np.ndarray

    def log_density(self, features: np.ndarray, names: tuple[str, ...] = FEATURES) -> np.ndarray:
        """log p(x | k) (n, K) of features (n, 5), or of the named ones alone; up to a constant."""
        use = [FEATURES.index(name) for name in names]
        scaled = ((features - self.centre) / self.spread)[:, use]
        parts = log_normal(scaled, self.means[:, use], self.covariances[:, use][:, :, use])
        return _log_mix(parts, self.topics)


def log_normal(x: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Log density (n, C) of x (n, d) under normals with means (C, d) and covariances (C, d, d)."""
    whiten = np.linalg.inv(np.linalg.cholesky(covariances))
    white = np.einsum("cij,ncj->nci", whiten, x[:, None] - means)
    log_det = -np.log(np.diagonal(whiten, axis1=1, axis2=2)).sum(axis=1)
    return -0.5 * (white**2).sum(axis=2) - log_det - 0.5 * x.shape[1] * np.log(2 * np.pi)


def _log_mix(parts: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """log Σ_u w_ku exp(parts_nu): (n, C), (K, C) -> (n, K)."""
    top = parts.max(axis=1, keepdims=True)
    return np.log(np.maximum(np.exp(parts - top) @ weights.T, 1e-300)) + top


def fit_mixture(
    features: np.ndarray, push: np.ndarray, settings: MixtureSettings, rng: np.random.Generator
) -> WindowMixture:
    """Fit Dirichlet-process components to features (n, 5) and merge them into abstractions of pushes (n,)."""
    from sklearn.mixture import BayesianGaussianMixture

    centre, spread = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-3)
    scaled = (features - centre) / spread
    process = BayesianGaussianMixture(
        n_components=min(settings.truncation, max(2, len(features) // 4)),
        weight_concentration_prior_type="dirichlet_process",
        weight_concentration_prior=settings.alpha,
        reg_covar=settings.regularisation,
        max_iter=300,
        tol=1e-2,
        random_state=int(rng.integers(2**31)),
    )
    with warnings.catch_warnings():
        # a bound that still rises slowly after 300 steps does not harm the clusters
        warnings.simplefilter("ignore")
        process.fit(scaled)
    keep = process.weights_ >= min(settings.min_weight, process.weights_.max())
    weights = process.weights_[keep] / process.weights_[keep].sum()
    means, covariances = process.means_[keep], process.covariances_[keep]
    parts = log_normal(scaled, means, covariances)
    words = np.exp(parts + np.log(weights) - _log_mix(parts, weights[None]))
    _, number = np.unique(push, return_inverse=True)
    counts = np.zeros((number.max() + 1, len(weights)))
    np.add.at(counts, number, words / settings.overlap)
    prior = settings.topic_prior * weights
    group = merge(counts, prior, settings)
    member = np.eye(group.max() + 1)[group]  # (pushes, K)
    topics = member.T @ counts + prior
    topics /= topics.sum(axis=1, keepdims=True)
    shares = (member.sum(axis=0) + 0.5) / (len(member) + 0.5 * member.shape[1])
    log_like = _log_mix(parts, topics) / settings.overlap
    resp = push_posterior(log_like, push, shares)
    return WindowMixture(centre, spread, weights, means, covariances, topics, shares, resp)


def log_beta(a: np.ndarray) -> np.ndarray:
    """Log of the multivariate beta function, log B of the module, over the last axis."""
    return gammaln(a).sum(axis=-1) - gammaln(a.sum(axis=-1))


def merge(counts: np.ndarray, prior: np.ndarray, settings: MixtureSettings) -> np.ndarray:
    """Group (pushes,) of each push by the merging criterion, largest group first; counts (pushes, C), prior a (C,)."""
    group = np.arange(len(counts))
    total, size = counts.copy(), np.ones(len(counts))
    evidence = log_beta(prior + total)
    gain = np.full((len(counts), len(counts)), -np.inf)  # growth of the words' part, [a, b] with b < a
    for a in range(1, len(counts)):
        gain[a, :a] = log_beta(prior + total[a] + total[:a]) - evidence[a] - evidence[:a] + log_beta(prior)
    while True:
        k = len(total)
        if k <= settings.min_abstractions:
            break
        # change of the pushes' part; its terms in K alone are the same for every pair
        pairs = gammaln(0.5 + np.add.outer(size, size)) - np.add.outer(gammaln(0.5 + size), gammaln(0.5 + size))
        constant = 2 * gammaln(0.5) - _size_term(k, len(counts)) + _size_term(k - 1, len(counts)) - gammaln(0.5)
        score = gain + pairs + constant
        a, b = np.unravel_index(np.argmax(score), score.shape)
        if score[a, b] <= 0 and k <= settings.max_abstractions:
            break
        group = np.where(group == a, b, group)
        group = np.where(group > a, group - 1, group)
        total[b] += total[a]
        size[b] += size[a]
        total, size, evidence = np.delete(total, a, 0), np.delete(size, a), np.delete(evidence, a)
        gain = np.delete(np.delete(gain, a, 0), a, 1)
        evidence[b] = log_beta(prior + total[b])
        row = log_beta(prior + total[b] + total) - evidence[b] - evidence + log_beta(prior)
        gain[b, :b], gain[b + 1 :, b] = row[:b], row[b + 1 :]
    order = np.argsort(-size, kind="stable")
    return np.argsort(order)[group]


def _size_term(k: int, pushes: int) -> float:
    """log Γ(K/2) − log Γ(pushes + K/2), the terms in K of the ICL's part for pushes, except −K log Γ(½)."""
    return float(gammaln(0.5 * k) - gammaln(pushes + 0.5 * k))


def push_posterior(log_like: np.ndarray, push: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """p(c | push) (n, K), equal for all samples of a push, from log likelihoods (n, K) and shares (K,)."""
    _, number = np.unique(push, return_inverse=True)
    total = np.zeros((number.max() + 1, log_like.shape[1]))
    np.add.at(total, number, log_like)
    return softmax(total + np.log(shares), axis=1)[number]


def describe(features: np.ndarray, resp: np.ndarray, force_scale: float) -> dict[str, np.ndarray]:
    """Mean features of abstractions, (K,) each: force (N), rise (N/step), move, lag, drag (1); `force_scale` in N."""
    mean = (resp / np.maximum(resp.sum(axis=0), 1e-9)).T @ features
    look = {name: mean[:, column] for column, name in enumerate(FEATURES)}
    return look | {"force": force_scale * np.sinh(look["force"])}


def names_of(look: dict[str, np.ndarray]) -> list[str]:
    """Names from mean features: no block, no move, drags tower, easy move, hard move; numbered if repeated."""
    names = []
    for force, move, drag in zip(look["force"], look["move"], look["drag"]):
        if drag > DRAG:
            name = "drags tower"
        elif move < NO_MOVE:
            name = "no block" if force < NO_FORCE else "no move"
        else:
            name = "hard move" if force > HARD else "easy move"
        names.append(name)
    return [name if names.count(name) == 1 else f"{name} {names[: i + 1].count(name)}" for i, name in enumerate(names)]
