"""Are units, gravity and orientation of a dataset in space consistent?  Heuristics that must not misfire on real drops.

Lengths are judged by speeds, by the body and by free fall; gravity by the flights, in the axes of the recording.
Quaternions that contradict the flights, jumps of the orientation and its loss give warnings only, since a critique can
identify a fault of the measurement as a cause.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.checks.copied_releases import copied_releases, copies_text
from thesis_lib.datasets.checks.jumps import NO_JUMPS, Jumps, place_jumps, turn_jumps
from thesis_lib.datasets.checks.known_body import FILE, LARGEST_BODY, LARGEST_SPEED, METRES, ONE_UNIT, unlike_column
from thesis_lib.datasets.checks.releases import OFF_SURFACE, height_at_hits, releases_and_catches
from thesis_lib.datasets.checks.trajectories import DENSEST, LARGEST_GRAVITY, runs_of
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.samples import Samples, noise_from_differences
from thesis_lib.datasets.format.table_forms import POSITION, QUATERNION, V_POST_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.datasets.format.validate import UsableRows, ValidationReport
from thesis_lib.datasets.space.falling_body import (
    RARELY,
    SCALES,
    better_reading,
    falling,
    reading_that_falls,
    settled_fall,
    too_few_fall,
)
from thesis_lib.datasets.space.flights import find_flights, follow, inner_samples
from thesis_lib.datasets.space.motion import PAUSE, Motion, conjugate
from thesis_lib.statistics.spread import robust_mean
from thesis_lib.statistics.wording import plural

FEWEST = 20  # samples needed to judge a motion
FEWEST_HITS = 5  # needed to judge the surface
OBLIQUE = np.radians(3.0)  # between stated and measured gravity; what is levelled by eye stays within
SLOWER, SURELY = 0.02, 4.0  # share, and standard errors, by which the fall may differ from gravity
CENTRAL = 5e-3  # m from the tracked point to the centre of mass, within which both fall alike
BY_CHANCE = 1e-3  # expected number of values that occur in so many trials
REPEATED = 0.2  # share of rows whose coordinate occurs in another row, too
LOST = 0.2  # share of lost orientations from which a warning is given
XYZW = [1, 2, 3, 0]  # of a quaternion with the scalar first
SCALAR_LAST = "as x, y, z, w (the scalar last)"
COPIED = "leave copies out: the held-out trials of a critique must be independent of its training trials"
REVERSED = "reversed (of a left-handed frame, or turning the world into the body)"


@dataclass(frozen=True)
class MotionFacts:
    """Findings from the samples: free flights, their median acceleration (m/s²), and faults of the poses.

    `held`: trials that begin before the release, with its time in s.  `in_the_air`: trials whose last flight ends off
    the surface, with that time in s: caught, out of view, or beyond the table's edge.  `hits`: flights that another one
    follows at once; `off_surface`: height in m of the body's lowest point at them, 0 if it is on the surface.
    `oblique`: direction (3,) of the fall, and number of the flights along it, if it is not that of gravity as stated.
    """

    flights: int
    fall: np.ndarray | None
    lost_orientation: float  # share of the samples
    turned: Jumps  # of the orientation
    moved: Jumps = NO_JUMPS  # of the tracked point
    reading: str = ""  # reading of the quaternions with which the body moves freely, "" for the stated one
    fall_error: float = 0.0  # m/s², standard error of the size of `fall`
    held: Mapping[int, float] = field(default_factory=dict)
    in_the_air: Mapping[int, float] = field(default_factory=dict)
    oblique: tuple[np.ndarray, int] | None = None
    hits: int = 0
    off_surface: float = 0.0


def motion_facts(table: pd.DataFrame, header: SpaceHeader) -> MotionFacts:
    """Findings from the samples of trajectories.csv, whose rows are complete and in order."""
    seen = np.isfinite(table["qw"].to_numpy(float))
    q, trial, t = (table[names].to_numpy(float) for names in (list(QUATERNION), "trial", "t"))
    facts = MotionFacts(0, None, float(np.mean(~seen)), turn_jumps(trial, t, q))
    g, rows = np.array(header.gravity), seen if seen.any() else ~seen
    size = float(np.linalg.norm(g))
    if rows.sum() < FEWEST or not size:
        return facts
    if seen.any():
        facts = replace(facts, reading=reading_that_falls(_motion(table[rows]), size))
    trial, t, place = one_clock(table[rows])
    moved = place_jumps(trial, t, place, q[rows] if seen.any() else None)
    facts = replace(facts, moved=replace(moved, rows=np.flatnonzero(rows)[moved.rows]))
    position = centre_path(table[rows], header)[1]
    track = follow(t, position, size)
    flights = find_flights(track, g)
    if not flights:
        return facts
    fall = np.nanmedian(track.a[inner_samples(flights, track)], axis=0)
    down = fall / np.linalg.norm(fall)
    along = np.array([np.nanmedian(track.a[inner_samples([flight], track)] @ down) for flight in flights])
    error = robust_mean(along)[1]
    if not facts.reading and seen.any() and header.tracked is not None:
        R = Rotation.from_quat(header.tracked.attitude, scalar_first=True).as_matrix()
        motion = replace(_motion(table[rows]), t=t, position=position)
        tensor = R.T @ header.body.inertia_per_mass @ R
        facts = replace(facts, reading=better_reading(motion, track, flights, tensor))
    held, in_the_air = releases_and_catches(table[rows], t, track, flights, header)
    if np.arccos(np.clip(down @ g / size, -1.0, 1.0)) > OBLIQUE:
        facts = replace(facts, oblique=settled_fall(track, g))
    facts = replace(facts, flights=len(flights), fall=fall, fall_error=error, held=held, in_the_air=in_the_air)
    hits, off = height_at_hits(table[rows], t, track, flights, header)
    return replace(facts, hits=hits, off_surface=off)


def _motion(table: pd.DataFrame) -> Motion:
    """The motion in complete rows, on one clock, with other readings of its quaternions."""
    q, (_, t, position) = table[list(QUATERNION)].to_numpy(float), one_clock(table)
    readings = {SCALAR_LAST: lambda: q, REVERSED: lambda: conjugate(q[:, XYZW])}
    readings[f"{SCALAR_LAST} and {REVERSED}"] = lambda: conjugate(q)
    return Motion("", "", t, position, q[:, XYZW], readings=readings)


def reading_of(table: pd.DataFrame, relabellings: Mapping[str, np.ndarray], gravity: float) -> str:
    """Name of the relabelling with which a body falls far better than with its quaternions as written; "" if none.

    Args:
        table: complete rows of trajectories.csv, sorted by trial and time.
        relabellings: P (4, 4) by name: the written quaternion is P times the true w, x, y, z.
        gravity: magnitude of gravity in m/s².
    """
    if len(table) < FEWEST:
        return ""
    q = table[list(QUATERNION)].to_numpy(float)
    readings = {name: lambda P=P: (q @ P)[:, XYZW] for name, P in relabellings.items()}
    return reading_that_falls(replace(_motion(table), readings=readings), gravity)


def centre_path(table: pd.DataFrame, header: SpaceHeader) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) in s on one clock, and positions (n, 3) in m of the believed centre of mass, which flies on parabolas.

    If the pose of the tracked frame in the body is unknown, the tracked point is used instead.
    """
    states = tracked_states(table)
    return one_clock(table)[1], (states if header.tracked is None else body_states(states, header)).position.T


