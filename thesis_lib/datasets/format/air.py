"""Aerodynamic forces on a body in flight, as seen in its samples: drag along the velocity, lift across it.

    a = −(c_v + c_q |v|) v + (c_l |v| + k_m ω) (−v_y, v_x)

| on paper | in code | unit | shape |                                                  |
|----------|---------|------|-------|--------------------------------------------------|
| c_v      | `c_v`   | 1/s  |       | linear drag                                      |
| c_q      | `c_q`   | 1/m  |       | quadratic drag                                   |
| c_l      | `c_l`   | 1/m  |       | lift of a body whose spin is not measured        |
| k_m      | `k_m`   | 1    |       | lift of a measured spin ω, the Magnus effect     |

The rotation is not affected.  The air contributes ∬ a dt dt to a path q(t).  This needs no derivative of noisy samples:
∫ v dt = q, and ∫ |v| v dt is a sum over the steps between samples.
"""

from dataclasses import dataclass

import numpy as np

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS  # on [0, 1]


@dataclass(frozen=True)
class Air:
    """Coefficients of the table; `scatter` is one sigma in m/s² of further accelerations, e.g. from unmeasured spin."""

    c_v: float = 0.0
    c_q: float = 0.0
    c_l: float = 0.0
    k_m: float = 0.0
    scatter: float = 0.0

    def acceleration(self, v: np.ndarray) -> np.ndarray:
        """Acceleration a (..., 3) in m/s², m/s², rad/s² at velocities `v` (..., 3)."""
        speed = np.hypot(v[..., 0], v[..., 1])
        along, across = self.c_v + self.c_q * speed, self.c_l * speed + self.k_m * v[..., 2]
        x, y = v[..., 0], v[..., 1]
        return np.stack([-along * x - across * y, -along * y + across * x, np.zeros_like(x)], axis=-1)

    def slope(self, v: np.ndarray) -> np.ndarray:
        """Derivative ∂a/∂v (..., 3, 3) at velocities `v` (..., 3); the last index is that of v."""
        x, y = v[..., 0], v[..., 1]
        speed = np.maximum(np.hypot(x, y), 1e-9)
        along, across, none = self.c_v + self.c_q * speed, self.c_l * speed + self.k_m * v[..., 2], np.zeros_like(x)
        q, l = self.c_q / speed, self.c_l / speed
        rows = (
            (-along - q * x * x - l * x * y, -across - q * x * y - l * y * y, -self.k_m * y),
            (across - q * x * y + l * x * x, -along - q * y * y + l * x * y, self.k_m * x),
            (none, none, none),
        )
        return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)

    def made(self, t: np.ndarray, q: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """Displacement ∬ a dt dt (N, 3) of samples q (N, 3) at times t (N,) in s; motions begin at indices `starts`."""
        step, dq = np.diff(t, prepend=t[:1]), np.diff(q, axis=0, prepend=q[:1])
        step[starts], dq[starts] = 0.0, 0.0
        v = dq / np.where(step > 0.0, step, 1.0)[:, None]
        gained = _sums(self.acceleration(v) * step[:, None], starts)
        before = np.concatenate([np.zeros((1, 3)), gained[:-1]])[: len(t)]
        before[starts] = 0.0
        return _sums(0.5 * (gained + before) * step[:, None], starts)

    def beyond(self, tau: np.ndarray, v_pre: np.ndarray, v_post: np.ndarray, gravity: float) -> np.ndarray:
        """Deviations (n, W, 3) of paths from v τ − g τ²/2 by the air, at times `tau` (n, W) in s after n impacts; from
        the velocities (n, 3) just before and after, to second order in the air: ∫₀^τ (τ − s) a(v(s)) ds."""
        v = np.where((tau < 0.0)[..., None], v_pre[:, None], v_post[:, None])
        whole = self.acceleration(v) - np.array([0.0, gravity, 0.0])
        jerk = np.einsum("nwij,nwj->nwi", self.slope(v), whole)
        path = np.zeros_like(v)
        for node, weight in zip(_NODES, _WEIGHTS):
            s = (node * tau)[..., None]
            path += weight * (1.0 - node) * self.acceleration(v + whole * s + 0.5 * jerk * s * s)
        return path * (tau * tau)[..., None]


@dataclass(frozen=True)
class AirInSpace(Air):
    """Drag only, for a body whose samples q (N, 3) are positions in space."""

    def acceleration(self, v: np.ndarray) -> np.ndarray:
        """Acceleration a (..., 3) in m/s² at velocities `v` (..., 3)."""
        return -(self.c_v + self.c_q * np.linalg.norm(v, axis=-1, keepdims=True)) * v


def _sums(steps: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Cumulative sums (N, 3) of `steps` (N, 3), from 0 at each of the indices `starts`."""
    total = np.cumsum(steps, axis=0)
    return total - np.repeat(total[starts], np.diff(np.append(starts, len(steps))), axis=0)
