"""Poses in space in the rows of a table: whole or absent, their quaternions of length 1 and with one sign.

A row may have a position alone; a row without one is a lost frame, as if it were not there.
"""

from dataclasses import replace

import numpy as np

from thesis_lib.bodies.solid_body import UNIT
from thesis_lib.datasets.format.table_forms import POSITION, QUATERNION
from thesis_lib.datasets.format.validate import UsableRows

# how far from 1 a length stays that is not touched, so that what is written reads back
EXACT = 4.0 * np.finfo(float).eps


def whole_poses(table: UsableRows) -> UsableRows:
    """The rows with a position, quaternions (scalar first) normalised; NaN where a row or the table has none.

    What is partly there, or is not a rotation, is reported.
    """
    if lacking := [name for name in QUATERNION if name not in table.data]:
        if len(lacking) < len(QUATERNION):
            remedy = "give all of qw, qx, qy, qz, or none of them"
            table.error(f"column{'s' * (len(lacking) > 1)} {', '.join(lacking)}", "missing", remedy)
        data = table.data.drop(columns=list(QUATERNION), errors="ignore").assign(**dict.fromkeys(QUATERNION, np.nan))
    else:
        data = table.data
    place, q = data[list(POSITION)].to_numpy(float), data[list(QUATERNION)].to_numpy(float)
    placed, turned = np.isfinite(place).sum(axis=1), np.isfinite(q).sum(axis=1)
    lost = "leave all of them empty where the pose was lost, or remove the row"
    table.error("columns x, y, z", "only some of them are given", lost, (placed > 0) & (placed < 3))
    table.error("columns qw, qx, qy, qz", "only some of them are given", lost, (turned > 0) & (turned < 4))
    remedy = "give x, y and z, too, or remove the rows"
    table.error("columns x, y, z", "there is an orientation without a position", remedy, (placed == 0) & (turned == 4))
    length = np.linalg.norm(q, axis=1)
    with np.errstate(invalid="ignore"):
        wrong = np.abs(length - 1.0) > UNIT
    if wrong.any():
        what = f"the length of the quaternion is {length[wrong][0]:.4g}, and that of a rotation is 1"
        remedy = "are these the four columns of a quaternion, the scalar in qw?"
        table.error("columns qw, qx, qy, qz", what, remedy, wrong)
    data = data.assign(**dict(zip(QUATERNION, _of_one_sign(q, length).T)))
    seen = placed == 3
    if not seen.any() and table.complete:
        table.error("columns x, y, z", "no row has a position", "write the positions, or delete the file")
    return replace(table, data=data[seen])


def _of_one_sign(q: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) of length 1, of which the first number that is not 0 is positive."""
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = np.where((np.abs(length - 1.0) > EXACT)[:, None], q / length[:, None], q)
        first = np.take_along_axis(unit, (unit != 0.0).argmax(axis=1)[:, None], axis=1)
        return np.where(np.isnan(unit), np.nan, np.where(first < 0.0, -unit, unit) + 0.0)
