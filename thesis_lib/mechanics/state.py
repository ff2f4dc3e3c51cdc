"""Poses and motions of n bodies, in the plane or in space.

| on paper     | in code                        | unit       | shape             |
|--------------|--------------------------------|------------|-------------------|
| q            | `pose`; rows: `q`              | m, rad     | (d + attitude, n) |
| v            | `motion`; rows: `v`            | m/s, rad/s | (d + turns, n)    |
| x, y, θ      | `x`, `y`, `theta`              | m, rad     | (n,), plane only  |
| v_x, v_y, ω  | `vx`, `vy`, `omega`            | m/s, rad/s | (n,), plane only  |
| i            | `trial`                        | 1          | (n,)              |
| t            | `t`                            | s          | (n,)              |
|              | `surface`                      | 1          | (n,) or None      |
"""

from collections.abc import Sequence

import numpy as np

from thesis_lib.mechanics.space import PLANE, Space, cross

AS_FILMED = -1  # surface of a body that is described in the axes of the recording
# rows of pose (0) and motion (1)
_ROWS = {"x": (0, 0), "y": (0, 1), "theta": (0, 2), "vx": (1, 0), "vy": (1, 1), "omega": (1, 2)}


class State:
    """Poses and motions of n bodies; nothing changes them.

    `trial` numbers releases in the order in which they were made, `t` is the time since the first sample.  Where there
    are several surfaces, `surface` is the number of the one in whose axes the body is described, `AS_FILMED` for those
    of the recording; with a single one it is None.
    """

    __slots__ = ("_cos_sin", "_tile_of", "motion", "pose", "space", "surface", "t", "trial")

    def __init__(
        self,
        pose: np.ndarray,
        motion: np.ndarray,
        trial: np.ndarray,
        t: np.ndarray,
        surface: np.ndarray | None = None,
        space: Space = PLANE,
    ) -> None:
        self.pose, self.motion, self.trial, self.t, self.surface, self.space = pose, motion, trial, t, surface, space
        # in the plane: cos θ and sin θ once they are asked for, and the state and number of copies that have them, too
        self._cos_sin: tuple[np.ndarray, np.ndarray] | None = None
        self._tile_of: tuple[State, int] | None = None

    @classmethod
    def of(
        cls,
        q: np.ndarray,
        v: np.ndarray,
        trial: np.ndarray,
        t: np.ndarray,
        surface: np.ndarray | None = None,
        space: Space = PLANE,
    ) -> "State":
        """The state with poses q (n, ·) and motions v (n, ·), a row for each body."""
        return cls(q.T, v.T, trial, t, surface, space)

    @classmethod
    def planar(cls, x, y, theta, vx, vy, omega, trial, t, surface: np.ndarray | None = None) -> "State":
        """The planar state with these arrays (n,) in m, rad, m/s, rad/s, s."""
        x, y, theta, vx, vy, omega = np.broadcast_arrays(x, y, theta, vx, vy, omega)
        return cls(np.array((x, y, theta)), np.array((vx, vy, omega)), trial, t, surface)

    @classmethod
    def empty(cls, space: Space = PLANE) -> "State":
        """No bodies."""
        none = np.zeros(0)
        return cls(np.zeros((space.poses, 0)), np.zeros((space.motions, 0)), none, none, None, space)

    def __len__(self) -> int:
        return self.pose.shape[1]

    # components -------------------------------------------------------------------------------------------------
    @property
    def position(self) -> np.ndarray:
        """(d, n) in m."""
        return self.pose[: self.space.dimension]

    @property
    def attitude(self) -> np.ndarray:
        """Angle (1, n) in rad, or unit quaternion (4, n)."""
        return self.pose[self.space.dimension :]

    @property
    def velocity(self) -> np.ndarray:
        """(d, n) in m/s."""
        return self.motion[: self.space.dimension]

    @property
    def spin(self) -> np.ndarray:
        """(turns, n) in rad/s, in axes of the world."""
        return self.motion[self.space.dimension :]

    @property
    def height(self) -> np.ndarray:
        """Position along the normal (n,) in m."""
        return self.pose[self.space.dimension - 1]

    @property
    def x(self) -> np.ndarray:
        return self.pose[0]

    @property
    def y(self) -> np.ndarray:
        return self.pose[1]

    @property
    def theta(self) -> np.ndarray:
        return self.pose[2]

    @property
    def vx(self) -> np.ndarray:
        return self.motion[0]

    @property
    def vy(self) -> np.ndarray:
        return self.motion[1]

    @property
    def omega(self) -> np.ndarray:
        return self.motion[2]

    @property
    def q(self) -> np.ndarray:
        """Poses by row (n, d + attitude), a copy."""
        return np.array(self.pose).T

    @property
    def v(self) -> np.ndarray:
        """Motions by row (n, d + turns), a copy."""
        return np.array(self.motion).T

    def turned(self, u: np.ndarray) -> np.ndarray:
        """Vectors u (d, n) or (d, 1) in axes of the bodies, in those of the world."""
        if not self.space.is_plane:
            return self.space.turned(self.attitude, u)
        cos, sin = self._cosine_and_sine()
        return np.array((cos * u[0] - sin * u[1], sin * u[0] + cos * u[1]))

    def _cosine_and_sine(self) -> tuple[np.ndarray, np.ndarray]:
        """cos θ and sin θ (n,), computed once for each pose: they took a tenth of a critique of episodes."""
        if self._cos_sin is None:
            if self._tile_of is not None:
                one, copies = self._tile_of
                cos, sin = one._cosine_and_sine()
                self._cos_sin = np.tile(cos, copies), np.tile(sin, copies)
            else:
                self._cos_sin = np.cos(self.theta), np.sin(self.theta)
        return self._cos_sin

    # other states -----------------------------------------------------------------------------------------------
    def changed(
        self,
        position: np.ndarray | None = None,
        attitude: np.ndarray | None = None,
        velocity: np.ndarray | None = None,
        spin: np.ndarray | None = None,
    ) -> "State":
        """The same state with some of its parts replaced, arrays as the properties give them."""
        first, then = slice(self.space.dimension), slice(self.space.dimension, None)
        parts = ((0, first, position), (0, then, attitude), (1, first, velocity), (1, then, spin))
        return self._with([part for part in parts if part[2] is not None], self.trial, self.t)

    def moved(self, **changes: np.ndarray) -> "State":
        """The same planar state with some of x, y, theta, vx, vy, omega (n,), trial and t replaced."""
        trial, t = changes.pop("trial", self.trial), changes.pop("t", self.t)
        if strange := changes.keys() - _ROWS.keys():
            raise TypeError(f"a planar state has no {strange.pop()!r}")
        return self._with([(*_ROWS[name], array) for name, array in changes.items()], trial, t)

    def _with(self, parts: list, trial: np.ndarray, t: np.ndarray) -> "State":
        """The same state with (0 for pose or 1 for motion, rows, new values) replaced."""
        arrays = [self.pose, self.motion]
        for which in {part[0] for part in parts}:
            arrays[which] = np.array(arrays[which])
        for which, rows, array in parts:
            arrays[which][rows] = array
        pose, motion = arrays
        made = State(pose, motion, trial, t, self.surface, self.space)
        return made._posed_as(self) if pose is self.pose else made

    def shifted(self, change: np.ndarray, faster: np.ndarray) -> "State":
        """The states after small changes of pose and motion by row, each (n, d + turns)."""
        pose = self.space.shift(self.pose, change.T)
        return State(pose, self.motion + faster.T, self.trial, self.t, self.surface, self.space)

    def corrected(self, wanted: "State", found: "State") -> "State":
        """The states moved by what those that are `wanted` have over those that were `found`."""
        motion = self.motion + wanted.motion - found.motion
        if self.space.is_plane:
            return self.with_pose(self.pose + wanted.pose - found.pose).with_motion(motion)
        change = self.space.difference(wanted.pose, found.pose)
        return self.with_pose(self.space.shift(self.pose, change)).with_motion(motion)

    def with_pose(self, pose: np.ndarray) -> "State":
        """The same motions with poses (d + attitude, n)."""
        return State(pose, self.motion, self.trial, self.t, self.surface, self.space)

    def with_motion(self, motion: np.ndarray) -> "State":
        """The same poses with motions (d + turns, n)."""
        return State(self.pose, motion, self.trial, self.t, self.surface, self.space)._posed_as(self)

    def with_velocity(self, v: np.ndarray) -> "State":
        """The same poses with motions by row v (n, d + turns)."""
        return self.with_motion(v.T)

    def flown(self, a: np.ndarray, h: np.ndarray | float) -> "State":
        """The state after times h (n,) in s of constant acceleration by row a (n, d + turns) in m/s², rad/s²."""
        change = h * self.motion + 0.5 * h * h * a.T
        if not self.space.is_plane:  # turns do not commute: the next term of Magnus's series
            d = self.space.dimension
            change[d:] -= h**3 / 12.0 * cross(self.spin, a.T[d:])
        return State(
            self.space.shift(self.pose, change), self.motion + h * a.T, self.trial, self.t + h, self.surface, self.space
        )

    def select(self, rows: np.ndarray | slice) -> "State":
        """The bodies at `rows`."""
        surface = None if self.surface is None else self.surface[rows]
        return State(self.pose[:, rows], self.motion[:, rows], self.trial[rows], self.t[rows], surface, self.space)

    def put(self, rows: np.ndarray, new: "State") -> "State":
        """The same state with the bodies at `rows` replaced by those of `new`."""
        arrays = [np.array(array) for array in (self.pose, self.motion, self.trial, self.t)]
        for array, replacing in zip(arrays, (new.pose, new.motion, new.trial, new.t)):
            array[..., rows] = replacing
        return State(*arrays, self.surface, self.space)

    def tiled(self, copies: int) -> "State":
        """The bodies `copies` times, one set after the other."""
        made = self.joined([self] * copies)
        made._tile_of = self, copies
        return made

    def _posed_as(self, other: "State") -> "State":
        """This state, with what is known of the poses that it shares with the other."""
        self._cos_sin, self._tile_of = other._cos_sin, other._tile_of
        return self

    @staticmethod
    def joined(states: "Sequence[State]") -> "State":
        """The bodies of all states, one after the other."""
        first = states[0]
        surface = None if first.surface is None else np.concatenate([state.surface for state in states])
        parts = [[state.pose, state.motion, state.trial, state.t] for state in states]
        pose, motion, trial, t = (np.concatenate(arrays, axis=-1) for arrays in zip(*parts))
        return State(pose, motion, trial, t, surface, first.space)
