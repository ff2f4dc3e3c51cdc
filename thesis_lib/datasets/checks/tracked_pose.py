"""The one place where `tracked: unknown` is settled: the pose of the tracked frame is what the tosses say of it."""

from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.datasets.checks.in_space import one_clock
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.table_forms import QUATERNION
from thesis_lib.foundation.errors import UserError


def settled(dataset: Dataset) -> Dataset:
    """The dataset with the pose of its tracked frame: as it is if that is stated, else as its tosses say.

    Raises:
        UserError: `tracked` is unknown, and the data do not say it; says what is missing.
    """
    header, table = dataset.in_space, dataset.trajectories
    if header.tracked is not None:
        return dataset
    if table is None or not dataset.has_angle:
        raise UserError("tracked: unknown: it is found from trajectories with orientation only; give the pose.")
    from thesis_lib.datasets.space.tracked_frame import find_tracked_frame  # its search imports much of scipy

    whole = pd.DataFrame(table[np.isfinite(table["qw"].to_numpy(float))])
    trial, t, position = one_clock(whole)
    q = whole[list(QUATERNION)].to_numpy(float)
    try:
        found = find_tracked_frame(trial, t, position, q, header.body, dataset.gravity)
        if found.open:
            raise UserError("; ".join(found.open) + ". Record until the body lies still, on different faces.")
    except UserError as error:
        raise UserError(f"tracked: unknown: {error}") from None
    return replace(dataset, header=header.model_copy(update={"tracked": found.tracked}))
