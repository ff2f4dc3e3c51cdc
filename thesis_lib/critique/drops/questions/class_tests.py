"""Tests of whole classes of models, before any candidate is tried.

| test             | property of every model of the class                                                              |
|------------------|---------------------------------------------------------------------------------------------------|
| rigid_point      | τ = m (k² Δω − r_x Δv_y + r_y Δv_x) = 0: one impulse at the assumed contact point; and α ≤ 1: no  |
|                  | gain of energy at the contact                                                                     |
| momentum_balance | k² Δω = a r_x Δv_y − b r_y Δv_x with a = b = 1, for any contact law                               |
| parity           | a mirrored throw gives the mirrored outcome: residuals δv_x and δω are odd, δv_y is even          |
| homogeneity      | twice the velocity gives twice the outcome: residual over speed does not depend on the speed      |

The first two use measurements only, the last two the residual of the law without effects.  If the data cannot support a
test (throws in one direction, unknown noise), it gives a reason instead of a p-value.
"""

from collections.abc import Callable

import numpy as np
from scipy.stats import binom, f, norm

from thesis_lib.contact.space import contact_space, measured_impulse, residual_couple
from thesis_lib.critique.likelihood.covariance import copies_moved, noisy
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.statistics.spread import robust_std

SIGMAS = 3.0  # standard deviations: an impact beyond is outside a class
NOISE_TRUST = 1.2  # the noise may be this factor too small before a share beyond SIGMAS is significant
ONE_SIDED = 0.1  # least share of throws in either direction for a test of parity
FEW = 100  # impacts; below, fewer shapes of the residual are fitted
CLIP = 5.0  # robust standard deviations: limits the weight of wild impacts in a regression
Statistic = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]  # v_pre, v_post, r -> (n, m)


def class_tests(fitted: Fit, observations: Observations) -> dict:
    """Results of all four tests by name, for the law `fitted` without effects; empty in space."""
    tests = (rigid_point, momentum_balance, parity, homogeneity)
    if not observations.rig.has_angle:
        return {test.__name__: {"p_value": None, "why_not": "theta is not measured"} for test in tests}
    if not observations.space.is_plane:
        return {}
    return {test.__name__: test(fitted, observations) for test in tests}


