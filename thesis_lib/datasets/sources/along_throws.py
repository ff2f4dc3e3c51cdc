"""Tosses in the axes of their throws: each is turned about the normal of the surface so that it is thrown along t_1.

    x ← R_n(−α) x,   R ← R_n(−α) R,      α: initial direction of flight along the surface

Some recordings were turned about the vertical before publication, each toss by another angle.  An upright, level set-up
looks the same from all sides.  The effects of a lens, of skew axes or of a sloping table do not: in such a recording
they have another direction in each toss, and no effect with fixed axes describes them.  If all tosses were thrown from
one side, the axes of the throws restore the direction: a mean horizontal acceleration in the first flights then shows
in these axes, but not in the axes of the recording.

| on paper | in code   | unit  | shape  |                                                    |
|----------|-----------|-------|--------|----------------------------------------------------|
| α        | `heading` | rad   | (n,)   | by a parabola through the first flight             |
| a        | `level`   | m/s²  | (n, 2) | acceleration along t_1 and t_2, by the same fit    |
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.datasets.checks.in_space import one_clock
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import surface_frames, tracked_states
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, POSITION
from thesis_lib.datasets.format.validate import of_one_sign
from thesis_lib.datasets.space.flights import find_flights, follow
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.space import multiplied, of_rotation_vector, rotated

FEWEST = 8  # samples of a first flight
SLOW = 0.1  # m/s along the surface, below which a toss has no direction
MOST_WITHOUT = 0.1  # share of tosses without a direction, above which bodies were dropped, not thrown
TOSSES = 20  # fewest for a comparison of the axes of the throws with the axes of the recording
SURELY, CLEARLY = 6.0, 2.0  # mean sideways drift in standard errors, and over the mean drift in the recording
SPREAD = 0.7  # length of the mean direction; beyond it throws are parallel, and both axes agree
ADDED = "each toss was turned about the normal of the surface, to be thrown along its t_1"


@dataclass(frozen=True)
class Headings:
    """Direction and horizontal acceleration of the first flights of n tosses."""

    trial: np.ndarray
    heading: np.ndarray
    level: np.ndarray

    @property
    def along(self) -> np.ndarray:
        """Horizontal accelerations (n, 2) in m/s² along each throw and to the left of it."""
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        a, b = self.level.T
        return np.stack([cos * a + sin * b, cos * b - sin * a], axis=1)


def throws_of(table: pd.DataFrame, header: SpaceHeader) -> Headings:
    """Headings of the tosses over one surface, from the complete rows of trajectories.csv, sorted by trial and time."""
    frame, size = _surface(header), float(np.linalg.norm(header.gravity))
    whole = table.dropna(subset=list(POSITION))
    if len(whole) < FEWEST:
        return Headings(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    trial, t, place = one_clock(whole)
    x, found = frame.vectors_in(place.T).T, {}
    for flight in find_flights(follow(t, x, size), np.array([0.0, 0.0, -size])):
        rows = slice(max(flight.start, 0), flight.stop)
        if rows.stop - rows.start < FEWEST or trial[rows.start] in found:
            continue
        tau = t[rows] - t[rows].mean()
        X = np.stack([np.ones_like(tau), tau, 0.5 * tau**2], axis=1)
        _, v, a = np.linalg.lstsq(X, x[rows, :2], rcond=None)[0]
        began = v + tau[0] * a
        found[trial[rows.start]] = (np.arctan2(began[1], began[0]), *a, np.linalg.norm(began))
    rows = np.array([(trial, *of) for trial, of in sorted(found.items()) if of[-1] > SLOW]).reshape(-1, 5)
    return Headings(rows[:, 0], rows[:, 1], rows[:, 2:4])


def along_throws(dataset: Dataset) -> Dataset:
    """The dataset with each toss turned about the normal of the surface so that it is thrown along t_1.

    Tosses without a direction are left out.

    Raises:
        UserError: there are no trajectories in space, or too many tosses do not begin with a flight along the surface.
    """
    if dataset.space.is_plane or dataset.trajectories is None:
        raise UserError(f"{dataset.name} has no trajectories in space (schema 2) that could be turned.")
    header, table = dataset.in_space, dataset.trajectories
    throws = throws_of(table, header)
    n = table["trial"].nunique()
    if len(throws.trial) < (1.0 - MOST_WITHOUT) * n:
        raise UserError(
            f"{n - len(throws.trial)} of the {n} tosses in {dataset.name} do not begin with a flight of {FEWEST} "
            f"samples in which they move by more than {SLOW} m/s along the surface: they have no direction of throw."
        )
    frame = _surface(header)
    table = table[table["trial"].isin(throws.trial)].reset_index(drop=True)
    heading = throws.heading[np.searchsorted(throws.trial, table["trial"])]
    normal = frame.vectors_out(np.array([[0.0], [0.0], [1.0]]))
    turn, origin = of_rotation_vector(-heading * normal), frame.origin[:, None]
    states = tracked_states(table)
    position = origin + rotated(turn, states.position - origin)
    turned = np.where(table["qw"].notna(), multiplied(turn, states.attitude), np.nan)
    poses = dict(zip(POSE_IN_SPACE, np.concatenate([position, of_one_sign(turned.T).T])))
    text = f"{header.description.rstrip('. ')}; {ADDED}" if header.description else ADDED
    header = header.model_copy(update={"description": text})
    return replace(dataset, header=header, trajectories=table.assign(**poses), impacts=None)


def hidden_drift(dataset: Dataset) -> str:
    """Sentence on flights that drift along the surface in directions that follow their throws; else ""."""
    header, table = dataset.in_space, dataset.trajectories
    if table is None or header.surfaces is not None or not np.any(header.gravity):
        return ""
    throws = throws_of(table, header)
    if len(throws.trial) < TOSSES or np.abs(np.exp(1j * throws.heading).mean()) > SPREAD:
        return ""
    mean, error = throws.along.mean(axis=0), throws.along.std(axis=0) / np.sqrt(len(throws.trial))
    aside = abs(mean[1])  # an acceleration along the throw may be drag
    if aside < SURELY * error[1] or aside < CLEARLY * np.linalg.norm(throws.level.mean(axis=0)):
        return ""
    return (
        f"in flight tosses accelerate by {mean[0]:+.3f} m/s² along their throw and {mean[1]:+.3f} m/s² to the left of "
        f"it, whichever way they are thrown (mean of {len(throws.trial)}): each seems to have been turned about the "
        "vertical, which hides what is fixed in the room (axes that are not square, a slope of the table, a lens): "
        "datasets turn gives all one direction of throw"
    )


def _surface(header: SpaceHeader) -> Frame:
    if header.surfaces is not None:
        raise UserError("A dataset with several `surfaces` has no single axis about which its tosses could be turned.")
    return surface_frames(header)[0]
