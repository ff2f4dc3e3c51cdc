"""Covariance of the residuals from the noise of *all* data, also of a law's inputs.

    S = A C Aᵀ + κ² w wᵀ + σ_m² D,    A = ∂R/∂data,  w = ∂R/∂t_c,  D = diag(1, 1, 1/k²) on the impact components

A is made of secants over one standard deviation of each datum, so that a kink between sticking and sliding counts as
far as noise reaches it.  κ is wide, because the instant of impact is unknown a priori.  σ_m is scatter that neither
noise nor model explains (`fit`).

An episode bends: which corner hits first may hang on a milliradian.  Its covariance goes to second order in the noise,
and it has no κ, because its touch is solved for.
"""

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np

from thesis_lib.critique.drops.model import Model
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.critique.drops.residuals import end_of_episodes, impact_residuals, states_at_impact

INSTANT = 2e-3  # s, κ: the prior of t_c; half a frame at 250 Hz
_H_INSTANT = 1e-4  # s, for the derivative by the instant of impact


def residual_covariance(
    model: Model, values: Mapping[str, float], observations: Observations, instant: np.ndarray | float = INSTANT
) -> np.ndarray:
    """S (n, m, m) without σ_m.

    `instant` is κ in s: wide if S weighs residuals (a fit of the instant), `t_std` for their size at the estimated one.
    """
    o = observations
    if not o.span.any():
        return noise_covariance(lambda o: impact_residuals(model, values, o), o, instant, model.has_arc)
    single, episodes = np.flatnonzero(o.span == 0.0), np.flatnonzero(o.span)
    instant, S = np.broadcast_to(instant, len(o)), np.zeros((len(o), 7, 7))
    if len(single):
        S[single] = residual_covariance(model, values, o.rows(single), instant[single])
    S[episodes] = _episode_covariance(model, values, o.rows(episodes))
    return S


def noise_covariance(
    statistic: Callable[[Observations], np.ndarray],
    observations: Observations,
    instant: np.ndarray | float,
    with_samples: bool,
) -> np.ndarray:
    """Covariance (n, m, m) of a statistic of n impacts from the noise of all data, by secants.

    Args:
        statistic: maps any observations to (n, m).
        instant: κ in s, scalar or (n,).
        with_samples: whether the statistic uses `nodes` and `weights`.
    """
    o, n = observations, len(observations)
    std = np.sqrt(np.einsum("nsckk->nsck", o.cov))
    step = np.where(std > 0.0, std, 1e-6)
    data = list(product((0, 1), range(3), (0, 1)))  # side, channel, and value (0) or slope (1) of its line
    # all secants in one call, on copies of the impacts: each datum moved up and down, and the instant as measured and
    # a moment later
    copies = o.tiled(2 * len(data) + 2, with_samples)
    lines = [array.reshape(-1, n, 2, 3) for array in (copies.value, copies.slope)]
    for i, (side, channel, k) in enumerate(data):
        lines[k][2 * i, :, side, channel] += step[:, side, channel, k]
        lines[k][2 * i + 1, :, side, channel] -= step[:, side, channel, k]
    lines[0][-1] += _H_INSTANT * o.slope
    R = statistic(copies).reshape(2 * len(data) + 2, n, -1)

    up, down, (here, later) = R[0:-2:2], R[1:-2:2], R[-2:]
    secants = (up - down).reshape(2, 3, 2, n, -1)
    S = np.zeros((n, R.shape[2], R.shape[2]))
    for side, channel in product((0, 1), range(3)):
        A = np.stack(list(secants[side, channel]), axis=1) / (2.0 * step[:, side, channel, :, None])  # (n, 2, m)
        S += np.swapaxes(A, 1, 2) @ o.cov[:, side, channel] @ A
    if o.arcs:
        w = (later - here) / _H_INSTANT
        S += np.broadcast_to(instant, n)[:, None, None] ** 2 * w[:, :, None] * w[:, None, :]
    return S


def _episode_covariance(model: Model, values: Mapping[str, float], o: Observations) -> np.ndarray:
    """S (n, 7, 7) of episodes, the last component with unit variance.

    Residuals r± at one standard deviation ±σ_i along the principal axes i of the noise give, to second order,

        S = Σ_i (l_i l_iᵀ + 2 b_i b_iᵀ),    l_i = (r₊ − r₋)/2,    b_i = (r₊ + r₋)/2 − r_0
    """
    variance, axes = np.linalg.eigh(o.cov)  # (n, side, channel, i), (n, side, channel, value or slope, i)
    sigma = np.sqrt(np.maximum(variance, 0.0))[..., None, :] * axes
    S = np.zeros((len(o), 7, 7))
    S[:, 6, 6] = 1.0
    for side in (0, 1):
        copies = o.tiled(13, model.has_arc)
        lines = [array.reshape(13, len(o), 2, 3) for array in (copies.value, copies.slope)]
        for j, (channel, i) in enumerate(product(range(3), (0, 1))):
            for line, step in zip(lines, np.moveaxis(sigma[:, side, channel, :, i], 1, 0)):
                line[2 * j, :, side, channel] += step
                line[2 * j + 1, :, side, channel] -= step
        state = states_at_impact(model, values, copies)[side]
        if side == 0:
            state = end_of_episodes(model, values, o.rig, state, copies.span)
        r = np.concatenate([state.v, state.q], axis=1).reshape(13, len(o), 6)
        up, down, here = r[0:12:2], r[1:12:2], r[12]
        for part in (0.5 * (up - down), np.sqrt(2.0) * (0.5 * (up + down) - here)):
            S[:, :6, :6] += np.einsum("inj,ink->njk", part, part)
    return S
