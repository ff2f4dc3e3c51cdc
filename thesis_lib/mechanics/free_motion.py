"""Free flight of n rigid bodies in space: parabolic path, and Euler's motion without torque.

The angular momentum per mass L = R G Rᵀ ω is constant; therefore only the attitude is integrated,

    Ṙ = [ω] R,    ω = W L,    W = R G⁻¹ Rᵀ,

by consecutive power series in time (`turning.py`).  Small changes φ of the attitude, dω₀ of the initial spin and dL of
the momentum obey

    φ̇ = W (dL + L × φ),    dL = R₀ G R₀ᵀ dω₀,

and are also given by power series.  A turn of the initial attitude *and* spin turns the whole motion: the derivatives
with respect to the initial attitude are 1 + Φ [ω₀], where Φ are those with respect to the initial spin.

| on paper | in code | unit       | shape               |                                                     |
|----------|---------|------------|---------------------|-----------------------------------------------------|
| q₀       | `pose`  | m, 1       | (7, n)              | pose at time 0                                      |
| v₀       | `motion`| m/s, rad/s | (6, n)              | velocity and spin at time 0, axes of the world      |
| G        | `G`     | m²         | as in `inertia`     | inertia per mass, axes of the body                  |
| a        | `a`     | m/s²       | (3, n) or (3, 1)    | acceleration, gravity for example                   |
| τ        | `tau`   | s          | (k, n), (k, 1), (k,)| times, in any order, of either sign                 |

Sources: Goldstein, Classical Mechanics, chapter 5 (torque-free motion); Hairer, Nørsett and Wanner, Solving Ordinary
Differential Equations I (Taylor series whose coefficients follow by recursion).
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from thesis_lib.mechanics.space import cross

STEP = 0.6  # turn in rad per series; error about 1e-10 rad, relatively as much in the derivatives
KEPT = 8  # number of cached results
MOST_STEPS = 10_000  # a longer turn indicates an error in the data


class Flight(NamedTuple):
    """Poses (7, k, n) and motions (6, k, n) of n bodies at k times."""

    pose: np.ndarray
    motion: np.ndarray


def attitudes(
    attitude: np.ndarray, spin: np.ndarray, G: np.ndarray, tau: np.ndarray, step: float = STEP
) -> tuple[np.ndarray, np.ndarray]:
    """Attitudes (4, k, n) and spins (3, k, n) in rad/s at times `tau` of torque-free motion in space.

    Args:
        attitude: (4, n) unit quaternions at time 0.
        spin: (3, n) rad/s at time 0, world axes.
        G: (3, 3) or (3, 3, n) inertia per mass in m², axes of the body.
        tau: (k, n), (k, 1) or (k,) in s; the results are NaN where `tau` is not finite.
        step: turn in rad covered by one series.

    Raises:
        ValueError: a body turns by more than `MOST_STEPS` of these steps.
    """
    q, spins, _ = _integrated(attitude, spin, G, _grid(tau, attitude.shape[1]), step)
    return q, spins


def spin_rate(attitude: np.ndarray, spin: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Angular acceleration (3, n) in rad/s² of torque-free bodies in space; arguments as in `attitudes`."""
    from thesis_lib.mechanics.turning import spins_up

    each, rate = _by_body(G), np.empty(spin.shape)
    spins_up(attitude, spin, each, _inverse(each.shape, each.tobytes())[0], rate)
    return rate


def _by_body(G: np.ndarray) -> np.ndarray:
    """Inertia G (3, 3) or (3, 3, n) reshaped to (1 or n, 3, 3)."""
    return np.ascontiguousarray(np.reshape(G, (9, -1)).T, float).reshape(-1, 3, 3)


def flown(pose: np.ndarray, motion: np.ndarray, G: np.ndarray, a: np.ndarray, tau: np.ndarray) -> Flight:
    """Poses and motions at times `tau` under constant acceleration and without torque; see the module's table.

    Raises:
        ValueError: as `attitudes`.
    """
    tau = _grid(tau, pose.shape[1])
    v, a = motion[:3, None], np.asarray(a)[:, None]
    place, velocity = pose[:3, None] + tau * (v + 0.5 * tau * a), v + tau * a
    turned, spin = attitudes(pose[3:], motion[3:], G, tau)
    return Flight(np.concatenate([place, turned]), np.concatenate([velocity, spin]))


def columns(attitude: np.ndarray, spin: np.ndarray, G: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Derivatives (3, 6, k, n) of the attitude at times `tau` by initial attitude and spin; arguments as `attitudes`.

    Raises:
        ValueError: as `attitudes`.
    """
    *_, by_spin = _integrated(attitude, spin, G, _grid(tau, attitude.shape[1]), STEP, with_columns=True)
    # Φ [ω₀] has the rows Φ_i × ω₀
    by_attitude = cross(by_spin.swapaxes(0, 1), spin[:, None, None]).swapaxes(0, 1)
    by_attitude[[0, 1, 2], [0, 1, 2]] += 1.0
    return np.concatenate([by_attitude, by_spin], axis=1)


def _integrated(
    q: np.ndarray, spin: np.ndarray, G: np.ndarray, tau: np.ndarray, step: float, with_columns: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Attitudes (4, k, n), spins (3, k, n), and derivatives Φ (3, 3, k, n) of the attitudes, else (3, 0, k, n).

    The last few results are cached, because a fit requests the same turns in each of its steps.
    """
    parts = q, spin, _by_body(G), tau
    shapes = tuple(part.shape for part in parts)
    return _kept(shapes, *(np.asarray(part, float).tobytes() for part in parts), step, with_columns)


@lru_cache(maxsize=KEPT)
def _kept(shapes: tuple, q: bytes, spin: bytes, G: bytes, tau: bytes, step: float, with_columns: bool):
    from thesis_lib.mechanics.turning import follow

    attitude, omega, each, times = (
        np.frombuffer(part).reshape(shape) for part, shape in zip((q, spin, G, tau), shapes)
    )
    found = np.empty((4, *times.shape)), np.empty((3, *times.shape)), np.empty((3, 3 * with_columns, *times.shape))
    most = MOST_STEPS * step
    if follow(attitude, omega, each, *_inverse(shapes[2], G), times, step, most, *found) > most:
        raise ValueError(f"a flight turns by more than {most:.3g} rad; check the spins and times")
    for array in found:
        array.flags.writeable = False
    return found


@lru_cache(maxsize=KEPT)
def _inverse(shape: tuple, G: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Inverse inertia G⁻¹ (n, 3, 3) and its largest eigenvalue (n,)."""
    inverse = np.linalg.inv(np.frombuffer(G).reshape(shape))
    return inverse, np.linalg.eigvalsh(inverse)[:, -1]


def _grid(tau: np.ndarray, n: int) -> np.ndarray:
    """Times (k, n), (k, 1) or (k,) broadcast to (k, n)."""
    tau = np.asarray(tau, dtype=float)
    if tau.shape == (len(tau), n):
        return tau
    return np.broadcast_to(tau[:, None] if tau.ndim == 1 else tau, (len(tau), n))
