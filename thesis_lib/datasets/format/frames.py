"""Conversion between tracked poses and motions of the believed centre of mass, and the frames of surfaces.

    R_WS = R(q) R_STᵀ,    p_C = p + R_WS (c − d),    v_C = v + ω × R_WS (c − d)

| on paper | in code                   | unit | meaning                                          |
|----------|---------------------------|------|--------------------------------------------------|
| p, q     | columns of the tables     | m, 1 | pose of the tracked frame T in the world W       |
| d, R_ST  | `tracked`                 | m, 1 | pose of T in the frame of the shape S            |
| c        | `body.center_of_mass`     | m    | believed centre of mass in S                     |

A state of the body consists of the attitude of S and the position of the believed centre of mass.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSITION, QUATERNION
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import Frame, on_body
from thesis_lib.mechanics.space import SPACE, conjugate
from thesis_lib.mechanics.state import State


def tracked_states(table: pd.DataFrame, velocities: Sequence[str] = ()) -> State:
    """States of T from the rows of a table of schema 2; velocities come from the columns `velocities`, else are NaN.

    A missing orientation (of a sphere) is replaced by the identity.
    """
    attitude = table[list(QUATERNION)].to_numpy(float)
    attitude = np.where(np.isfinite(attitude), attitude, [1.0, 0.0, 0.0, 0.0])
    motion = table[list(velocities)].to_numpy(float) if velocities else np.full((len(table), SPACE.motions), np.nan)
    t = table["t"].to_numpy(float) if "t" in table else np.full(len(table), np.nan)
    pose = np.concatenate([table[list(POSITION)].to_numpy(float), attitude], axis=1)
    return State.of(pose, motion, table["trial"].to_numpy(), t, space=SPACE)


def body_states(states: State, header: SpaceHeader) -> State:
    """States of the body from the `states` of its tracked frame.

    Raises:
        UserError: the pose of the tracked frame in the body is unknown.
    """
    place, attitude = _centre_in_tracked(header)
    return on_body(states, place, attitude)


def tracked_of_body(states: State, header: SpaceHeader) -> State:
    """States of the tracked frame from states of the body: the inverse of `body_states`, with the same error."""
    place, attitude = _centre_in_tracked(header)
    back = conjugate(attitude)
    return on_body(states, -SPACE.turned(back[:, None], place[:, None])[:, 0], back)


def surface_frames(header: SpaceHeader) -> list[Frame]:
    """The frame (t_1, t_2, n) of each surface."""
    return [Frame.of_surface(point, normal) for point, normal in header.planes]


def _centre_in_tracked(header: SpaceHeader) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) in m of the believed centre of mass in T, and the quaternion (4,) that turns S's axes into T's."""
    if header.tracked is None:
        raise UserError(
            "tracked: unknown: to locate the body, give the pose of the tracked frame in the frame of the shape, "
            "position: [x, y, z] and quaternion: [w, x, y, z]."
        )
    back = conjugate(header.tracked.attitude)
    between = header.body.centre - np.array(header.tracked.position)
    return SPACE.turned(back[:, None], between[:, None])[:, 0], back
