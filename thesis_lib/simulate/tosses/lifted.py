"""Planar drops lifted into space: recorded as a camera in space, with axes of its own, would see the planar motion.

| in the plane          | in space                                                                                  |
|-----------------------|-------------------------------------------------------------------------------------------|
| x, y                  | along t_1 and n of the surface                                                            |
| θ                     | rotation by −θ about t_2; the axes x, y of the body become x, z of the shape              |
| ellipse a, b          | ellipsoid a, √(a b), b                                                                    |
| centred rectangle     | box of the same sides, as deep as it is wide                                              |
| k                     | radii of gyration k, k, k                                                                 |

The poses already contain noise in the plane; noise of the same size is added to the other position and rotations.
"""

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Ellipse, Polygon
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import surface_frames, tracked_of_body
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector, rotated
from thesis_lib.mechanics.state import State

WITHIN = 1e-9  # m, tolerance of the corners of a rectangle


def lifted(dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """The drops in space; recording axes, tracked frame and the direction "up" are drawn at random, and stated.

    Raises:
        UserError: the set has no angle, more than one surface, or a shape other than an ellipse or centred rectangle.
    """
    header, table = dataset.header, dataset.trajectories
    if not isinstance(header, Header) or table is None or not dataset.has_angle or header.surfaces:
        raise UserError(f"{dataset.name} cannot be lifted: it needs planar trajectories with an angle on one surface.")
    shape, noise = _solid(header.body.shape), header.noise
    position, rotation = ((noise.position or 0.0), (noise.angle or 0.0)) if noise else (0.0, 0.0)
    off, turns = 0.03 * rng.standard_normal(3), of_rotation_vector(2.0 * rng.standard_normal((3, 2)))
    up = rotated(turns[:, :1], np.array([[0.0], [0.0], [1.0]]))[:, 0]
    content = {
        "schema": 2,
        "description": header.description,
        "body": {"shape": shape, "mass": header.body.mass, "radii_of_gyration": (header.body.radius_of_gyration,) * 3},
        "tracked": {"position": tuple(off), "quaternion": tuple(turns[:, 1])},
        "surface": {"point": tuple(rng.uniform(-1.0, 1.0, 3))},
        "gravity": tuple(-dataset.gravity * up),
        "rate": header.rate,
    }
    if position and rotation:
        content["noise"] = {"position": position, "rotation": rotation}
    in_space, n = SpaceHeader.model_validate(content), len(table)
    x, y, theta = table[["x", "y", "theta"]].to_numpy(float).T
    place = np.stack([x, position * rng.standard_normal(n), y - header.surface.height])
    turned = of_rotation_vector(np.stack([np.zeros(n), -theta, np.zeros(n)]))
    across = rotation * rng.standard_normal((3, n)) * [[1.0], [0.0], [1.0]]
    attitude = SPACE.attitude_after(turned, across)
    trial, t = table["trial"].to_numpy(), table["t"].to_numpy(float)
    states = State(np.concatenate([place, attitude]), np.zeros((6, n)), trial, t, None, SPACE)
    (frame,) = surface_frames(in_space)
    seen = tracked_of_body(frame.shown(states), in_space).pose
    seen[3:] *= np.where(seen[3:4] < 0.0, -1.0, 1.0)
    columns = {"trial": trial, "t": t} | dict(zip(POSE_IN_SPACE, seen))
    return Dataset(dataset.name, in_space, pd.DataFrame(columns).dropna(ignore_index=True))


def _solid(shape) -> dict:
    """The shape in space that corresponds to a shape in the plane."""
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return {"kind": "ellipsoid", "semi_axes": (a, float(np.sqrt(a * b)), b)}
    if isinstance(shape, Polygon) and len(shape.vertices) == 4:
        corners = np.abs(np.array(shape.vertices))
        if np.ptp(corners, axis=0).max() < WITHIN:
            a, b = corners[0]
            return {"kind": "box", "half_extents": (float(a), float(a), float(b))}
    raise UserError("a planar set can be lifted only if its shape is an ellipse or a centred rectangle.")
