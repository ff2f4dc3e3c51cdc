"""Positions, attitudes and their rates just before and after impacts in space, from the samples on either side.

Positions follow from lines through the samples, as in the plane (`datasets/flights/lines.py`).  Attitudes turn too far
for lines: attitude and spin at the impact are fitted with the torque-free motion of the believed body, by Gauss-Newton
steps on its derivatives,

    φ_k = Φ_q(τ_k) δφ + Φ_ω(τ_k) δω,    φ_k the turn from the believed to the measured attitude at τ_k.

Straight lines through rotation vectors err by 0.8, 1.8 and 7 rad/s at 10, 15 and 30 rad/s of a tumbling box (250 Hz,
25 samples of 3 mrad); this fit errs only by the noise, 0.02 rad/s.

| on paper | in code       | unit       | shape           |                                                      |
|----------|---------------|------------|-----------------|------------------------------------------------------|
| q        | `pose`        | m, 1       | (n, W, 7)       | samples: position, and quaternion with the scalar first |
| τ        | `tau`         | s          | (n, W)          | times from the impact                                |
|          | `used`        | 1          | (n, 2, W)       | samples before and after                             |
"""

import numpy as np

from thesis_lib.datasets.flights.lines import SideLines, bows, lines_through, nodes_of, unit_covariance
from thesis_lib.mechanics.free_motion import attitudes, columns
from thesis_lib.mechanics.space import SPACE

ROUNDS = 6  # largest number of steps to the attitude and spin
SETTLED = 1e-7  # rad and rad/s; smaller steps end the iteration; camera noise is a thousand times larger


def fit_windows(
    pose: np.ndarray, tau: np.ndarray, used: np.ndarray, G: np.ndarray, noise: tuple[float, float]
) -> SideLines:
    """Fit both sides of n impacts; arrays as in the module's table.

    Args:
        G: (3, 3) believed inertia per mass in m², axes of the body.
        noise: one sigma of a position in m, and of each component of a small turn in rad.
    """
    n, side = len(tau), used.astype(float)
    lines = lines_through(side, tau, pose[:, :, :3])
    value, slope = np.empty((n, 2, 7)), np.empty((n, 2, 6))
    cov = np.zeros((n, 2, 6, 2, 6, 2))
    value[:, :, :3], slope[:, :, :3] = lines.value, lines.slope
    of_lines = noise[0] ** 2 * unit_covariance(lines)
    for channel in range(3):
        cov[:, :, channel, :, channel] = of_lines
    for s in (0, 1):
        q, spin, of_turns = fit_turning(pose[:, :, 3:], tau, used[:, s], G)
        value[:, s, 3:], slope[:, s, 3:] = q.T, spin.T
        # (δφ, δω) each of three components -> channel, value or slope
        of_turns = noise[1] ** 2 * of_turns.reshape(n, 2, 3, 2, 3)
        cov[:, s, 3:, :, 3:] = of_turns.transpose(0, 2, 1, 4, 3)
    return SideLines(value, slope, bows(side, tau), cov.reshape(n, 2, 12, 12), *nodes_of(side, tau, lines))


def fit_turning(
    attitude: np.ndarray, tau: np.ndarray, used: np.ndarray, G: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Attitude (4, n) and spin (3, n) at time 0, and their covariance (n, 6, 6) for unit noise, of n free flights.

    Args:
        attitude: (n, W, 4) samples at `tau` (n, W) in s; those marked in `used` (n, W) are fitted.
        G: (3, 3) believed inertia per mass in m², axes of the body.
    """
    measured = np.moveaxis(attitude, -1, 0)  # (4, n, W)
    tau = np.where(used, tau, 0.0)  # other samples may belong to another flight
    q, spin, interval = _start(measured, tau, used)
    times, measured = tau.T, np.swapaxes(measured, 1, 2)  # (W, n), (4, W, n)
    weight = used.T.astype(float)
    for _ in range(ROUNDS):
        believed, _ = attitudes(q, spin, G, times)
        left = SPACE.turn_between(believed, measured)  # (3, W, n)
        J = columns(q, spin, G, times)  # (3, 6, W, n)
        normal = np.einsum("kiwn,kjwn,wn->nij", J, J, weight)
        step = np.linalg.solve(normal, np.einsum("kiwn,kwn,wn->ni", J, left, weight)[..., None])[..., 0].T
        step = np.where(np.linalg.norm(spin + step[3:], axis=0) * interval < np.pi, step, 0.0)  # unresolved if faster
        q, spin = SPACE.attitude_after(q, step[:3]), spin + step[3:]
        if np.abs(step).max(initial=0.0) < SETTLED:
            break
    return q / np.sqrt((q * q).sum(axis=0)), spin, np.linalg.inv(normal)


def _start(measured: np.ndarray, tau: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Attitude (4, n) and spin (3, n) at the impact from the two used samples nearest to it, and the time (n,) in s
    between them."""
    bodies = np.arange(len(tau))
    order = np.argsort(np.where(used, np.abs(tau), np.inf), axis=1)
    (t_0, q_0), (t_1, q_1) = ((tau[bodies, at], measured[:, bodies, at]) for at in (order[:, 0], order[:, 1]))
    spin = SPACE.turn_between(q_0, q_1) / (t_1 - t_0)
    return SPACE.attitude_after(q_0, -t_0 * spin), spin, np.abs(t_1 - t_0)


def turns_left(
    fitted: SideLines, side: int, pose: np.ndarray, tau: np.ndarray, used: np.ndarray, G: np.ndarray
) -> np.ndarray:
    """Turns (n, W, 3) in rad from torque-free motion to the attitudes of one side, 0 for samples that are not used;
    arguments as in `fit_windows`."""
    times = np.where(used[:, side], tau, 0.0).T
    believed, _ = attitudes(fitted.value[:, side, 3:].T, fitted.slope[:, side, 3:].T, G, times)
    left = SPACE.turn_between(believed, np.moveaxis(pose[:, :, 3:], -1, 0).swapaxes(1, 2))
    return np.moveaxis(left, 0, -1).swapaxes(0, 1) * used[:, side, :, None]


def turns_off(
    fitted: SideLines, side: int, pose: np.ndarray, tau: np.ndarray, used: np.ndarray, G: np.ndarray
) -> np.ndarray:
    """Sum (n,) in rad² of the squares of `turns_left`."""
    return (turns_left(fitted, side, pose, tau, used, G) ** 2).sum(axis=(1, 2))