def velocities(fitted: Fit, observations: Observations) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measured v_pre, v_post (n, 3) in m/s, rad/s, and contact point r (n, 2) in m where the impulse acts."""
    before, after = fitted.on(observations).at_impulse
    return before.v, after.v, observations.rig.shape.contact_point(before.theta) + observations.offset


def _noise(statistic: Statistic, fitted: Fit, observations: Observations) -> np.ndarray:
    """Covariance (n, m, m) of `statistic` from the noise of all data."""
    copies = copies_moved(observations, fitted.model.has_arc)
    return noisy(observations, statistic(*velocities(fitted, copies))).covariance(observations.t_std)


def rigid_point(fitted: Fit, observations: Observations) -> dict:
    """Share of impacts that no rigid point impulse explains within the noise."""
    if not observations.noise_known:
        return {"p_value": None, "why_not": "the noise of the measurements is unknown"}
    k_g = observations.rig.k_g

    def couple_and_gain(v_pre: np.ndarray, v_post: np.ndarray, r: np.ndarray) -> np.ndarray:
        dv = v_post - v_pre
        space = contact_space(v_pre, r, mass=1.0, k_g=k_g)
        after = space.velocity_after(*measured_impulse(dv, r, mass=1.0, k_g=k_g))
        gain = space.energy(*after) - space.energy(space.v_t, space.v_n)
        return np.stack([residual_couple(dv, r, mass=1.0, k_g=k_g), gain], axis=1)

    variance = np.einsum("nii->ni", _noise(couple_and_gain, fitted, observations))
    z, up = (couple_and_gain(*velocities(fitted, observations)) / np.sqrt(variance + 1e-300)).T
    beyond = norm.sf(SIGMAS / NOISE_TRUST)
    count, gained, n = int(np.sum(np.abs(z) > SIGMAS)), int(np.sum(up > SIGMAS)), len(z)
    p = min(binom.sf(count - 1, n, 2.0 * beyond), binom.sf(gained - 1, n, beyond))
    return {
        "p_value": float(min(1.0, 2.0 * p)),
        "share_couple": count / n,
        "share_energy_gain": gained / n,
        "expected_share": float(2.0 * norm.sf(SIGMAS)),
        "couple_mean_square_sigma": float(robust_std(z) ** 2),
    }


def momentum_balance(fitted: Fit, observations: Observations) -> dict:
    """Coefficients a and b of the balance of angular momentum; both 1 for every contact law."""
    k2 = observations.rig.k_g**2

    def terms(v_pre: np.ndarray, v_post: np.ndarray, r: np.ndarray) -> np.ndarray:
        dv = v_post - v_pre
        X = np.stack([r[:, 0] * dv[:, 1], -r[:, 1] * dv[:, 0]], axis=1)
        return np.column_stack([X, k2 * dv[:, 2] - X.sum(axis=1)])

    values = terms(*velocities(fitted, observations))
    X, tau = values[:, :2], values[:, 2]
    seen = np.ptp(X, axis=0) > 1e-9 * (np.abs(X).max() + 1e-300)
    if not seen.any():
        return {"p_value": None, "why_not": "the lever arms of the contact do not vary"}
    X = X[:, seen]
    # τ regressed on X gives (a − 1, b − 1); both share noise, whose covariance would bias the slope
    coefficients, covariance = _regress(tau, X)
    shared = _noise(terms, fitted, observations)[:, :2, 2].sum(axis=0)[seen]
    coefficients = 1.0 + coefficients - np.linalg.pinv(X.T @ X, hermitian=True) @ shared
    p = _p_of(coefficients - 1.0, covariance, len(tau) - X.shape[1])
    names = [name for name, is_seen in zip("ab", seen) if is_seen]
    terms_of = {
        name: {"value": float(value), "std": float(std), "unit": "1"}
        for name, value, std in zip(names, coefficients, np.sqrt(np.diag(covariance)))
    }
    return {"p_value": p, "a": None, "b": None} | terms_of


def parity(fitted: Fit, observations: Observations) -> dict:
    """Test for parts of the residual that a mirrored throw would not mirror."""
    v_t, v_n, omega, r_x, _ = _contact_state(fitted, observations)
    positive = float(np.mean(v_t > 0))
    if min(positive, 1.0 - positive) < ONE_SIDED:
        return {"p_value": None, "why_not": "nearly all impacts slide the same way: throw both ways"}
    even = np.stack([np.ones_like(v_t), v_n, np.abs(v_t), np.abs(r_x), r_x * v_t, omega * v_t], axis=1)
    odd = np.stack([v_t, omega, r_x, v_t * v_n, v_t * np.abs(v_t), r_x * v_n], axis=1)
    R, std = _residual(fitted, observations)
    p = [_extra(R[:, i], *shapes, std[:, i]) for i, shapes in enumerate(((odd, even), (even, odd), (odd, even)))]
    return {"p_value": min(1.0, 3.0 * min(p)), "share_sliding_ahead": positive}


def homogeneity(fitted: Fit, observations: Observations) -> dict:
    """Test whether the residual over speed depends on the speed, at fixed direction."""
    v_t, v_n, _, r_x, speed = _contact_state(fitted, observations)
    spread = float(np.quantile(speed, 0.9) / np.quantile(speed, 0.1))
    if spread < 1.2:
        return {"p_value": None, "why_not": "all impacts have nearly the same speed: vary the height"}
    # a law of degree 1 depends on the direction of the contact velocity and on the lever arm only
    a, r = v_t / np.hypot(v_t, v_n), r_x / observations.rig.k_g
    constant = np.ones_like(a)
    shapes = [constant, a, np.abs(a), a * a, a * np.abs(a)], [constant, r, r * r]
    if len(a) < FEW:
        shapes = shapes[0][:3], shapes[1][:2]
    direction = np.stack([f * g for f in shapes[0] for g in shapes[1]], axis=1)
    trend = np.stack([constant, a, np.abs(a), r], axis=1) * (speed / speed.mean() - 1.0)[:, None]
    keep, breaks = speed[:, None] * direction, speed[:, None] * trend
    R, std = _residual(fitted, observations)
    p = [_extra(R[:, i], keep, breaks, std[:, i]) for i in range(3)]
    return {"p_value": min(1.0, 3.0 * min(p)), "speed_ratio": spread}


def _contact_state(fitted: Fit, observations: Observations) -> tuple[np.ndarray, ...]:
    v_pre, _, r = velocities(fitted, observations)
    space = contact_space(v_pre, r, mass=1.0, k_g=observations.rig.k_g)
    speed = np.sqrt(space.energy(space.v_t, space.v_n))
    return space.v_t, space.v_n, v_pre[:, 2], r[:, 0], speed + 1e-300


def _residual(fitted: Fit, observations: Observations) -> tuple[np.ndarray, np.ndarray]:
    """Residual of the velocity with clipped tails, and its expected standard deviation; (n, 3) each in m/s."""
    o, weights, here = observations, np.array([1.0, 1.0, observations.rig.k_told]), fitted.on(observations)
    S = here.covariance(o.t_std)
    std = np.sqrt(np.einsum("nii->ni", S)[:, :3] * weights**2 + fitted.sigma_m**2)
    z = here.R[:, :3] * weights / std
    limit = CLIP * robust_std(z - np.median(z, axis=0)) + 1e-12
    return np.clip(z, -limit, limit) * std, std


def _extra(y: np.ndarray, keep: np.ndarray, breaks: np.ndarray, std: np.ndarray) -> float:
    """p-value of the columns `breaks` beside `keep` in a regression of y (n,) with noise `std` (n,)."""
    X, y = np.concatenate([keep, breaks], axis=1) / std[:, None], y / std
    scale = np.sqrt(np.mean(X**2, axis=0))
    added = np.r_[np.zeros(keep.shape[1], bool), np.ones(breaks.shape[1], bool)]
    X, added = (X / np.where(scale > 0, scale, 1.0))[:, scale > 0], added[scale > 0]
    if not added.any():
        return 1.0
    coefficients, covariance = _regress(y, X)
    return _p_of(coefficients[added], covariance[np.ix_(added, added)], len(y) - X.shape[1])


def _regress(y: np.ndarray, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares with a covariance for unequal noise (HC3)."""
    inverse = np.linalg.pinv(X.T @ X, rcond=1e-10, hermitian=True)
    coefficients = inverse @ (X.T @ y)
    leverage = np.clip(np.einsum("ni,ij,nj->n", X, inverse, X), 0.0, 0.99)
    e = (y - X @ coefficients) / (1.0 - leverage)
    return coefficients, inverse @ ((X * (e**2)[:, None]).T @ X) @ inverse


def _p_of(coefficients: np.ndarray, covariance: np.ndarray, rest: int) -> float:
    """p-value of all coefficients being zero, with `rest` residual degrees of freedom."""
    rank = int(np.linalg.matrix_rank(covariance, hermitian=True))
    if rank == 0 or rest < 1:
        return 1.0
    statistic = float(coefficients @ np.linalg.pinv(covariance, hermitian=True) @ coefficients) / rank
    return float(f.sf(statistic, rank, rest))
