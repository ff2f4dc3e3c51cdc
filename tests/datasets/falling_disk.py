"""Drops of a disk in small time steps, for tests of flights in air and of contacts that are not impacts.

All trials move at once; the contact is an impulse with restitution, or a spring with a damper.  Nothing of thesis_lib
is used but the header and the dataset.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header

GRAVITY = 9.81
RADIUS, K_G = 0.05, 0.0316
STEPS = 40  # from sample to sample
Contact = Callable[[np.ndarray, np.ndarray, float], None]  # changes q, v (n, 3) in place, in a step of dt s


def header(rate: float, gyration: float = K_G) -> Header:
    shape = {"kind": "disk", "radius": RADIUS}
    return Header.model_validate({"schema": 1, "body": {"shape": shape, "radius_of_gyration": gyration}, "rate": rate})


def released(trials: int, rng: np.random.Generator, height: tuple, speed: tuple, spin: float) -> tuple:
    """States q, v (n, 3) at random heights of the lowest point in m, sideways speeds in m/s and spins in rad/s."""
    q, v = np.zeros((trials, 3)), np.zeros((trials, 3))
    q[:, 1] = RADIUS + rng.uniform(*height, trials)
    v[:, 0], v[:, 2] = rng.uniform(*speed, trials), rng.uniform(-spin, spin, trials)
    return q, v


def bounces(epsilon: float, mu: float, slowest: float = 0.0) -> Contact:
    """Restitution `epsilon` above the speed `slowest`, 0 below it, with friction that never reverses the slip."""

    def contact(q: np.ndarray, v: np.ndarray, dt: float) -> None:
        hits = (q[:, 1] < RADIUS) & (v[:, 1] < 0.0)
        # back to the instant of the touch, where the velocity changes
        depth = RADIUS - q[hits, 1]
        v_n = -np.sqrt(np.maximum(v[hits, 1] ** 2 - 2.0 * GRAVITY * depth, 0.0))
        e = np.where(-v_n > slowest, epsilon, 0.0)
        slip = v[hits, 0] + RADIUS * v[hits, 2]
        push = -(1.0 + e) * v_n
        c_t = -np.clip(slip / (1.0 + (RADIUS / K_G) ** 2), -mu * push, mu * push)
        late = np.divide(depth, -v_n, out=np.zeros_like(depth), where=v_n < 0.0)
        q[hits, 0] += c_t * late
        q[hits, 1] = RADIUS - e * v_n * late
        v[hits, 0] += c_t
        v[hits, 1] = -e * v_n - GRAVITY * late * (e > 0.0)
        v[hits, 2] += c_t * RADIUS / K_G**2

    return contact


def spring(duration: float, damping: float) -> Contact:
    """A contact that lasts about `duration` (s), with a damper of `damping` (1/s) on unit mass."""

    def contact(q: np.ndarray, v: np.ndarray, dt: float) -> None:
        depth = np.maximum(RADIUS - q[:, 1], 0.0)
        v[:, 1] += np.maximum((np.pi / duration) ** 2 * depth - damping * v[:, 1], 0.0) * (depth > 0.0) * dt

    return contact


def once_a_step(q: np.ndarray, v: np.ndarray, dt: float) -> None:
    """The velocity is reversed when the next step would sink in: at any gap up to v_n dt, and with that of the step."""
    v[:, 1] = np.where((q[:, 1] + v[:, 1] * dt < RADIUS) & (v[:, 1] < 0.0), -v[:, 1], v[:, 1])


def drops(
    state: tuple[np.ndarray, np.ndarray],
    contact: Contact,
    *,
    rate: float,
    duration: float,
    rng: np.random.Generator,
    air: Callable[[np.ndarray], np.ndarray] = lambda v: 0.0 * v,
    noise: tuple = (3e-4, 3e-4, 3e-3),
    steps: int = STEPS,
    has_angle: bool = True,
) -> Dataset:
    """Samples of the motions that begin in `state`; `air` (n, 3) is the acceleration by v (n, 3) beside gravity."""
    (q, v), dt = state, 1.0 / rate / steps
    path = []
    for _ in range(int(duration * rate)):
        path.append(q.copy())
        for _ in range(steps):
            a = air(v) - [0.0, GRAVITY, 0.0]
            if contact is once_a_step:  # as the simulators do that look for contacts so
                v += a * dt
                contact(q, v, dt)
                q += v * dt
            else:
                q += v * dt + 0.5 * a * dt**2
                v += 0.5 * (a + air(v + a * dt) - [0.0, GRAVITY, 0.0]) * dt
                contact(q, v, dt)
    poses = np.stack(path, axis=1)
    poses = poses + rng.standard_normal(poses.shape) * np.array(noise) * [1.0, 1.0, float(has_angle)]
    poses[..., 2] *= has_angle
    n, samples = poses.shape[:2]
    table = pd.DataFrame(poses.reshape(-1, 3), columns=["x", "y", "theta"])
    table.insert(0, "t", np.tile(np.arange(samples) / rate, n))
    table.insert(0, "trial", np.repeat(np.arange(n), samples))
    return Dataset("disk", header(rate), table, has_angle=has_angle)


def drag(c_q: float = 0.0, c_v: float = 0.0, k_m: float = 0.0) -> Callable[[np.ndarray], np.ndarray]:
    """Acceleration (n, 3) by v (n, 3): quadratic and linear drag, and the lift of a spin."""

    def acceleration(v: np.ndarray) -> np.ndarray:
        along = c_v + c_q * np.hypot(v[:, 0], v[:, 1])
        across = k_m * v[:, 2]
        return np.stack([-along * v[:, 0] - across * v[:, 1], -along * v[:, 1] + across * v[:, 0], 0.0 * along], axis=1)

    return acceleration


def light_balls(rate: float = 143.0, spin: float = 0.0, has_angle: bool = False, **air: float) -> Dataset:
    """45 fast throws in air, as `drag` says, with a bounce each."""
    rng = np.random.default_rng(0)
    state, noise = released(45, rng, (0.3, 0.42), (4.0, 8.0), spin), (5e-4, 5e-4, 5e-3)
    more = {"air": drag(**air), "noise": noise, "has_angle": has_angle}
    return drops(state, bounces(0.9, 0.25), rate=rate, duration=0.5, rng=rng, **more)


def damped(c_v: float, trials: int = 16, rate: float = 120.0, duration: float = 2.0) -> Dataset:
    """Long flights with linear drag."""
    rng = np.random.default_rng(1)
    state = released(trials, rng, (2.0, 4.0), (-0.5, 0.5), 2.0)
    return drops(state, bounces(0.95, 0.1), rate=rate, duration=duration, rng=rng, air=drag(c_v=c_v), steps=20)


def stopping(slowest: float, rate: float = 120.0, epsilon: float = 0.5) -> Dataset:
    """Hits below the speed `slowest` (m/s) do not rebound."""
    rng = np.random.default_rng(2)
    state = released(30, rng, (0.05, 0.45), (-0.2, 0.2), 5.0)
    return drops(state, bounces(epsilon, 0.2, slowest), rate=rate, duration=1.2, rng=rng)


def soft(duration: float, rate: float, heights: tuple = (0.2, 0.8)) -> Dataset:
    """Contacts that last about `duration` (s)."""
    rng = np.random.default_rng(3)
    state, noise = released(20, rng, heights, (-0.3, 0.3), 4.0), (1e-4, 1e-4, 1e-3)
    return drops(state, spring(duration, 0.2 / duration), rate=rate, duration=1.5, rng=rng, noise=noise)


def growing(rate: float, steps: int) -> Dataset:
    """A simulation that looks for contacts `steps` times a sample, and gains energy by it."""
    rng = np.random.default_rng(4)
    state, noise = released(16, rng, (1.5, 4.0), (-0.5, 0.5), 2.0), (1e-4, 1e-4, 1e-4)
    return drops(state, once_a_step, rate=rate, duration=3.0, rng=rng, noise=noise, steps=steps)
