"""Projection of a motion in space into its plane: reading of the rotations, drops, and energy out of the plane."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.validate import first_of
from thesis_lib.datasets.sources.conversion import MOST_OUT, Conversion, Recorded, as_dataset
from thesis_lib.datasets.sources.measured_up import with_measured_up
from thesis_lib.datasets.sources.tables.rig_options import GRAVITY
from thesis_lib.datasets.space.convention import Scene, check_reading, fit
from thesis_lib.datasets.space.drops import SPATIAL, Cuts, Drop, cut_drops, impact_shares, whole_pieces
from thesis_lib.datasets.space.flights import find_flights, follow, inner_samples, smoothed_turning
from thesis_lib.datasets.space.motion import turning
from thesis_lib.datasets.space.plane import Plane, find_plane, in_plane, share_out
from thesis_lib.foundation.errors import UserError


def project(recorded: Recorded) -> Conversion:
    """The dataset of the motion in its plane.

    Raises:
        UserError: no free flight or no plane is found, rotations fit far better in another reading, or no drop is
            left.
    """
    motion, rig, notes, size = recorded.motion, recorded.rig, recorded.notes, recorded.rig.g
    track = follow(motion.t, motion.position, size)
    omega = smoothed_turning(turning(motion.quaternion), motion.t, track.half)
    recorded, warnings = with_measured_up(recorded, track, omega)
    view = recorded.view
    given = None if view.normal is None else Plane.of(view.normal, view.up)
    falls = -size * (view.up if given is None else np.cos(given.tilt) * given.y)
    flights = find_flights(track, falls)
    recorded.require(flights)
    scene = Scene(track, flights, rig.shape, rig.radius, view.up, given, view.frame[2])
    check_reading(motion, scene)
    inner = inner_samples(flights, track)
    inner = inner[np.isfinite(omega[inner]).all(axis=1) & np.isfinite(track.v[inner]).all(axis=1)]
    plane = find_plane(track.v[inner], omega[inner], rig.radius, view.up) if given is None else given
    q, axis = in_plane(motion, plane)
    turned = fit(motion, replace(scene, plane=plane)).turned  # in the plane in which theta will be written
    if turned and not any(view.frame[:2]):
        angle = np.degrees(view.frame[2] + turned)
        notes.append(
            f"the impacts fit better if the shape is turned by {angle:.0f}° in its tracked frame (--frame "
            f"0,0,{angle:.0f}), as if the rigid body was defined while it lay askew"
        )
    if any(view.frame[:2]):
        # only the centre of mass flies freely: repeat with it in place of the tracked point
        (x, y, _), cos, sin = view.frame, np.cos(q[:, 2]), np.sin(q[:, 2])
        shift = np.outer(cos * x - sin * y, plane.x) + np.outer(sin * x + cos * y, plane.y)
        moved, view = replace(motion, position=motion.position + shift), replace(view, frame=(0.0, 0.0, view.frame[2]))
        return project(replace(recorded, motion=moved, view=view))
    q[:, 2] += view.frame[2]
    if rig.gravity is None:
        rig = replace(rig, gravity=float(f"{GRAVITY * np.cos(plane.tilt):.6g}"))
    normal = ", ".join(f"{value:.3f}" for value in plane.normal + 0.0)
    notes.append(
        f"plane of the motion {'found' if given is None else 'given'}: normal ({normal}) in the axes of the recording, "
        f"{np.degrees(abs(plane.tilt)):.1f}° off the vertical; gravity in it {rig.gravity:.4g} m/s²"
        + f"; theta is the angle of the body's {axis} axis"
        * motion.oriented
    )

    out, total = np.full(len(motion), np.nan), np.full(len(motion), np.nan)
    out[inner], total[inner] = share_out(track.v[inner], omega[inner], plane, rig.radius)
    height = rig.shape.gap(q[:, 1], q[:, 2], rig.surface_height or 0.0)
    drops = cut_drops(track, height, flights, rig.shape.extent) if view.cut else whole_pieces(recorded.piece, flights)
    drops, impacts = impact_shares(drops, motion.t, out, total, MOST_OUT)
    used = [drop for drop in drops if not drop.left_out]
    notes += _drops_text(drops, impacts, view.cut)
    if not used:
        why = recorded.no_drop(drops, height, rig.surface_height or 0.0)
        raise UserError(" ".join([why, *(f"{text}." for text in warnings)]))
    rows = np.concatenate([np.arange(drop.start, drop.stop) for drop in used])
    poses = pd.DataFrame(q[rows], columns=["x", "y", "theta"])[["x", "y", *(["theta"] if motion.oriented else [])]]
    poses = poses.assign(t=motion.t[rows], trial=np.repeat([d.trial for d in used], [d.stop - d.start for d in used]))
    dataset = as_dataset(poses, recorded.name, recorded.files, rig, notes)
    return Conversion(dataset, notes, warnings, Cuts(motion.t - motion.t[0], height, tuple(drops), impacts))


def _drops_text(drops: Sequence[Drop], impacts: pd.DataFrame, cut: bool) -> list[str]:
    """Sentences on the drops cut and left out, and on the energy out of the plane."""
    used = [drop for drop in drops if not drop.left_out]
    texts = [f"{len(drops)} drops cut out of the recording"] if cut else []
    worst = impacts[["energy_out_before", "energy_out_after"]].max(axis=1).groupby(impacts["trial"]).max()
    for reason in dict.fromkeys(drop.left_out for drop in drops if drop.left_out):
        trials = [drop.trial for drop in drops if drop.left_out == reason]
        shown = [f"{n} ({worst[n]:.0%} of its energy)" if reason == SPATIAL else str(n) for n in trials]
        texts.append(f"{len(trials)} of {len(drops)} trials left out, {reason}: {first_of(shown, 20)}")
    shares = worst[[drop.trial for drop in used if drop.trial in worst.index]]
    if len(shares):
        texts.append(
            f"energy out of the plane: {shares.median():.2%} in the median trial, {shares.max():.2%} at most "
            f"(trial {shares.idxmax()}); each impact in impacts_in_space.csv"
        )
    return texts