def one_clock(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Trial (n,), time (n,) in s that rises over all trials, and position (n, 3) in m."""
    trial, t = table["trial"].to_numpy(), table["t"].to_numpy(float)
    first = np.flatnonzero(np.r_[True, trial[1:] != trial[:-1]][: len(t)])
    last = np.r_[first[1:], len(t)] - 1
    start = np.r_[0.0, np.cumsum(t[last] - t[first] + PAUSE)[:-1]] - t[first]
    return trial, t + np.repeat(start, last - first + 1), table[list(POSITION)].to_numpy(float)


def check_header(header: SpaceHeader, report: ValidationReport) -> None:
    """Report contradictions between size, inertia, mass, gravity and noise."""
    body, noise, extent = header.body, header.noise, header.body.solid.extent
    k = float(np.sqrt(np.linalg.eigvalsh(body.inertia_per_mass)[-1]))
    farthest = extent + float(np.linalg.norm(body.centre))
    if extent > LARGEST_BODY:
        what = f"the body reaches {extent:g} m from its origin, more than {LARGEST_BODY:g} m: millimetres?"
        report.error(FILE, "body.shape", what, METRES + "; for a mesh, by its scale")
    elif k > farthest:
        what = f"a radius of gyration of {k:g} m is larger than the body, which reaches {farthest:g} m"
        remedy = "give inertia in kg m² and mass in kg, or radii_of_gyration in m"
        report.error(FILE, "body.radii_of_gyration" if body.radii_of_gyration else "body.inertia", what, remedy)
    elif body.mass is not None and body.mass > DENSEST * (2.0 * extent) ** 3:
        what = f"{body.mass:g} kg would be denser than any metal for a body of {2 * extent:g} m: grams?"
        report.warn(FILE, "body.mass", what, "give the mass in kg")
    if np.linalg.norm(header.gravity) > LARGEST_GRAVITY:
        report.error(FILE, "gravity", "is more than on any planet", "give it in m/s² ([0, 0, -9.81] on Earth)")
    if noise is not None and noise.position is not None and max(noise.position) > extent:
        what = f"{max(noise.position):g} m is larger than the body: millimetres?"
        report.error(FILE, "noise.position", what, "give it in m")
    if noise is not None and noise.rotation is not None and noise.rotation > 1.0:
        report.warn(FILE, "noise.rotation", f"{noise.rotation:g} rad is most of a turn: degrees?", "give it in rad")


def check_motion(table: UsableRows, header: SpaceHeader) -> None:
    """Report wrong units and a wrong direction of gravity, and doubts about orientations."""
    trial, t, position = one_clock(table.data)
    within = trial[1:] == trial[:-1]
    speed = (np.linalg.norm(np.diff(position, axis=0), axis=1) / np.diff(t))[within]
    if len(t) < FEWEST or not len(speed):
        return
    if (fast := float(np.quantile(speed, 0.9))) > LARGEST_SPEED:
        what = f"look like millimetres or centimetres (speeds reach {fast:.0f} m/s)"
        return table.error("columns x, y, z", what, METRES)
    noise = noise_from_differences(Samples(trial, t, position, runs_of(trial, t)))
    if found := unlike_column(noise, position, header.body.solid.extent):
        return table.error(f"column {POSITION[found[0]]}", found[1], ONE_UNIT)
    g, facts = np.array(header.gravity), motion_facts(table.data, header)
    if g.any() and too_few_fall(facts.flights, len(np.unique(trial))) and _wrong_length(table, header):
        return None
    if g.any() and not facts.flights:
        _nothing_falls(table, header)
    elif facts.oblique is not None:
        down, number = facts.oblique
        off = np.arccos(np.clip(down @ g / np.linalg.norm(g), -1.0, 1.0))
        shown = ", ".join(f"{value:.3f}" for value in down * np.linalg.norm(g))
        what = f"{_fall(number)} {np.degrees(off):.1f}° off the stated gravity"
        table.report.warn(
            FILE, "gravity", what, f"if the axes of the recording are not level, write gravity: [{shown}]"
        )
    elif facts.flights:
        _check_fall(table, header, facts, float(np.median(np.diff(t)[within])))
    if facts.reading:
        what = f"in free flight the body does not move like a free body; if read {facts.reading}, it does"
        table.warn("columns qw, qx, qy, qz", what, "find out how the recording was written, and convert it")
    if facts.hits >= FEWEST_HITS and (off := facts.off_surface):
        side = "below" if off < 0.0 else "above"
        what = f"at {facts.hits} hits the lowest point of the body is {abs(off):.3g} m {side} the surface (median)"
        table.warn("columns x, y, z", what, "check the surface, the shape, `tracked`, and the unit of length")
    _check_jumps(table, facts)
    _check_repeated(table)
    if copies := copied_releases(trial, t, position @ header.planes[0][1]):
        table.warn("column trial", copies_text(copies), COPIED)
    if LOST < facts.lost_orientation < 1.0:
        what = f"the orientation is lost in {facts.lost_orientation:.0%} of the samples"
        table.warn(
            "columns qw, qx, qy, qz",
            what,
            "none needed if the tracker lost it: hits and flights are found without such rows",
        )


def _check_repeated(table: UsableRows) -> None:
    """Report coordinates that trials share to the last digit, if more of them than rounding makes equal by chance.

    If a share r of N rows repeats another row, about N r^(m − 1) values occur in m rows by chance; r is that of all
    other values, and of one pair more, as few rows may have none.
    """
    for axis in POSITION:
        values = table.data[axis]
        trials = table.data.groupby(axis)["trial"].nunique()
        value = trials.idxmax()
        equal = (values == value).to_numpy()
        share = (values[~equal].duplicated(keep=False).sum() + 2) / len(values)
        if share > REPEATED:
            continue  # written with few digits, or without noise
        if trials.max() > 2 and len(values) * share ** (trials.max() - 1) < BY_CHANCE:
            what = f"{value:.9g} occurs in {trials.max()} trials, to the last digit: it was set, not measured"
            remedy = "remove such rows: the body at rest in them was assumed, not measured"
            table.warn(f"column {axis}", what, remedy, equal)


def _check_fall(table: UsableRows, header: SpaceHeader, facts: MotionFacts, step: float) -> None:
    """Report bodies that fall faster or slower than the stated gravity."""
    assert facts.fall is not None
    size, stated = float(np.linalg.norm(facts.fall)), float(np.linalg.norm(header.gravity))
    if abs(size - stated) > max(SLOWER * stated, SURELY * facts.fall_error):
        clock = np.sqrt(stated / size)
        what = (
            f"{_fall(facts.flights)} by {size:.3g} m/s², but gravity is stated as {stated:.3g}: perhaps the "
            f"frames were taken at {clock / step:.4g} Hz and not at the {1.0 / step:.4g} Hz of their times, or the "
            f"lengths are {abs(size / stated - 1.0):.1%} too {'large' if size > stated else 'small'}"
        )
        table.warn("columns t, x, y, z", what, "correct the times, the lengths, or gravity")


def _fall(flights: int) -> str:
    """Text: 12 free flights fall."""
    return f"{plural(flights, 'free flight')} fall{'s' * (flights == 1)}"


def _check_jumps(table: UsableRows, facts: MotionFacts) -> None:
    """Report jumps of the orientation (a tag flips) and of the position (another tag takes over)."""
    turned, moved, n = facts.turned, facts.moved, len(table.data)
    by, off = f"{np.degrees(turned.size):.0f}°", f"{1e3 * moved.size:.2g} mm"
    empty = "`critique` leaves out samples whose orientation soon jumps back; leave other wrong orientations empty"
    one = "use one tag throughout, or remove such samples"
    for jumps, name, size, why, where, remedy in (
        (turned, "orientation", by, "a tag flips", "columns qw, qx, qy, qz", empty),
        (moved, "position", off, "another tag takes over", "columns x, y, z", one),
    ):
        if jumps is moved and len(moved.rows) == 1:
            continue  # in tens of thousands of samples, one hit may look like a jump
        what = (
            f"the {name} jumps at {len(jumps.rows)} of {n} samples, by {size} (median), and {jumps.share:.1%} of the "
            f"samples lie between a jump and the jump back: {why}, or markers are swapped"
        )
        table.warn(where, what, remedy, np.isin(np.arange(n), jumps.rows))


def _falling(table: UsableRows, header: SpaceHeader) -> tuple[str, np.ndarray, int] | None:
    """Free flights along any direction, in any unit, as of `falling`."""
    turned = np.isfinite(table.data["qw"].to_numpy(float))
    path = centre_path(table.data[turned if turned.any() else ~turned], header)
    size = float(np.linalg.norm(header.gravity))
    return falling(*path, size) if len(path[0]) >= FEWEST else None


def _wrong_length(table: UsableRows, header: SpaceHeader) -> bool:
    """Report lengths in another unit; return whether they are."""
    if (found := _falling(table, header)) is None or not found[0]:
        return False
    unit, _, number = found
    faster = float(np.linalg.norm(header.gravity)) / SCALES[unit]
    what = f"look like {unit}: with this unit {_fall(number)}; as written, by {faster:.3g} m/s²"
    table.error("columns x, y, z", what, f"multiply them by {SCALES[unit]:g}, or correct --units of the init command")
    return True


def _nothing_falls(table: UsableRows, header: SpaceHeader) -> None:
    size, found = float(np.linalg.norm(header.gravity)), _falling(table, header)
    if found is None or found[2] <= RARELY * table.data["trial"].nunique():  # so few may be chance
        what = f"no free flight is seen: nowhere does the body accelerate by {size:.3g} m/s²"
        return table.warn("columns x, y, z", what, "check the units of length and time, and gravity")
    _, down, number = found
    shown = ", ".join(f"{value:.3g}" for value in size * down + 0.0)
    what = f"nothing falls along the stated gravity; {_fall(number)} along [{shown}]"
    # a tracked point off the centre of mass falls in another direction if tracked or the quaternions are wrong
    tracked, centre = header.tracked, header.body.centre
    sure = tracked is not None and np.linalg.norm(centre - np.array(tracked.position)) < CENTRAL
    say = table.report.error if sure else table.report.warn
    return say(FILE, "gravity", what, f"write gravity: [{shown}], in the axes of the recording")


def check_hits(table: UsableRows, header: SpaceHeader) -> None:
    """Report wrong units of velocities, and hits that do not lie on a surface or do not approach it."""
    v = table.data[list(V_PRE_IN_SPACE + V_POST_IN_SPACE)].to_numpy(float)
    if np.quantile(np.abs(v[:, [0, 1, 2, 6, 7, 8]]).max(axis=1), 0.9) > LARGEST_SPEED:
        return table.error("columns v*_pre, v*_post", "look like millimetres or centimetres per second", METRES)
    if header.tracked is None or header.surfaces is not None:
        return None
    (frame,) = surface_frames(header)
    state = frame.seen(body_states(tracked_states(table.data, V_PRE_IN_SPACE), header))
    solid = header.body.solid.about(header.body.centre)
    r = solid.lowest(state.attitude)
    gap = np.abs(state.height + r[2])
    if float(np.median(gap)) > OFF_SURFACE * solid.extent:
        what = f"at the hits the lowest point of the body is {np.median(gap):.3g} m off the surface (median)"
        table.warn("columns x, y, z", what, "check the surface, the shape, `tracked`, and the unit of length")
    elif np.mean(state.space.velocity_at(state.velocity, state.spin, r)[2] >= 0.0) > 0.5:
        what = "the contact point does not approach the surface before the impact in most rows"
        table.warn("columns v*_pre and w*_pre", what, "check the normal of the surface, and that _pre is before _post")
    return None
