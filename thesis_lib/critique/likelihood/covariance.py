"""Covariance of the residuals from the noise of *all* data, also of a law's inputs.

    S = A C Aᵀ + κ² w wᵀ + σ_m² D,    A = ∂R/∂data,  w = ∂R/∂t_c,  D = diag(1, 1, 1/k²) on the impact components

A is made of secants over one standard deviation of each datum, so that a kink between sticking and sliding counts as
far as noise reaches it.  κ is wide, because the instant of impact is unknown a priori.  σ_m is scatter that neither
noise nor model explains (`fit`).

Where nobody measured the spin before an impact, S also holds what it does to the prediction over all spins that are
believed possible (`SPINS`), of which the prediction is the mean.

An episode bends: which corner hits first may hang on a milliradian.  Its covariance goes to second order in the noise,
and it has no κ, because its touch is solved for.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from thesis_lib.critique.contacts.kinds import kind_of
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.residuals import compare, over_spins, predict, predict_by_spin, state_beside
from thesis_lib.mechanics.state import State

INSTANT = 2e-3  # s, κ: the prior of t_c; half a frame at 250 Hz
_H_INSTANT = 1e-4  # s, for the derivative by the instant of impact
_DATA = tuple(product(range(3), (0, 1)))  # of one side: channel, and value (0) or slope (1) of its line


@dataclass(frozen=True)
class Noisy:
    """A statistic of n impacts (n, m), its covariance (n, m, m) from noise, and w (n, m), its slope by the instant."""

    value: np.ndarray
    noise: np.ndarray
    by_instant: np.ndarray

    def covariance(self, instant: np.ndarray | float = INSTANT) -> np.ndarray:
        """S (n, m, m) without σ_m.

        `instant` is κ in s, scalar or (n,): wide if S weighs residuals (a fit of the instant), `t_std` for their size
        at the estimated one.
        """
        w, kappa = self.by_instant, np.broadcast_to(instant, len(self.value))
        return self.noise + kappa[:, None, None] ** 2 * w[:, :, None] * w[:, None, :]


def residual_covariance(
    model: Model, values: Mapping[str, float], observations: Observations, instant: np.ndarray | float = INSTANT
) -> np.ndarray:
    """S (n, m, m) of the residuals without σ_m; `instant` as in `Noisy.covariance`."""
    return noisy_residuals(model, values, observations).covariance(instant)


def noisy_residuals(model: Model, values: Mapping[str, float], observations: Observations) -> Noisy:
    """Residuals R of all impacts with their covariance."""
    o = observations
    if o.spin:
        found = _of_single(model, values, o)
        return replace(found, noise=found.noise + spin_covariance(model, values, o))
    if not o.span.any():
        return _of_single(model, values, o)
    single, episodes = np.flatnonzero(o.span == 0.0), np.flatnonzero(o.span)
    whole = Noisy(*(np.zeros((len(o), 7) + (7,) * k) for k in (0, 1, 0)))
    for rows, part in ((single, _of_single), (episodes, _of_episodes)):
        if len(rows):
            found = part(model, values, o.rows(rows))
            whole.value[rows], whole.noise[rows], whole.by_instant[rows] = found.value, found.noise, found.by_instant
    return whole


def spin_covariance(model: Model, values: Mapping[str, float], observations: Observations) -> np.ndarray:
    """Covariance (n, 7, 7) of the residuals of single hits from a spin that nobody measured."""
    before = state_beside(model, values, observations, 0)
    v, _, q = predict_by_spin(model, values, observations, before)
    R = np.zeros((len(v), len(observations), 7))
    R[:, :, :3] = v - over_spins(v)
    if q is not None:
        R[:, :, 3:6] = np.nan_to_num(q - over_spins(q))
    return over_spins(R[..., :, None] * R[..., None, :])


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
    return _noisy(observations, statistic(_copies(observations, with_samples))).covariance(instant)


def _copies(o: Observations, with_samples: bool) -> Observations:
    """26 copies of the impacts, each of the data moved up and down by its step.

    Twelve for the data after, two for the instant as measured and later, twelve for the data before.
    """
    copies, step = o.tiled(26, with_samples), _step(o)
    lines = [array.reshape(26, len(o), 2, 3) for array in (copies.value, copies.slope)]
    for first, side in ((0, 1), (14, 0)):
        for i, (channel, k) in enumerate(_DATA):
            lines[k][first + 2 * i, :, side, channel] += step[:, side, channel, k]
            lines[k][first + 2 * i + 1, :, side, channel] -= step[:, side, channel, k]
    # a later instant: both arcs fly on, by their velocity there (not that of the line), under gravity
    a = o.rig.fall(State.of(o.value[:, 0], o.slope[:, 0], o.trial, o.t)).T[:, None]
    lines[0][13] += _H_INSTANT * (o.slope - o.bow[:, :, 1:] * a)
    lines[1][13] += _H_INSTANT * a
    return copies


def _step(o: Observations) -> np.ndarray:
    """Standard deviation of each datum, (n, side, channel, value or slope)."""
    std = np.sqrt(np.einsum("nsckk->nsck", o.cov))
    return np.where(std > 0.0, std, 1e-6)


def _noisy(o: Observations, R: np.ndarray) -> Noisy:
    """From the statistic (26 n, m) of the `_copies`."""
    n, step = len(o), _step(o)
    R = R.reshape(26, n, -1)
    moved, (here, later) = np.concatenate([R[14:], R[:12]]), R[12:14]
    secants = (moved[::2] - moved[1::2]).reshape(2, 3, 2, n, -1)  # side, channel, value or slope
    S = np.zeros((n, R.shape[2], R.shape[2]))
    for side, channel in product((0, 1), range(3)):
        A = np.stack(list(secants[side, channel]), axis=1) / (2.0 * step[:, side, channel, :, None])  # (n, 2, m)
        S += np.swapaxes(A, 1, 2) @ o.cov[:, side, channel] @ A
    return Noisy(here, S, (later - here) / _H_INSTANT if o.arcs else np.zeros_like(here))


def _of_single(model: Model, values: Mapping[str, float], o: Observations) -> Noisy:
    """Residuals of single hits; copies that differ after the hit only share its prediction."""
    n, copies = len(o), _copies(o, model.has_arc)
    after = state_beside(model, values, copies.part(slice(14 * n), model.has_arc), 1)
    data = copies.part(slice(12 * n, None), model.has_arc)
    before = state_beside(model, values, data, 0)
    prediction = predict(model, values, data, before)
    # where in `before` and `after` each copy has its state
    row = np.arange(14 * n)
    at, of = np.concatenate([np.tile(row[:n], 12), row]), np.concatenate([row, np.tile(row[12 * n : 13 * n], 12)])
    found = _noisy(o, compare(model, values, o.rig, before.select(at), after.select(of), prediction.select(at)))
    if o.touch_std:
        found.noise[:, 6, 6] += o.touch_std**2
    return found


def _of_episodes(model: Model, values: Mapping[str, float], o: Observations) -> Noisy:
    """Residuals of episodes, the last component with unit variance.

    Residuals r± at one standard deviation ±σ_i along the principal axes i of the noise give, to second order,

        S = Σ_i (l_i l_iᵀ + 2 b_i b_iᵀ),    l_i = (r₊ − r₋)/2,    b_i = (r₊ + r₋)/2 − r_0
    """
    variance, axes = np.linalg.eigh(o.cov)  # (n, side, channel, i), (n, side, channel, value or slope, i)
    sigma = np.sqrt(np.maximum(variance, 0.0))[..., None, :] * axes
    value, S = np.zeros((len(o), 7)), np.zeros((len(o), 7, 7))
    S[:, 6, 6] = 1.0
    for side in (0, 1):
        copies = o.tiled(13, model.has_arc)
        lines = [array.reshape(13, len(o), 2, 3) for array in (copies.value, copies.slope)]
        for j, (channel, i) in enumerate(_DATA):
            for line, step in zip(lines, np.moveaxis(sigma[:, side, channel, :, i], 1, 0)):
                line[2 * j, :, side, channel] += step
                line[2 * j + 1, :, side, channel] -= step
        state = state_beside(model, values, copies, side)
        if side == 0:
            state = kind_of(model).end(model, values, o.rig, state, copies.span)
        r = np.concatenate([state.v, state.q], axis=1).reshape(13, len(o), 6)
        value[:, :6] += (2 * side - 1) * r[12]
        up, down, here = r[0:12:2], r[1:12:2], r[12]
        for part in (0.5 * (up - down), np.sqrt(2.0) * (0.5 * (up + down) - here)):
            S[:, :6, :6] += np.einsum("inj,ink->njk", part, part)
    return Noisy(value, S, np.zeros_like(value))
