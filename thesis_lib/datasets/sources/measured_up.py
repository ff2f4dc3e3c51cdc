"""Upward axis of a motion in a plane of space, as its free flights show it.

A camera that is not level records bodies that fall along none of its axes.  In the plane of the motion the fall is
down.  The size a of the acceleration shows whether the plane itself is inclined:

    a = g cos τ     a plane inclined by τ, in which the body is held, as on an air table
    a = g           a vertical plane, seen by a tilted camera

| on paper | in code     | unit | shape | axes                                                                  |
|----------|-------------|------|-------|-----------------------------------------------------------------------|
| a        | `a`         | m/s² | (3,)  | recording: median over all samples of the flights                     |
| τ        | `tilt`      | rad  |       | between the plane and the upward axis that was assumed                |
"""

from dataclasses import replace

import numpy as np

from thesis_lib.datasets.format.samples import sampling_period
from thesis_lib.datasets.sources.conversion import Recorded
from thesis_lib.datasets.space.falling_body import any_fall, too_few_fall
from thesis_lib.datasets.space.flights import Track, find_flights, inner, inner_samples, too_slow
from thesis_lib.datasets.space.plane import STEEPEST, Plane, find_plane
from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.wording import plural

LEAN = np.radians(5.0)  # between up and the fall; a critique finds smaller tilts itself, and drag causes such angles
SIGMAS = 3.0  # of the direction of the fall, added to `LEAN`
ROUNDS = 2  # times that the flights are found again along their own mean fall


def with_measured_up(recorded: Recorded, track: Track, omega: np.ndarray) -> tuple[Recorded, list[str]]:
    """The recording with the upward axis opposite its fall, with a note; if --up states another axis, as it is, with
    a warning that names the better one.  Unchanged where both agree, or too few flights decide.

    `track` and `omega` (n, 3) in rad/s are the local fits to its positions and rotations.
    """
    view = recorded.view
    found = None if view.flat else _measured(recorded, track, omega)
    if found is None:
        return recorded, []
    up, number = found
    off = f"{np.degrees(_angle(up, view.up)):.1f}°"
    if not view.up_is_given:
        shown = ", ".join(f"{value:.3f}" for value in np.round(up, 3) + 0.0)
        recorded.notes.append(
            f"up is ({shown}) in the axes of the recording, opposite the fall in {plural(number, 'free flight')}, and "
            f"{off} off the usual axis (--up to state another)"
        )
        return replace(recorded, view=replace(view, up=up)), []
    better = ",".join(f"{value:.3f}" for value in np.round(up, 3) + 0.0)
    return recorded, [
        f"{plural(number, 'free flight')} fall {off} off the axis given as up, as seen by a tilted camera. With --up "
        f"{better} gravity points straight down"
    ]


def _measured(recorded: Recorded, track: Track, omega: np.ndarray) -> tuple[np.ndarray, int] | None:
    """Upward axis (3,) and the number of flights that show it; None if too few do, or the assumed axis agrees."""
    motion, rig, view = recorded.motion, recorded.rig, recorded.view
    given = None if view.normal is None else Plane.of(view.normal, view.up)
    size = rig.g if given is None else rig.g * np.cos(given.tilt)
    fall, trials = any_fall(track, size), len(np.unique(recorded.piece))
    if fall is None or too_slow(1.0 / sampling_period(motion.t, recorded.piece)):
        return None
    flights, a, each = fall[1], size * fall[0], np.zeros((1, 3))
    for _ in range(ROUNDS):
        if too_few_fall(len(flights), trials):
            return None
        each = np.stack([np.nanmean(track.a[inner(flight, track)], axis=0) for flight in flights])
        a = np.nanmedian(track.a[inner_samples(flights, track)], axis=0)
        flights = find_flights(track, size * a / np.linalg.norm(a))
    least = LEAN + SIGMAS * np.linalg.norm(each.std(axis=0)) / np.sqrt(len(each)) / np.linalg.norm(a)
    up = -a / np.linalg.norm(a)
    if too_few_fall(len(flights), trials) or _angle(up, view.up) < least:
        return None
    try:
        rows = inner_samples(flights, track)
        rows = rows[np.isfinite(omega[rows]).all(axis=1) & np.isfinite(track.v[rows]).all(axis=1)]
        normal = (find_plane(track.v[rows], omega[rows], rig.radius, up) if given is None else given).normal
    except UserError:  # rotations that are misread have no plane, which is said later
        return up, len(flights)
    tilt = float(np.arcsin(np.clip(view.up @ normal, -1.0, 1.0)))
    inclined = np.linalg.norm(a) < 0.5 * rig.g * (1.0 + np.cos(tilt)) or (rig.gravity and abs(tilt) < STEEPEST)
    up = Plane.of(normal, up).y
    up = np.cos(tilt) * up + np.sin(tilt) * normal if inclined else up
    return (up, len(flights)) if _angle(up, view.up) >= least else None


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    """Angle in rad between two unit vectors (3,)."""
    return float(np.arccos(np.clip(one @ other, -1.0, 1.0)))
