"""Conversion of a motion in space without projection: gravity, table, tracked frame and tosses from the motion."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.solid_body import SolidBody
from thesis_lib.datasets.checks.in_space import OBLIQUE
from thesis_lib.datasets.format.frames import body_states, surface_frames
from thesis_lib.datasets.format.samples import sampling_period
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.datasets.sources.conversion import Conversion, Recorded, sampling_rate, solid_dataset
from thesis_lib.datasets.space.drops import IN_THE_AIR, Drop, cut_drops, until_rest, whole_pieces
from thesis_lib.datasets.space.falling_body import better_reading, falling, reading_that_falls, settled_fall
from thesis_lib.datasets.space.flights import Track, find_flights, follow, too_slow
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.datasets.space.touches import table_height
from thesis_lib.datasets.space.tracked_frame import TrackedFrame, find_tracked_frame
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.wording import plural

LEVEL = 2e-3  # rad between the upward axis and the fall, up to which they count as parallel
OFTEN = 0.25  # of the trials: fewer flights do not determine the upward direction
OFF_TABLE = 2e-3  # m; larger differences between the given and the estimated height of the table are reported


def keep_in_space(recorded: Recorded) -> Conversion:
    """The dataset of the motion in space; rows without an orientation give only the position of the body.

    Raises:
        UserError: no free flight is found, rotations fit far better in another reading, or no drop is left.
    """
    everything, turned = recorded, np.flatnonzero(recorded.motion.seen)
    # the tables keep all rows, so the rate is that of all
    rig = replace(recorded.rig, rate=sampling_rate(recorded.rig, recorded.motion.t, recorded.piece))
    recorded = replace(recorded, motion=recorded.motion.part(turned), piece=recorded.piece[turned], rig=rig)
    motion, view, notes, size = recorded.motion, recorded.view, recorded.notes, recorded.rig.g
    dataset, up = solid_dataset(recorded, view.up), view.up
    body, attitude = dataset.in_space.body, motion.quaternion[:, [3, 0, 1, 2]].T
    if motion.oriented and (other := reading_that_falls(motion, size)):
        raise _misread(motion, "the centre of mass of the body does not fall as a free body does", other)
    found = _tracked_frame(recorded, body) if view.tracked else None
    path = motion.position if found is None else found.path
    track = follow(motion.t, path, size)
    falls = None
    if found is not None and not view.up_is_given:
        off = np.arccos(min(-found.gravity @ up / size, 1.0))
        falls = found.gravity / size if off > LEVEL + 3.0 * found.gravity_angle else None
    flights = find_flights(track, -size * up) if falls is None else []
    slow = too_slow(1.0 / sampling_period(motion.t, recorded.piece))  # a bounce then looks like a fall the other way
    if falls is None and not flights and not view.up_is_given and not slow:
        fall = falling(motion.t, path, size)
        often = fall is not None and fall[2] >= OFTEN * len(np.unique(recorded.piece))
        falls = fall[1] if fall and often and not fall[0] else None
    if falls is not None:
        up = -falls
        flights = find_flights(track, size * falls)
        shown = ", ".join(f"{value:.3f}" for value in up + 0.0)
        notes.append(
            f"up is ({shown}) in the axes of the recording, opposite the fall in {plural(len(flights), 'free flight')}"
        )
    recorded.require(flights)
    warnings = [text] if view.up_is_given and (text := _oblique(track, up, size)) else []
    estimated = found is None and rig.surface_height is None
    dataset = solid_dataset(recorded, up, found, _table_height(recorded, body, flights, up) if estimated else 0.0)
    header = dataset.in_space
    assert header.tracked is not None
    if found is not None and rig.surface_height is not None:
        off = rig.surface_height - float(found.point @ up)
        if abs(off) > OFF_TABLE:
            notes.append(
                f"the surface is at {rig.surface_height:g} m along up, as given; by hits and rests the table is "
                f"{1e3 * abs(off):.3g} mm {'lower' if off > 0.0 else 'higher'} (leave --surface-height out to use this)"
            )
    mounted = rotation_matrix(header.tracked.attitude)
    tensor = mounted.T @ body.inertia_per_mass @ mounted
    if motion.oriented and (other := better_reading(motion, track, flights, tensor)):
        raise _misread(motion, "the body does not turn in free flight as a free body does", other)
    (surface,) = surface_frames(header)
    pose = np.concatenate([motion.position.T, attitude])
    states = State(pose, np.zeros((6, len(motion))), recorded.piece, motion.t, None, SPACE)
    states = surface.seen(body_states(states, header))
    height = states.height + body.solid.about(body.centre).lowest(states.attitude)[2]
    drops = cut_drops(track, height, flights, body.solid.extent) if view.cut else whole_pieces(recorded.piece, flights)
    if view.cut:
        drops = until_rest(drops, track, height, body.solid.extent)
    used = [drop for drop in drops if not drop.left_out]
    if view.cut:
        notes.append(f"{len(drops)} drops cut out of the recording, {len(drops) - len(used)} left out: {IN_THE_AIR}")
    if not used:
        raise UserError(recorded.no_drop(drops, height, float(header.planes[0][0] @ up)))
    parts = [_rows(drop, turned, everything.piece, view.cut) for drop in used]
    rows, count = np.concatenate(parts), [len(part) for part in parts]
    whole = everything.motion
    start = np.repeat(whole.t[[part[0] for part in parts]], count)
    pose = np.concatenate([whole.position, whole.quaternion[:, [3, 0, 1, 2]]], axis=1)[rows]
    columns = {"trial": np.repeat([drop.trial for drop in used], count), "t": whole.t[rows] - start}
    poses = pd.DataFrame(columns | dict(zip(POSE_IN_SPACE, pose.T)))
    warnings += [found.doubt] if found is not None and found.doubt else []
    return Conversion(replace(dataset, trajectories=poses, has_angle=motion.oriented), notes, warnings)


def _rows(drop: Drop, turned: np.ndarray, piece: np.ndarray, cut: bool) -> np.ndarray:
    """Indices of all samples of a drop, whose limits count only the samples with an orientation, `turned`."""
    if not cut:
        return np.flatnonzero(piece == piece[turned[drop.start]])
    return np.arange(turned[drop.start], turned[drop.stop - 1] + 1)


def _misread(motion: Motion, what: str, other: str) -> UserError:
    return UserError(
        f"{motion.source}: read as stated, {what}. It does with {other}. Find out how the log was written; state it."
    )


def _oblique(track: Track, up: np.ndarray, gravity: float) -> str:
    """Sentence on flights that fall in another direction than opposite the given `up` (3,), "" if they do not."""
    fall = settled_fall(track, -gravity * up)
    if fall is None or (off := np.arccos(np.clip(-fall[0] @ up, -1.0, 1.0))) < OBLIQUE:
        return ""
    shown = ",".join(f"{value:.4f}" for value in -fall[0] + 0.0)
    return (
        f"{plural(fall[1], 'free flight')} fall{'s' * (fall[1] == 1)} {np.degrees(off):.1f}° off the direction "
        f"opposite --up, with which others may be missed: if the axes of the recording are not level, give --up={shown}"
    )


def _table_height(recorded: Recorded, body: SolidBody, flights: Sequence[slice], up: np.ndarray) -> float:
    """Height in m along `up` (3,) at which a body with a given tracked frame hits and rests; adds a note on it."""
    motion, notes = recorded.motion, recorded.notes
    turned = Rotation.from_quat(motion.quaternion) if motion.oriented else Rotation.identity(len(motion))
    try:
        height, met = table_height(
            recorded.piece, motion.t, motion.position, turned, body, flights, -recorded.rig.g * up
        )
    except UserError as error:
        notes.append(f"the surface is assumed at height 0 along up: {error} Give --surface-height if it is elsewhere.")
        return 0.0
    rests = int(met.rests.sum())
    notes.append(
        f"the surface is at {height:.4g} m along up, where the lowest point of the shape is at "
        f"{plural(len(met.rests) - rests, 'hit')} and {plural(rests, 'rest')} (median); if it is elsewhere, give "
        "--surface-height"
    )
    return height


def _tracked_frame(recorded: Recorded, body: SolidBody) -> TrackedFrame | None:
    """The tracked frame and the table as estimated from the motion; None, with a note, if that is not possible."""
    motion, notes = recorded.motion, recorded.notes
    try:
        q = motion.quaternion[:, [3, 0, 1, 2]] if motion.oriented else None
        found = find_tracked_frame(recorded.piece, motion.t, motion.position, q, body, recorded.rig.g)
    except UserError as error:
        notes.append(f"the tracked frame is assumed to be the frame of the shape, as it could not be found: {error}")
        return None
    notes.append(found.text)
    notes.extend(f"tracked frame, open: {left}" for left in found.open)
    return found
