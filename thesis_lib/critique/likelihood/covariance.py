"""Covariance of a statistic of impacts due to the noise of *all* data, including the inputs of a law.

    S = A C Aᵀ + κ² w wᵀ + σ_m² D,    A = ∂R/∂data,  w = ∂R/∂t_c,  D = diag(1, 1, 1/k²) on the impact components

The columns of A are finite differences over one standard deviation of each datum: a transition between sticking and
sliding counts if it is within reach of the noise.  κ is wide, because the instant of impact is unknown a priori.  σ_m
is scatter that neither noise nor model explains (`fit`).
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from thesis_lib.critique.likelihood.observations import Observations

INSTANT = 2e-3  # s, κ: the prior of t_c; half a frame at 250 Hz
_H_INSTANT = 1e-4  # s, step for the derivative by the instant of impact


@dataclass(frozen=True)
class Noisy:
    """A statistic of n impacts (n, m), its covariance (n, m, m) due to noise, and its derivative w (n, m) by t_c."""

    value: np.ndarray
    noise: np.ndarray
    by_instant: np.ndarray

    def covariance(self, instant: np.ndarray | float = INSTANT) -> np.ndarray:
        """Covariance S (n, m, m) without σ_m.

        `instant` is κ in s, scalar or (n,): wide if S weights residuals (the instant is then fitted), `t_std` if S is
        used for the size of residuals at the estimated instant.
        """
        w, kappa = self.by_instant, np.broadcast_to(instant, len(self.value))
        return self.noise + kappa[:, None, None] ** 2 * w[:, :, None] * w[:, None, :]


def copies_moved(o: Observations, with_samples: bool) -> Observations:
    """Copies of the impacts, in which one datum at a time is moved up or down by its step; 26 copies in the plane.

    Order: copies with moved data after the impact; two for the instant, as measured and later; copies with moved data
    before the impact.
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
    # a later instant: both arcs continue with their velocity there (not the line's), under gravity
    for side in (0, 1):
        lines, a = o.lines(side), o.rig.fall(o.lines(0)).T
        behind = o.bow[:, side, 1:] * a
        behind[:, o.space.dimension :] *= o.space.is_plane  # in space the lines have the spin at the instant
        change = _H_INSTANT * (o.slope[:, side] - behind)
        value[moves + 1, :, side] = o.space.shift(lines.pose, change.T).T
        slope[moves + 1, :, side] += _H_INSTANT * a
    return copies


def noisy(o: Observations, R: np.ndarray) -> Noisy:
    """Statistic with covariance, from its values R for the `copies_moved`, one after the other."""
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
