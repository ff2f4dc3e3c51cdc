"""Straight walls around a motion in a plane, and the frame of a wall, in which the wall is a floor.

A wall is the line through `point` across `normal`; the body moves on the side to which the normal n points.  Rotated by
−α, with α the angle of n from the direction +y, the wall is level and the body above it:

    t = (n_y, −n_x),    q ← ((p − point)·t, (p − point)·n, θ − α),    v ← (v·t, v·n, ω)

All relations for a floor then hold for the wall, except that gravity acts along −g (sin α, cos α).  x is the position
along the wall from its `point`; the number of the wall is kept beside the pose, as the number of the surface.

| on paper | in code | unit | shape  |                                                        |
|----------|---------|------|--------|--------------------------------------------------------|
| q, v     | `q`, `v` | m, rad; m/s, rad/s | (n, 3) | pose and velocity                       |
| i        | `wall`  | 1    | (n,)   | number of the wall, from 0, in the order of dataset.yaml |
"""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.bodies.shapes import Coordinate, Shape
from thesis_lib.foundation.settings import Section

FARTHEST = 40.0  # m from the origin to a point of a surface; no rig is larger
SurfaceName = Annotated[str, Field(pattern="^[a-z][a-z0-9_]{0,19}$", description="lower-case letters, digits and _")]
OUT_OF_REACH = 1e3  # m, more than any gap: added for a wall that cannot have pushed the body
MOST = 50


class Wall(Section):
    """A straight wall."""

    name: SurfaceName
    point: tuple[Coordinate, Coordinate] = Field(description="m, any point of the wall's line")
    normal: tuple[Coordinate, Coordinate] = Field(
        description="direction from the wall towards the body, of any length above 0"
    )

    @model_validator(mode="after")
    def _has_a_direction(self) -> "Wall":
        if not 1e-9 < math.hypot(*self.normal) < 1e9:
            raise ValueError("the normal has no direction")
        if math.hypot(*self.point) > FARTHEST:
            raise ValueError(f"the wall is more than {FARTHEST:g} m from the origin: millimetres?")
        return self

    @property
    def n(self) -> np.ndarray:
        """The normal (2,), of length 1."""
        return np.array(self.normal) / math.hypot(*self.normal)

    @property
    def angle(self) -> float:
        """α in rad, by which the wall is rotated from a floor, counter-clockwise."""
        return math.atan2(-self.normal[0], self.normal[1])


def gaps(walls: Sequence[Wall], shape: Shape, q: np.ndarray) -> np.ndarray:
    """Gap φ_n (n, walls) in m between the body at poses q (n, 3) and each wall."""
    columns = [shape.gap((q[:, :2] - wall.point) @ wall.n, q[:, 2] - wall.angle) for wall in walls]
    return np.stack(columns, axis=1)


def gap_slopes(walls: Sequence[Wall], shape: Shape, q: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """J_n (n, 3): derivative of the gap to wall `wall` (n,) with respect to x, y and θ."""
    J = np.zeros((len(q), 3))
    for i, one in enumerate(walls):
        rows = np.flatnonzero(wall == i)
        J[rows, :2], J[rows, 2] = one.n, shape.contact_point(q[rows, 2] - one.angle)[:, 0]
    return J


def struck_wall(walls: Sequence[Wall], shape: Shape, q: np.ndarray, dv: np.ndarray) -> np.ndarray:
    """Number (n,) of the wall that was hit at poses q (n, 3), with the velocity change dv (n, 3).

    It is the nearest of the walls that push the body in the direction of the velocity change.
    """
    apart = np.abs(gaps(walls, shape, q))
    pushes = dv[:, :2] @ np.stack([wall.n for wall in walls], axis=1) > 0.0
    return np.where(pushes, apart, apart + OUT_OF_REACH).argmin(axis=1)


def turns(walls: Sequence[Wall], wall: np.ndarray) -> np.ndarray:
    """Matrices R (n, 3, 3) that rotate a velocity into the frame of wall `wall` (n,): R v = (v·t, v·n, ω)."""
    R = np.tile(np.eye(3), (len(wall), 1, 1))
    normal = np.stack([one.n for one in walls])[wall]
    R[:, 0, 0], R[:, 0, 1] = normal[:, 1], -normal[:, 0]
    R[:, 1, 0], R[:, 1, 1] = normal[:, 0], normal[:, 1]
    return R


def in_wall_frame(walls: Sequence[Wall], wall: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Poses q (n, 3) in the frame of wall `wall` (n,)."""
    point, angle = np.array([one.point for one in walls])[wall], np.array([one.angle for one in walls])[wall]
    origin = np.column_stack([point, angle])
    return (turns(walls, wall) @ (q - origin)[:, :, None])[:, :, 0]


def as_filmed(walls: Sequence[Wall], wall: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Positions (n, 2) in the plane of the recording from poses q (n, 3) in the frames of the walls `wall` (n,)."""
    normal = np.stack([one.n for one in walls])[wall]
    tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
    return np.array([one.point for one in walls])[wall] + q[:, :1] * tangent + q[:, 1:2] * normal
