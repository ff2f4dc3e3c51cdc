"""A disk that falls on a table and bounces, in closed form, as a camera sees it."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Disk
from thesis_lib.contact import mirtich
from thesis_lib.contact.space import contact_space
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header

RADIUS, K_G, GRAVITY, RATE = 0.05, 0.0316, 9.81, 240.0
NOISE = (2e-4, 2e-4, 2e-3)  # m, m, rad, one sigma of a sample
LAST = 0.2  # s of the flight after the last bounce


def bouncing(
    epsilon: Sequence[float],
    mu: float,
    rng: np.random.Generator,
    bounces: int = 1,
    angle: bool = True,
    slip: float = 0.4,
) -> tuple[Dataset, float]:
    """A trial for each `epsilon` with so many bounces, and the largest |c_t|/c_n of all of them.

    `slip` in m/s is the most at which a disk is released.  `angle` False: theta was not measured, and disks do not spin
    when they are let go.
    """
    tables, ratios = [], []
    for trial, restitution in enumerate(epsilon):
        spin = rng.uniform(-slip, slip) / RADIUS if angle else 0.0
        q = np.array([0.0, rng.uniform(0.3, 0.5), rng.uniform(-3.0, 3.0)])
        v = np.array([rng.uniform(-slip, slip), 0.0, spin])
        parts, start, first = [], 0.0, 0
        for bounce in range(bounces + 1):
            lasts = (v[1] + np.sqrt(v[1] ** 2 + 2.0 * GRAVITY * max(q[1] - RADIUS, 0.0))) / GRAVITY
            end = start + (lasts if bounce < bounces else LAST)
            t = np.arange(first, int(np.floor(end * RATE)) + 1) / RATE
            first = int(np.floor(end * RATE)) + 1
            parts.append((t, _flown(q, v, t - start)))
            q, v = _flown(q, v, np.array([lasts]))[0], v - [0.0, GRAVITY * lasts, 0.0]
            before, v, start = v, _struck(v, mu, restitution), end
            ratios.append(abs(v[0] - before[0]) / (v[1] - before[1]) if bounce < bounces else 0.0)
        t, poses = np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
        poses = poses + NOISE * rng.standard_normal(poses.shape)
        tables.append(pd.DataFrame({"trial": trial, "t": t, "x": poses[:, 0], "y": poses[:, 1], "theta": poses[:, 2]}))
    table = pd.concat(tables, ignore_index=True)
    header = Header(body=Body(shape=Disk(radius=RADIUS), radius_of_gyration=K_G), rate=RATE, schema=1)
    dataset = Dataset("disk", header, table if angle else table.assign(theta=0.0), has_angle=angle)
    return dataset, max(ratios)


def _flown(q: np.ndarray, v: np.ndarray, t: np.ndarray) -> np.ndarray:
    return q + t[:, None] * v - 0.5 * GRAVITY * t[:, None] ** 2 * [0.0, 1.0, 0.0]


def _struck(v: np.ndarray, mu: float, epsilon: float) -> np.ndarray:
    space = contact_space(v[None], np.array([[0.0, -RADIUS]]), mass=1.0, k_g=K_G)
    with np.errstate(all="ignore"):
        c_t, c_n = (c[0] for c in mirtich.impulse(space, np.array([mu]), np.array([epsilon])))
    return v + [c_t, c_n, RADIUS * c_t / K_G**2]
