"""Determine the pose of the tracked frame from the tosses, for datasets with `tracked: unknown`."""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.solid_body import FlatSurface, Tracked
from thesis_lib.bodies.symmetry import Symmetry
from thesis_lib.datasets.checks.in_space import one_clock
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.table_forms import QUATERNION
from thesis_lib.datasets.space.tracked_frame import TrackedFrame, find_tracked_frame
from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.wording import plural

ELSEWHERE = (0.1, 0.2)  # extents of the body, and rad, from which a stated frame contradicts the frame found
LEVEL = 0.9998  # cosine of 1.1° between normal and vertical, up to which a table counts as level
SURE = 4.0  # the same in sigmas of the frame found


def settled(dataset: Dataset) -> Dataset:
    """The dataset with a known pose of its tracked frame: as stated, else as its tosses determine it.

    For a ball without orientation the tracked point is taken to be the centre of mass.  A single named surface replaces
    `surface`, without its extent: beyond the extent nothing is hit at that height.

    Raises:
        UserError: `tracked` is unknown, and the data do not determine it; the message names what is missing.
    """
    header = dataset.in_space
    if header.surfaces is not None and len(header.surfaces) == 1:
        (one,) = header.surfaces
        surface = FlatSurface(point=one.point, normal=one.normal)
        dataset = replace(dataset, header=header.model_copy(update={"surface": surface, "surfaces": None}))
    if dataset.in_space.tracked is not None:
        return dataset
    if not dataset.has_angle:
        middle = Tracked.model_validate({"position": tuple(dataset.in_space.body.centre.tolist())})
        return replace(dataset, header=dataset.in_space.model_copy(update={"tracked": middle}))
    try:
        found = _found(dataset)
        if found.open:
            raise UserError("; ".join(found.open) + ". Record until the body lies still, on different faces.")
    except UserError as error:
        raise UserError(f"tracked: unknown: {error}") from None
    return replace(dataset, header=dataset.in_space.model_copy(update={"tracked": found.tracked}))


def tracked_frame_told(dataset: Dataset, compare: bool) -> str | None:
    """Sentence on an unknown tracked frame or, with `compare`, a stated one; None if the tosses do not determine it."""
    stated, body = dataset.in_space.tracked, dataset.in_space.body
    if dataset.trajectories is None or not dataset.has_angle or (stated is not None and not compare):
        return None
    try:
        found = _found(dataset)
    except UserError as error:
        return None if stated is not None else f"the tracked frame is unknown, and was not found: {error}"
    left = "".join(f"; open: {sentence}" for sentence in found.open) + (f"; {found.doubt}" if found.doubt else "")
    if stated is None:
        return found.text + left
    one, other = (Rotation.from_quat(pose.attitude, scalar_first=True).as_matrix() for pose in (stated, found.tracked))
    # a symmetry of the body turns it about its centre of mass, which keeps its place in the tracked frame
    near = Symmetry(body.solid.about(body.centre), body.inertia_per_mass).nearest(one, other)
    moved = body.centre - near @ one.T @ (body.centre - np.array(stated.position))
    place = float(np.linalg.norm(moved - np.array(found.tracked.position)))
    turn, error = float(Rotation.from_matrix(other @ near.T).magnitude()), found.tracked.uncertainty
    assert error is not None and error.position and error.rotation
    far = place > max(ELSEWHERE[0] * body.solid.extent, SURE * error.position)
    if not found.open and (far or turn > max(ELSEWHERE[1], SURE * error.rotation)):
        return (
            f"{found.text}. That is {1e3 * place:.3g} mm and {np.degrees(turn):.3g}° from the pose in dataset.yaml: "
            "correct tracked, or write tracked: unknown"
        )
    return f"tracked frame as stated, according to {plural(found.hits, 'hit')} and {plural(found.rests, 'rest')}{left}"


def _found(dataset: Dataset) -> TrackedFrame:
    """Tracked frame found from the tosses; UserError if they do not determine it."""
    table = dataset.trajectories
    if table is None or not dataset.has_angle:
        raise UserError("it can be found only from trajectories with orientation; give the pose.")
    whole = pd.DataFrame(table[np.isfinite(table["qw"].to_numpy(float))])
    trial, t, position = one_clock(whole)
    q = whole[list(QUATERNION)].to_numpy(float)
    # in axes of a camera the direction of gravity may be wrong, and the normal with it, but not a stated slope
    normals, down = [normal for _, normal in dataset.in_space.planes], np.array(dataset.in_space.gravity)
    slopes = len(normals) == 1 and float(-normals[0] @ down) < LEVEL * dataset.gravity
    return find_tracked_frame(
        trial, t, position, q, dataset.in_space.body, dataset.gravity, normals[0] if slopes else None
    )
