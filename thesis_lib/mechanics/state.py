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

AS_FILMED = -1  # value of `surface` for bodies described in the axes of the recording
# rows of pose (0) and motion (1)
_ROWS = {"x": (0, 0), "y": (0, 1), "theta": (0, 2), "vx": (1, 0), "vy": (1, 1), "omega": (1, 2)}


class State:
    """Poses and motions of n bodies; immutable.

    `trial` numbers releases in the order in which they were made; `t` is the time since the first sample.  `surface` is
    None with a single surface; with several it is the number of the surface in whose axes the body is described, or
    `AS_FILMED` for the axes of the recording.
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
        # in the plane: cos θ and sin θ once computed; the state of which this one holds copies, and their number
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
        """State with poses q (n, ·) and motions v (n, ·), one row per body."""
        return cls(q.T, v.T, trial, t, surface, space)

    @classmethod
    def planar(cls, x, y, theta, vx, vy, omega, trial, t, surface: np.ndarray | None = None) -> "State":
        """Planar state with the given arrays (n,) in m, rad, m/s, rad/s, s."""
        x, y, theta, vx, vy, omega = np.broadcast_arrays(x, y, theta, vx, vy, omega)
        return cls(np.array((x, y, theta)), np.array((vx, vy, omega)), trial, t, surface)

    @classmethod
    def empty(cls, space: Space = PLANE) -> "State":
        """State without bodies."""
        none = np.zeros(0)
        return cls(np.zeros((space.poses, 0)), np.zeros((space.motions, 0)), none, none, None, space)

    def __len__(self) -> int:
        return self.pose.shape[1]

    # components -------------------------------------------------------------------------------------------------
    @property
    def position(self) -> np.ndarray:
        """Position (d, n) in m."""
        return self.pose[: self.space.dimension]

    @property
    def attitude(self) -> np.ndarray:
        """Angle (1, n) in rad, or unit quaternion (4, n)."""
        return self.pose[self.space.dimension :]

    @property
    def velocity(self) -> np.ndarray:
        """Velocity (d, n) in m/s."""
        return self.motion[: self.space.dimension]

    @property
    def spin(self) -> np.ndarray:
        """Angular velocity (turns, n) in rad/s, in world axes."""
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
        """Copy of the poses, one row per body (n, d + attitude)."""
        return np.array(self.pose).T

    @property
    def v(self) -> np.ndarray:
        """Copy of the motions, one row per body (n, d + turns)."""
        return np.array(self.motion).T

    def turned(self, u: np.ndarray) -> np.ndarray:
        """Components in world axes of vectors u (d, n) or (d, 1) given in the axes of the bodies."""
        if not self.space.is_plane:
            return self.space.turned(self.attitude, u)
        cos, sin = self._cosine_and_sine()
        return np.array((cos * u[0] - sin * u[1], sin * u[0] + cos * u[1]))

    def _cosine_and_sine(self) -> tuple[np.ndarray, np.ndarray]:
        """cos θ and sin θ (n,), computed once per pose: they took a tenth of the time of a critique of episodes."""
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
        """Copy with the given parts replaced; the arrays have the shapes of the properties."""
        first, then = slice(self.space.dimension), slice(self.space.dimension, None)
        parts = ((0, first, position), (0, then, attitude), (1, first, velocity), (1, then, spin))
        return self._with([part for part in parts if part[2] is not None], self.trial, self.t)

    def moved(self, **changes: np.ndarray) -> "State":
        """Copy of a planar state with some of x, y, theta, vx, vy, omega (n,), trial and t replaced."""
        trial, t = changes.pop("trial", self.trial), changes.pop("t", self.t)
        if strange := changes.keys() - _ROWS.keys():
            raise TypeError(f"a planar state does not have the component {strange.pop()!r}")
        return self._with([(*_ROWS[name], array) for name, array in changes.items()], trial, t)

    def _with(self, parts: list, trial: np.ndarray, t: np.ndarray) -> "State":
        """Copy with the `parts` (0 for pose or 1 for motion, rows, new values) replaced."""
        arrays = [self.pose, self.motion]
        for which in {part[0] for part in parts}:
            arrays[which] = np.array(arrays[which])
        for which, rows, array in parts:
            arrays[which][rows] = array
        pose, motion = arrays
        made = State(pose, motion, trial, t, self.surface, self.space)
        return made._posed_as(self) if pose is self.pose else made

    def shifted(self, change: np.ndarray, faster: np.ndarray) -> "State":
        """States after small changes of pose and motion, each (n, d + turns), one row per body."""
        pose = self.space.shift(self.pose, change.T)
        return State(pose, self.motion + faster.T, self.trial, self.t, self.surface, self.space)

    def corrected(self, wanted: "State", found: "State") -> "State":
        """States moved by the difference of the states `wanted` from the states `found`."""
        motion = self.motion + wanted.motion - found.motion
        if self.space.is_plane:
            return self.with_pose(self.pose + wanted.pose - found.pose).with_motion(motion)
        change = self.space.difference(wanted.pose, found.pose)
        return self.with_pose(self.space.shift(self.pose, change)).with_motion(motion)

    def with_pose(self, pose: np.ndarray) -> "State":
        """Copy with the poses replaced by (d + attitude, n)."""
        return State(pose, self.motion, self.trial, self.t, self.surface, self.space)

    def with_motion(self, motion: np.ndarray) -> "State":
        """Copy with the motions replaced by (d + turns, n)."""
        return State(self.pose, motion, self.trial, self.t, self.surface, self.space)._posed_as(self)

    def with_velocity(self, v: np.ndarray) -> "State":
        """Copy with the motions replaced by v (n, d + turns), one row per body."""
        return self.with_motion(v.T)

    def flown(self, a: np.ndarray, h: np.ndarray | float) -> "State":
        """State after times h (n,) in s of constant accelerations a (n, d + turns) in m/s², rad/s²."""
        change = h * self.motion + 0.5 * h * h * a.T
        if not self.space.is_plane:  # turns do not commute: the next term of the Magnus series
            d = self.space.dimension
            change[d:] -= h**3 / 12.0 * cross(self.spin, a.T[d:])
        return State(
            self.space.shift(self.pose, change), self.motion + h * a.T, self.trial, self.t + h, self.surface, self.space
        )

    def select(self, rows: np.ndarray | slice) -> "State":
        """State of the bodies at `rows`."""
        surface = None if self.surface is None else self.surface[rows]
        return State(self.pose[:, rows], self.motion[:, rows], self.trial[rows], self.t[rows], surface, self.space)

    def put(self, rows: np.ndarray, new: "State") -> "State":
        """Copy with the bodies at `rows` replaced by the bodies of `new`."""
        arrays = [np.array(array) for array in (self.pose, self.motion, self.trial, self.t)]
        for array, replacing in zip(arrays, (new.pose, new.motion, new.trial, new.t)):
            array[..., rows] = replacing
        return State(*arrays, self.surface, self.space)

    def tiled(self, copies: int) -> "State":
        """State with the bodies repeated `copies` times, one set after the other."""
        made = self.joined([self] * copies)
        made._tile_of = self, copies
        return made

    def _posed_as(self, other: "State") -> "State":
        """This state, with the cached values of the poses that it shares with the other state."""
        self._cos_sin, self._tile_of = other._cos_sin, other._tile_of
        return self

    @staticmethod
    def joined(states: "Sequence[State]") -> "State":
        """State with the bodies of all states, one after the other."""
        first = states[0]
        surface = None if first.surface is None else np.concatenate([state.surface for state in states])
        parts = [[state.pose, state.motion, state.trial, state.t] for state in states]
        pose, motion, trial, t = (np.concatenate(arrays, axis=-1) for arrays in zip(*parts))
        return State(pose, motion, trial, t, surface, first.space)
