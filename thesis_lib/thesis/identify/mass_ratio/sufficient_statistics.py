"""Sufficient statistics of the arcs (ballistic trajectories between impacts) of a drop.

For given impact steps k_1 < ... < k_J, the states without gravity are linear in u = (q_0, v_0, Δv_1 ... Δv_J),
channel by channel (x, y, θ):

    q̃_k = q_0 + h k v_0 + h Σ_j (k - k_j)_+ Δv_j,     ṽ_k = v_0 + Σ_j 1[k > k_j] Δv_j.

Hence χ²(u) = χ²_free + (u - û)' N (u - û) exactly, with N and N û from running sums over the samples.  Links between
channels (a contact point, a contact law) are fitted to û and N, for many sets of steps at once and at a cost that does
not grow with the number of samples.

Source: sufficient statistics of the Gaussian linear model, e.g. S. M. Kay, Fundamentals of Statistical Signal
Processing: Estimation Theory, Prentice Hall 1993, chapters 4 and 5.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ArcStatistics:
    """Sufficient statistics of B hypotheses of J impacts each, per channel x, y, θ (m, rad and per s)."""

    steps: np.ndarray  # (B, J) impact steps k_j, ascending
    u: np.ndarray  # (B, 3, 2+J) best free arcs û
    N: np.ndarray  # (B, 3, 2+J, 2+J) information of the samples on u
    root: np.ndarray  # (B, 3, 2+J, 2+J) R with R'R = N
    chi2_free: np.ndarray  # (B,) χ² of the arcs with free velocity changes

    def take(self, rows: np.ndarray) -> "ArcStatistics":
        """The hypotheses `rows`."""
        return ArcStatistics(*(a[rows] for a in (self.steps, self.u, self.N, self.root, self.chi2_free)))


class ArcSums:
    """Running sums of one drop, for the statistics of any set of impact steps.

    `q`, `v` (m+1, 3) are states without gravity (`segmentation.without_gravity`), `h` the time step in s.
    """

    def __init__(self, h: float, q: np.ndarray, v: np.ndarray):
        self.h, self.q, self.v = h, q, v
        self.m = len(q) - 1
        # a straight line is removed before summing, to limit loss of digits, and added back to û
        self._v0 = v.mean(axis=0)
        self._q0 = (q - h * np.arange(len(q))[:, None] * self._v0).mean(axis=0)
        dq = q - self._q0 - h * np.arange(len(q))[:, None] * self._v0
        dv = v - self._v0
        # after[a] = Σ_{k > a}, a = 0..m;  Σ_{k > a} (k - a) q_k = Σ_{b >= a} Σ_{k > b} q_k
        self._sum_q = _after(dq)
        self._sum_v = _after(dv)
        self._ramp_q = np.cumsum(self._sum_q[::-1], axis=0)[::-1]
        self._all_q, self._all_v = dq.sum(axis=0), dv.sum(axis=0)
        self._squares = np.stack([(dq**2).sum(axis=0), (dv**2).sum(axis=0)])

    def statistics(self, steps: np.ndarray, sigma: np.ndarray) -> ArcStatistics:
        """Return the statistics for impact steps (B, J) and noise `sigma` (2, 3)."""
        steps = np.asarray(steps, dtype=int)
        B, J = steps.shape
        weight_q, weight_v = 1.0 / sigma[0] ** 2, 1.0 / sigma[1] ** 2  # (3,)
        ramp = np.concatenate([np.zeros((B, 1), dtype=int), steps], axis=1)  # (k - a)_+ of v_0 and each Δv_j
        first, last = (np.minimum(ramp[:, :, None], ramp[:, None, :]), np.maximum(ramp[:, :, None], ramp[:, None, :]))
        n = self.m - last
        s1, s2 = n * (n + 1) / 2.0, n * (n + 1) * (2 * n + 1) / 6.0
        position = np.empty((B, J + 2, J + 2))
        position[:, 0, 0] = self.m + 1
        n_own = self.m - ramp
        position[:, 0, 1:] = position[:, 1:, 0] = self.h * n_own * (n_own + 1) / 2.0
        position[:, 1:, 1:] = self.h**2 * (s2 + (last - first) * s1)
        velocity = np.zeros((B, J + 2, J + 2))
        velocity[:, 1:, 1:] = n
        velocity[:, 1, 1] = self.m + 1  # v_0 counts from sample 0, an impact at step k from k + 1
        N = weight_q[:, None, None] * position[:, None] + weight_v[:, None, None] * velocity[:, None]

        b = np.empty((B, 3, J + 2))
        b[:, :, 0] = weight_q * self._all_q
        b[:, :, 1] = weight_q * self.h * self._ramp_q[0] + weight_v * self._all_v
        b[:, :, 2:] = np.moveaxis(weight_q * self.h * self._ramp_q[steps] + weight_v * self._sum_v[steps], 1, 2)
        root = np.swapaxes(np.linalg.cholesky(N), -1, -2)
        u = np.linalg.solve(N, b[..., None])[..., 0]
        total = (self._squares[0] * weight_q + self._squares[1] * weight_v).sum()
        chi2_free = np.maximum(total - np.einsum("bci,bci->b", b, u), 0.0)
        u[:, :, 0] += self._q0
        u[:, :, 1] += self._v0
        return ArcStatistics(steps, u, N, root, chi2_free)

    def residual_spread(self, steps: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Standard deviations (2, 3) of q and v from the free arcs `u` (3, 2+J) with impact steps (J,).

        A channel's 2 + J numbers are fitted to its positions and velocities together; the degrees of freedom are shared
        between both in proportion to their number of samples.
        """
        k = np.arange(self.m + 1)
        ramps = self.h * np.maximum(k[:, None] - steps, 0)
        q = u[:, 0] + self.h * k[:, None] * u[:, 1] + ramps @ u[:, 2:].T
        v = u[:, 1] + (k[:, None] > steps).astype(float) @ u[:, 2:].T
        dof = self.m + 1 - (2 + len(steps)) / 2.0
        return np.sqrt(np.stack([((self.q - q) ** 2).sum(axis=0), ((self.v - v) ** 2).sum(axis=0)]) / dof)


def _after(a: np.ndarray) -> np.ndarray:
    """Sums over all later rows: out[i] = Σ_{k > i} a[k]."""
    return np.concatenate([np.cumsum(a[:0:-1], axis=0)[::-1], np.zeros_like(a[:1])])
