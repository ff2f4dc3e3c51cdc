"""A dataset from motions in space: the plane, the reading of the rotations, the drops, the energy out of the plane."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from thesis_lib.bodies.solid_body import SolidBody
from thesis_lib.datasets.format.frames import body_states, surface_frames
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.datasets.samples.stamps import times_of_pictures
from thesis_lib.datasets.sources.conversion import Conversion, as_dataset, solid_dataset
from thesis_lib.datasets.sources.tables.rig_options import GRAVITY, RigOptions, needs_no_angle
from thesis_lib.datasets.space.convention import Scene, check_reading, fit
from thesis_lib.datasets.space.drops import (
    IN_THE_AIR,
    SPATIAL,
    Cuts,
    Drop,
    cut_drops,
    impact_shares,
    lowest,
    whole_pieces,
)
from thesis_lib.datasets.space.flights import find_flights, first_window, follow, last_window, smoothed_turning
from thesis_lib.datasets.space.motion import Motion, handed, join, turning
from thesis_lib.datasets.space.plane import Plane, find_plane, in_plane, share_out
from thesis_lib.datasets.space.torque_free import better_reading, falling
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.mechanics.state import State

if TYPE_CHECKING:
    from thesis_lib.datasets.space.tracked_frame import TrackedFrame

MOST_OUT = 0.05  # share of the energy out of the plane from which on a trial is left out
STRAIGHT = 0.99  # share of a direction along an axis, from which on it is that axis
LEVEL = 2e-3  # rad between the axis that is up and the fall, within which they are one
PART = 100  # samples within which a clock of arrival wanders by less than it jitters
FEW_TRIALS = 10  # a critique asks for as many


@dataclass(frozen=True, eq=False)
class View:
    """How a motion in space is looked at.

    `up` (3,) is against gravity, `normal` (3,) that of the plane (None: found from the motion), `frame` the body's
    place in its tracked frame: x, y (m) of the centre of mass, and by how much (rad) the shape is turned against that
    frame. `cut`: recordings are cut into drops; else each is one trial, or each trial that it names.
    """

    up: np.ndarray
    normal: np.ndarray | None = None
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cut: bool = True
    left_handed: bool = False
    up_is_given: bool = True  # else `up` is that of most such recordings
    tracked: bool = True  # the tracked frame of a shape in space is looked for; else it is that of the shape


def convert_motions(
    motions: Sequence[Motion], name: str, files: Sequence[str | Path], rig: RigOptions, view: View, notes: list[str]
) -> Conversion:
    """A dataset of trajectories from the motions of one body, one of each recording; adds to `notes`.

    The motion stays in space if the shape is one of space; else it is projected.  UserError if no free flight or no
    plane is found, rotations fit far better if they are read otherwise, or no drop is left.
    """
    samples = sum(map(len, motions))
    if not motions[0].oriented:
        needs_no_angle(rig.shape, motions[0].source)
    motion, piece = join([handed(motion, view.left_handed) for motion in motions])
    if len(motion) < samples:
        notes.append(f"{samples - len(motion)} of {samples} samples left out: the body was not seen")
    motion, piece = _at_exposure(motion, piece, rig.rate, notes)
    try:
        if rig.in_space:
            return _keep_in_space(motion, piece, name, files, rig, view, notes)
        return _convert(motion, piece, name, files, rig, view, notes)
    except UserError as error:
        text = str(error)
        raise error if str(files[0]) in text or text.startswith("--") else UserError(f"{files[0]}: {text}") from None


def _at_exposure(motion: Motion, piece: np.ndarray, rate: float | None, notes: list[str]) -> tuple[Motion, np.ndarray]:
    """The motion at the times of its pictures where stamps are those of arrival, as for the trials of a dataset.

    A long recording is looked at in parts, for the lateness that is the same in all rows wanders.
    """
    first = np.flatnonzero(np.r_[True, np.diff(piece) != 0])
    row = np.arange(len(piece)) - np.repeat(first, np.diff(np.r_[first, len(piece)]))
    part = np.cumsum(row % PART == 0)
    samples = Samples(part, motion.t, motion.position, part)
    found = times_of_pictures(samples, rate or 1.0 / _long_period(motion.t, piece), lengths=3)
    if found is None:
        return motion, piece
    sure, t, said = found
    notes.append(said)
    rises = t > np.maximum.accumulate(np.r_[-np.inf, t[:-1]])  # a part that has counted one too many runs into the next
    rows = np.flatnonzero(sure)[rises]
    return replace(motion.part(rows), t=t[rises]), piece[rows]


def _long_period(t: np.ndarray, piece: np.ndarray) -> float:
    """Median step in s over ever more rows: of a period that is nearly known, the steps between two rows are, too."""
    period = 0.0
    for span in 2 ** np.arange(2, 16):
        step = (t[span:] - t[:-span])[piece[span:] == piece[:-span]]
        if period and len(step) < PART:
            break
        steps = np.maximum(np.round(step / period), 1.0) if period else float(span)
        period = float(np.median(step / steps)) if len(step) else float(np.median(np.diff(t)))
    return period


def _keep_in_space(
    motion: Motion,
    piece: np.ndarray,
    name: str,
    files: Sequence[str | Path],
    rig: RigOptions,
    view: View,
    notes: list[str],
) -> Conversion:
    size, up = GRAVITY if rig.gravity is None else rig.gravity, view.up
    dataset = solid_dataset(name, files, rig, up, motion)
    body, attitude = dataset.in_space.body, motion.quaternion[:, [3, 0, 1, 2]].T
    found = _tracked_frame(motion, piece, body, size, notes) if view.tracked and motion.oriented else None
    path = motion.position if found is None else found.path
    track = follow(motion.t, path, size)
    falls = None
    if found is not None and not view.up_is_given:
        off = np.arccos(min(-found.gravity @ up / size, 1.0))
        falls = found.gravity / size if off > LEVEL + 3.0 * found.gravity_angle else None
    flights = find_flights(track, -size * up) if falls is None else []
    if (
        falls is None
        and not flights
        and not view.up_is_given
        and (fall := falling(motion.t, path, size))
        and not fall[0]
    ):
        falls = fall[1]
    if falls is not None:
        up = -falls
        flights = find_flights(track, size * falls)
        shown = ", ".join(f"{value:.3f}" for value in up + 0.0)
        notes.append(f"up is ({shown}) in the axes of the recording, against the fall in {len(flights)} free flights")
    if not flights:
        raise UserError(_no_flight(motion, size))
    dataset = solid_dataset(name, files, rig, up, motion, found)
    header = dataset.in_space
    assert header.tracked is not None
    mounted = rotation_matrix(header.tracked.attitude)
    tensor = mounted.T @ body.inertia_per_mass @ mounted
    if motion.oriented and (other := better_reading(motion, track, flights, tensor)):
        raise UserError(
            f"{motion.source}: read as stated, the body does not turn in free flight as a free body does. It does with "
            f"{other}. Find out how the log was written, and say so."
        )
    (surface,) = surface_frames(header)
    states = State(
        np.concatenate([motion.position.T, attitude]), np.zeros((6, len(motion))), piece, motion.t, None, SPACE
    )
    states = surface.seen(body_states(states, header))
    height = states.height + body.solid.about(body.centre).lowest(states.attitude)[2]
    drops = cut_drops(track, height, flights, body.solid.extent) if view.cut else whole_pieces(piece, flights)
    used = [drop for drop in drops if not drop.left_out]
    if view.cut:
        notes.append(f"{len(drops)} drops cut out of the recording, {len(drops) - len(used)} left out: {IN_THE_AIR}")
    if not used:
        raise UserError(_no_drop(drops, height, rig))
    rows = np.concatenate([np.arange(drop.start, drop.stop) for drop in used])
    count = [drop.stop - drop.start for drop in used]
    start = np.repeat(motion.t[[drop.start for drop in used]], count)
    columns = dict(zip(POSE_IN_SPACE, np.concatenate([motion.position.T, attitude])[:, rows]))
    poses = pd.DataFrame({"trial": np.repeat([d.trial for d in used], count), "t": motion.t[rows] - start} | columns)
    return Conversion(replace(dataset, trajectories=poses, has_angle=motion.oriented), notes)


def _tracked_frame(
    motion: Motion, piece: np.ndarray, body: SolidBody, gravity: float, notes: list[str]
) -> "TrackedFrame | None":
    """The pose of the tracked frame and the table, as the motion says them; None, with a note, where it does not."""
    from thesis_lib.datasets.space.tracked_frame import find_tracked_frame

    try:
        q = motion.quaternion[:, [3, 0, 1, 2]]
        found = find_tracked_frame(piece, motion.t, motion.position, q, body, gravity)
    except UserError as error:
        notes.append(f"the tracked frame is taken to be that of the shape, as it could not be found: {error}")
        return None
    notes.append(found.text)
    notes.extend(f"tracked frame, open: {left}" for left in found.open)
    return found


def _convert(
    motion: Motion,
    piece: np.ndarray,
    name: str,
    files: Sequence[str | Path],
    rig: RigOptions,
    view: View,
    notes: list[str],
) -> Conversion:
    size = GRAVITY if rig.gravity is None else rig.gravity
    given = None if view.normal is None else Plane.of(view.normal, view.up)
    falls = -size * (view.up if given is None else np.cos(given.tilt) * given.y)
    track = follow(motion.t, motion.position, size)
    flights = find_flights(track, falls)
    if not flights:
        raise UserError(_no_flight(motion, size))
    scene = Scene(track, flights, rig.shape, rig.radius, view.up, given, view.frame[2])
    check_reading(motion, scene)
    omega = smoothed_turning(turning(motion), motion.t, track.half)
    inner = np.concatenate([np.arange(first_window(f, track), last_window(f, track) + 1) for f in flights])
    inner = inner[np.isfinite(omega[inner]).all(axis=1) & np.isfinite(track.v[inner]).all(axis=1)]
    plane = find_plane(track.v[inner], omega[inner], rig.radius, view.up) if given is None else given
    q, axis = in_plane(motion, plane)
    turned = fit(motion, replace(scene, plane=plane)).turned  # in the plane in which theta will be written
    if turned and not any(view.frame[:2]):
        angle = np.degrees(view.frame[2] + turned)
        notes.append(
            f"the impacts fit better if the shape is turned by {angle:.0f}° in its tracked frame (--frame "
            f"0,0,{angle:.0f}), as where a rigid body was defined while it lay askew"
        )
    if any(view.frame[:2]):
        # flights are those of the centre of mass: look again, with it in the place of the tracked point
        (x, y, _), cos, sin = view.frame, np.cos(q[:, 2]), np.sin(q[:, 2])
        shift = np.outer(cos * x - sin * y, plane.x) + np.outer(sin * x + cos * y, plane.y)
        moved, view = replace(motion, position=motion.position + shift), replace(view, frame=(0.0, 0.0, view.frame[2]))
        return _convert(moved, piece, name, files, rig, view, notes)
    q[:, 2] += view.frame[2]
    if rig.gravity is None:
        rig = replace(rig, gravity=float(f"{GRAVITY * np.cos(plane.tilt):.6g}"))
    how = "found" if given is None else "given"
    notes.append(_plane_text(plane, how, rig) + (f"; theta is the angle of the body's {axis} axis" * motion.oriented))

    out, total = np.full(len(motion), np.nan), np.full(len(motion), np.nan)
    out[inner], total[inner] = share_out(track.v[inner], omega[inner], plane, rig.radius)
    height = lowest(q, rig.shape, rig.surface_height)
    drops = cut_drops(track, height, flights, rig.shape.extent) if view.cut else whole_pieces(piece, flights)
    drops, impacts = impact_shares(drops, motion.t, out, total, MOST_OUT)
    used = [drop for drop in drops if not drop.left_out]
    notes += _drops_text(drops, impacts, view.cut)
    if not used:
        raise UserError(_no_drop(drops, height, rig))
    rows = np.concatenate([np.arange(drop.start, drop.stop) for drop in used])
    poses = pd.DataFrame(q[rows], columns=["x", "y", "theta"])[["x", "y", *(["theta"] if motion.oriented else [])]]
    poses = poses.assign(t=motion.t[rows], trial=np.repeat([d.trial for d in used], [d.stop - d.start for d in used]))
    dataset = as_dataset(poses, name, files, rig, notes)
    return Conversion(dataset, notes, [], Cuts(motion.t - motion.t[0], height, tuple(drops), impacts))


def _no_flight(motion: Motion, gravity: float) -> str:
    """What to do where nothing falls as it should."""
    if found := falling(motion.t, motion.position, gravity):
        unit, down, number = found
        axis = int(np.abs(down).argmax())
        direction = ",".join(f"{value:.3f}" for value in -down + 0.0)
        if abs(down[axis]) > STRAIGHT:
            direction = ("-" if down[axis] > 0.0 else "") + "xyz"[axis]
        options = f"--up {direction}" + (f" and --units {unit}" if unit else "")
        return f"nothing falls along the axis said to be up; there are {number} free flights with {options}."
    return (
        f"no free flight is in it: nowhere does the body accelerate by {gravity:g} m/s² along an axis. Check "
        "the units of length and time; on an inclined plane give --plane, and its own --gravity if that differs."
    )


def _plane_text(plane: Plane, how: str, rig: RigOptions) -> str:
    n = ", ".join(f"{value:.3f}" for value in plane.normal + 0.0)
    tilt = np.degrees(abs(plane.tilt))
    text = f"plane of the motion {how}: normal ({n}) in the axes of the recording, {tilt:.1f}° off the vertical"
    return f"{text}; gravity in it {rig.gravity:.4g} m/s²"


def _drops_text(drops: Sequence[Drop], impacts: pd.DataFrame, cut: bool) -> list[str]:
    """What was cut and left out, and the energy out of the plane."""
    used = [drop for drop in drops if not drop.left_out]
    texts = [f"{len(drops)} drops cut out of the recording"] if cut else []
    worst = impacts[["energy_out_before", "energy_out_after"]].max(axis=1).groupby(impacts["trial"]).max()
    for reason in dict.fromkeys(drop.left_out for drop in drops if drop.left_out):
        trials = [drop.trial for drop in drops if drop.left_out == reason]
        shown = [f"{n} ({worst[n]:.0%} of its energy)" if reason == SPATIAL else str(n) for n in trials[:20]]
        more = f" and {len(trials) - 20} more" if len(trials) > 20 else ""
        texts.append(f"{len(trials)} of {len(drops)} trials left out, {reason}: {', '.join(shown)}{more}")
    shares = worst[[drop.trial for drop in used if drop.trial in worst.index]]
    if len(shares):
        texts.append(
            f"energy out of the plane: {shares.median():.2%} in the median trial, {shares.max():.2%} at most "
            f"(trial {shares.idxmax()}); each impact in impacts_in_space.csv"
        )
    return texts


def _no_drop(drops: Sequence[Drop], height: np.ndarray, rig: RigOptions) -> str:
    if all(drop.left_out == SPATIAL for drop in drops):
        return (
            f"all {len(drops)} trials have more than {MOST_OUT:.0%} of their energy out of the plane: the "
            "motion is one in space, or rotations are not read as they were written (order, handedness, "
            "sequence of angles)."
        )
    ends = [height[drop.flights[-1].stop - 1] for drop in drops if drop.flights]
    low = float(np.median(ends))
    return (
        f"none of {len(drops)} drops reaches the surface: their falls end {low:.3f} m above it (median). Is the "
        f"surface at {rig.surface_height + low:.3f} m (--surface-height)? Are the shape and --frame right?"
    )
