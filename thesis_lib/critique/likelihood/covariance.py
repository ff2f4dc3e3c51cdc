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
    """Copies of the impacts, each of the data moved up and down by its step; 26 in the plane.

    First those with the data after moved, then two for the instant as measured and later, then those with the data
    before moved.
    """
    m, step = o.space.motions, o.steps
    moves = 4 * m
    copies = o.tiled(2 * moves + 2, with_samples)
    value, slope = (array.reshape(2 * moves + 2, len(o), 2, -1) for array in (copies.value, copies.slope))
    for first, side in ((0, 1), (moves + 2, 0)):
        for i, (channel, k) in enumerate(product(range(m), (0, 1))):
            for sign in (1, -1):
                at = first + 2 * i + (sign < 0)
                if k:
                    slope[at, :, side, channel] += sign * step[:, side, channel, 1]
                else:
                    change = np.zeros((m, len(o)))
                    change[channel] = sign * step[:, side, channel, 0]
                    value[at, :, side] = o.space.shift(value[at, :, side].T, change).T
    # a later instant: both arcs fly on, by their velocity there (not that of the line), under gravity
    for side in (0, 1):
        lines, a = o.lines(side), o.rig.fall(o.lines(0)).T
        behind = o.bow[:, side, 1:] * a
        behind[:, o.space.dimension :] *= o.space.is_plane  # in space the spin is that of the flight at the instant
        change = _H_INSTANT * (o.slope[:, side] - behind)
        value[moves + 1, :, side] = o.space.shift(lines.pose, change.T).T
        slope[moves + 1, :, side] += _H_INSTANT * a
    return copies


def _noisy(o: Observations, R: np.ndarray) -> Noisy:
    """From the statistic of the `_copies`, one after the other."""
    n, m, step = len(o), o.space.motions, o.steps
    moves = 4 * m
    R = R.reshape(2 * moves + 2, n, -1)
    moved, (here, later) = np.concatenate([R[moves + 2 :], R[:moves]]), R[moves : moves + 2]
    secants = (moved[::2] - moved[1::2]).reshape(2, m, 2, n, -1)  # side, channel, value or slope
    S = np.zeros((n, R.shape[2], R.shape[2]))
    for side, (channels, cov) in product((0, 1), o.blocks):
        of_block = secants[side, channels].reshape(2 * len(channels), n, -1)
        A = np.stack(list(of_block), axis=1) / (2.0 * step[:, side, channels].reshape(n, -1, 1))  # (n, 2 c, components)
        S += np.swapaxes(A, 1, 2) @ cov[:, side] @ A
    return Noisy(here, S, (later - here) / _H_INSTANT if o.arcs else np.zeros_like(here))


def _of_single(model: Model, values: Mapping[str, float], o: Observations) -> Noisy:
    """Residuals of single hits; copies that differ after the hit only share its prediction."""
    n, moves, copies = len(o), 4 * o.space.motions, _copies(o, model.has_arc)
    after = state_beside(model, values, copies.part(slice((moves + 2) * n), model.has_arc), 1)
    data = copies.part(slice(moves * n, None), model.has_arc)
    before = state_beside(model, values, data, 0)
    prediction = predict(model, values, data, before)
    # where in `before` and `after` each copy has its state
    row = np.arange((moves + 2) * n)
    at = np.concatenate([np.tile(row[:n], moves), row])
    of = np.concatenate([row, np.tile(row[moves * n : (moves + 1) * n], moves)])
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
