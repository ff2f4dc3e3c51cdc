"""Frames in space: change of motions and vectors between the axes of a recording and the axes of a surface.

| on paper | in code    | unit | shape | axes                                                    |
|----------|------------|------|-------|---------------------------------------------------------|
| p_F      | `origin`   | m    | (3,)  | world                                                   |
| R_WF     | `attitude` | 1    | (4,)  | unit quaternion, axes of the frame into those of the world |

A surface has unit axes (t_1, t_2, n): n normal, t_1 along the tangential x_W (y_W if |x_W·n| > 0.9), t_2 = n × t_1.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.mechanics.space import SPACE, conjugate, multiplied, of_rotation_matrix, rotated
from thesis_lib.mechanics.state import State

UPRIGHT = 0.9  # |x_W·n| above which y_W defines the first tangential axis


@dataclass(frozen=True, eq=False)
class Frame:
    """Frame at rest in the world; see the module's table."""

    origin: np.ndarray
    attitude: np.ndarray

    @classmethod
    def of_surface(cls, point: np.ndarray, normal: np.ndarray) -> "Frame":
        """Frame (t_1, t_2, n) of a surface through `point` (3,) in m with a unit normal (3,)."""
        first = np.eye(3)[1 if abs(normal[0]) > UPRIGHT else 0]
        level = first - (first @ normal) * normal
        t_1 = level / np.linalg.norm(level)
        return cls(point, of_rotation_matrix(np.stack([t_1, np.cross(normal, t_1), normal], axis=1)))

    def vectors_in(self, u: np.ndarray) -> np.ndarray:
        """Components in the axes of the frame of vectors (3, n) given in world axes."""
        return rotated(conjugate(self.attitude)[:, None], u)

    def vectors_out(self, u: np.ndarray) -> np.ndarray:
        """Components in world axes of vectors (3, n) given in the axes of the frame."""
        return rotated(self.attitude[:, None], u)

    def seen(self, state: State) -> State:
        """States relative to the frame of bodies given relative to the world."""
        position = self.vectors_in(state.position - self.origin[:, None])
        attitude = multiplied(np.broadcast_to(conjugate(self.attitude)[:, None], state.attitude.shape), state.attitude)
        velocity, spin = self.vectors_in(state.velocity), self.vectors_in(state.spin)
        return state.changed(position, attitude, velocity, spin)

    def shown(self, state: State) -> State:
        """States relative to the world of bodies given relative to the frame; the inverse of `seen`."""
        position = self.vectors_out(state.position) + self.origin[:, None]
        attitude = multiplied(np.broadcast_to(self.attitude[:, None], state.attitude.shape), state.attitude)
        return state.changed(position, attitude, self.vectors_out(state.velocity), self.vectors_out(state.spin))


def on_body(state: State, place: np.ndarray, attitude: np.ndarray) -> State:
    """State of a second frame that is fixed to a first frame whose state is known.

    Args:
        state: poses and motions of the first frame.
        place: (3,) origin of the second frame, in m in the axes of the first.
        attitude: (4,) unit quaternion that rotates the axes of the second frame into the axes of the first.
    """
    r = SPACE.turned(state.attitude, place[:, None])
    turned = multiplied(state.attitude, np.broadcast_to(attitude[:, None], state.attitude.shape))
    velocity = SPACE.velocity_at(state.velocity, state.spin, r)
    return state.changed(state.position + r, turned, velocity)
