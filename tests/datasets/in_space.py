"""Recordings in space of simulated drops: one long take, a tilted plane, a hand between drops, noise, lost samples."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation, Slerp

from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, SQUARE, CompliantContact, HiddenCauses

RATE = 250.0
UP = {"x": np.eye(3)[0], "y": np.eye(3)[1], "z": np.eye(3)[2]}
HOLD, CARRY = 0.3, 1.2  # s for which the hand holds the body still, and carries it to the next drop
BODIES = {"ellipse": ELLIPSE_BODY, "square": SQUARE}


@dataclass(frozen=True, eq=False)
class Take:
    """A recording: t (n,) s, position (n, 3) m, rotation body -> recording (n), number of the drop (-1: none)."""

    t: np.ndarray
    position: np.ndarray
    rotation: Rotation
    drop: np.ndarray
    planar: np.ndarray  # x, y, theta (n, 3) in the plane, NaN between drops
    axes: np.ndarray  # (3, 3) rows: x, y and normal of the plane in the recording

    @property
    def quaternion(self) -> np.ndarray:
        """(n, 4), x y z w."""
        return self.rotation.as_quat()

    def lose(self, share: float) -> np.ndarray:
        """Samples (n,) that the cameras lost: runs of one to six."""
        rng, lost = np.random.default_rng(5), np.zeros(len(self.t), dtype=bool)
        for start in rng.choice(len(self.t), int(share * len(self.t) / 3.5), replace=False):
            lost[start : start + rng.integers(1, 7)] = True
        return lost


def plane_axes(up: str = "z", yaw: float = 35.0, tilt: float = 4.0) -> np.ndarray:
    """x, y and normal (3, 3) of a plane turned by `yaw` about the axis that is up, and `tilt` off it (degrees)."""
    vertical = UP[up]
    first = UP["x" if up != "x" else "y"]
    second = np.cross(vertical, first)
    along = np.cos(np.radians(yaw)) * first + np.sin(np.radians(yaw)) * second
    lean = Rotation.from_rotvec(np.radians(tilt) * along)
    y = lean.apply(vertical)
    return np.stack([along, y, np.cross(along, y)])


@cache
def simulated(
    drops: int, shape: str, tilt: float, seed: int, rate: float, duration: float, hidden: HiddenCauses | None
) -> pd.DataFrame:
    """Trajectories without noise, under the gravity of a plane `tilt` degrees off the vertical."""
    made = simulate_compliant_drops(
        BODIES[shape],
        PROOF_RELEASE,
        drops,
        gravity=9.81 * np.cos(np.radians(tilt)),
        contact=CompliantContact(),
        hidden=hidden,
        rate=rate,
        duration=duration,
        rng=np.random.default_rng(seed),
    )
    assert made.trajectories is not None
    return made.trajectories


def take(
    drops: int = 12,
    *,
    shape: str = "ellipse",
    axes: np.ndarray | None = None,
    tilt: float = 4.0,
    up: str = "z",
    seed: int = 0,
    noise: float = 1.0,
    mount: Rotation | None = None,
    tumbling: tuple[int, ...] = (),
    hidden: HiddenCauses | None = None,
    rate: float = RATE,
    duration: float = 0.9,
) -> Take:
    """One long take of `drops`, carried by a hand from where one ends to where the next begins.

    Noise is 0.2 mm and 2 mrad about each axis, times `noise`.  `mount` turns the body's shape into its tracked frame;
    by default the shape's axes are the frame's x and y.  The drops `tumbling` turn about an axis in the plane, too.
    """
    axes = plane_axes(up, tilt=tilt) if axes is None else axes
    rng = np.random.default_rng(seed)
    planar = simulated(drops, shape, tilt, seed, rate, duration, hidden)
    frame = Rotation.from_matrix(axes.T)  # columns: the plane's axes
    mount = mount or Rotation.identity()
    poses, turns, flat, which = [], [], [], []
    held, nan = int(HOLD * rate), np.full((1, 3), np.nan)

    def add(p: np.ndarray, r: Rotation, q: np.ndarray, number: int) -> None:
        poses.append(p)
        turns.append(r.as_quat())
        flat.append(q)
        which.append(np.full(len(p), number))

    def hold(p: np.ndarray, r: Rotation) -> None:
        turn = Rotation.from_quat(np.repeat(r.as_quat(), held, 0))
        add(np.repeat(p, held, 0), turn, np.repeat(nan, held, 0), -1)

    for number, drop in planar.groupby("trial"):
        q = drop[["x", "y", "theta"]].to_numpy()
        angle = np.zeros((len(q), 3))
        angle[:, 2] = q[:, 2]
        turn = Rotation.from_rotvec(angle)
        if number in tumbling:
            turn = Rotation.from_rotvec(np.outer(np.arange(len(q)) / rate * 20.0, [1.0, 0.0, 0.0])) * turn
        p, r = q[:, :2] @ axes[:2], frame * turn * mount
        if poses:
            ends = Rotation.from_quat([turns[-1][-1], r[0].as_quat()])
            s = np.linspace(0.0, 1.0, int(CARRY * rate))
            smooth = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            aside = np.sin(np.pi * smooth)[:, None] * np.array([0.2, -0.15, 0.12])
            path = poses[-1][-1] + smooth[:, None] * (p[0] - poses[-1][-1]) + aside
            wiggle = Rotation.from_rotvec(np.outer(np.sin(np.pi * smooth), [0.8, 0.5, -0.6]))
            add(path, wiggle * Slerp([0.0, 1.0], ends)(smooth), np.repeat(nan, len(s), 0), -1)
        hold(p[:1], r[:1])
        add(p, r, q, int(number))
        hold(p[-1:], r[-1:])
    position = np.concatenate(poses)
    n = len(position)
    position = position + noise * 2e-4 * rng.standard_normal((n, 3))
    jitter = Rotation.from_rotvec(noise * 2e-3 * rng.standard_normal((n, 3)))
    rotation = jitter * Rotation.from_quat(np.concatenate(turns))
    return Take(np.arange(n) / rate, position, rotation, np.concatenate(which), np.concatenate(flat), axes)
