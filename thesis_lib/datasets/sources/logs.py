"""Conversion of any log of a rig into a dataset: the form of its files, their reader, and the use of the options."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from thesis_lib.bodies.mesh import Mesh
from thesis_lib.datasets.checks.known_body import LARGEST_BODY
from thesis_lib.datasets.format.samples import PART, Samples, sampling_period
from thesis_lib.datasets.samples.stamps import times_of_pictures
from thesis_lib.datasets.sources.conversion import Conversion, Recorded, View
from thesis_lib.datasets.sources.kept_in_space import keep_in_space
from thesis_lib.datasets.sources.motion_capture import bags, c3d, motive, qualisys, tensors, vicon
from thesis_lib.datasets.sources.motion_capture.export_cells import SEQUENCES
from thesis_lib.datasets.sources.projected import project
from thesis_lib.datasets.sources.rig_log import FLAT, convert_logs, read_planar_motions
from thesis_lib.datasets.sources.tables.log_table import read_log
from thesis_lib.datasets.sources.tables.options import PARTS, SPATIAL, Reading, parse_direction, parse_numbers
from thesis_lib.datasets.sources.tables.pose import ORDERS, read_quaternion_tables
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, needs_no_angle
from thesis_lib.datasets.space.motion import Motion, handed, join, refuse_equal_times, together
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import is_file

TABLE, BAG, C3D, TENSORS = "a table", "a bag of ROS", "a C3D file", "a file of tensors"
EXPORTS = {  # form of a text file -> pattern of its beginning, reader
    "an export of Motive": (motive.BEGINS, motive.read_motive),
    "an export of Vicon": (vicon.BEGINS, vicon.read_vicon),
    "an export of Qualisys": (qualisys.BEGINS, qualisys.read_qualisys),
    "an older export of OptiTrack": (motive.BEGINS_OLDER, motive.read_optitrack),
}
Y_UP = ("an export of Motive", "an older export of OptiTrack")  # in all others z is up
# options that apply to one kind of log only
ONLY_TABLES = ("columns", "quaternion", "rate", "delimiter", "decimal", "units", "scale", "origin")
FARTHEST = 10.0  # m from a tracked frame to the centre of mass; larger values are in mm
ONLY_SPACE = ("left_handed", "rotation", "up", "plane")
ONLY_PLANE = ("origin", "wall")
OF_TENSORS = ("columns", "quaternion", "rate", "units", "scale")  # those of `ONLY_TABLES` that apply to tensors, too


def convert(
    files: Sequence[str | Path],
    name: str,
    rig: RigOptions,
    reading: Reading,
    say: Callable[[str], None] = lambda text: None,
) -> Conversion:
    """The dataset of logs of one form; UserError if they cannot be read, or an option does not apply to their form.

    `say` receives a line for each step.
    """
    paths = [Path(file) for file in files]
    forms = {path: form_of(path) for path in paths}
    say(f"reading {paths[0].name}")
    form = forms[paths[0]]
    if other := next((path for path in paths if forms[path] != form), None):
        raise UserError(f"{paths[0]} is {form}, but {other} is {forms[other]}; convert them one after the other.")
    reading = replace(reading, rate=rig.rate)
    in_space = form != TABLE or reading.quaternion is not None or _holds_points(paths[0], reading)
    _check_options(paths[0], form, in_space, rig, reading)
    frame = _parse_frame(reading.frame) if reading.frame else (0.0, 0.0, 0.0)
    notes: list[str] = []
    warnings: list[str] = []
    if reading.tracked and not rig.in_space:
        raise UserError("--tracked is for shapes in space; for a planar shape, give the tracked frame with --frame.")
    if rig.in_space:
        _check_solid(paths[0], in_space, rig, reading)
    if not in_space and not reading.cut:
        return convert_logs(paths, name, reading, rig, frame)
    if not in_space:
        motions = read_planar_motions(paths, reading, rig, notes, warnings)
        view = View(FLAT.y, FLAT.normal, frame, flat=True)
    else:
        if form == TENSORS:
            motions = tensors.read_tensors(paths, reading, notes)
            reading = replace(reading, per_trial_files=reading.cut is None and "trial" not in reading.columns)
        elif form == TABLE:
            motions = read_quaternion_tables(paths, reading, notes, warnings)
        elif form == BAG:
            motions = [bags.read_bag(path, reading.body, warnings) for path in paths]
        elif form == C3D:
            motions = [c3d.read_c3d(path, reading.body, notes) for path in paths]
        else:
            _, read = EXPORTS[form]
            motions = [read(path, reading.body, reading.rotation, notes) for path in paths]
        if reading.per_trial_files:
            motions = [replace(motion, trial=None) for motion in motions]
        view = _view(form, reading, frame, all(motion.trial is not None for motion in motions))
    say("looking for free flights" + " and the tracked frame" * rig.in_space)
    conversion = convert_motions(motions, name, paths, rig, view, notes)
    conversion.warnings += warnings
    return conversion


def form_of(path: Path) -> str:
    """The form of a log, from the ending of its name or, for a text file, from its first line."""
    if bags.is_bag(path):
        return BAG
    if tensors.holds_tensors(path):
        return TENSORS
    if not is_file(path):
        return TABLE
    try:
        with path.open("rb") as file:
            raw = file.readline(1000)
    except OSError:
        return TABLE
    if c3d.is_c3d(path, raw):
        return C3D
    first = raw.decode("utf-8-sig", "replace")
    return next((form for form, (begins, _) in EXPORTS.items() if begins.match(first)), TABLE)


def _holds_points(path: Path, options: Reading) -> bool:
    """Whether a table has positions x, y, z but neither an angle nor a quaternion, as for a tracked ball.

    UserError if it has the columns of a quaternion, which --quaternion must declare.
    """
    if "z" in options.columns or "theta" in options.columns:
        return not {"theta", *SPATIAL[1:], *PARTS} & set(options.columns)
    places = {name for name, _ in options.source("x", "y", "z").values()}
    log = read_log(path, options, places, [])
    if log.has("theta") or len(places) < 3 or not all(map(log.has, places)):
        return False
    if all(map(log.has, ("qx", "qy", "qz", "qw"))):
        raise UserError(
            f"{path} has columns qx, qy, qz, qw: give --quaternion xyzw if they are a quaternion, or --columns "
            "theta=NAME for the column with the angle of a planar motion."
        )
    return True


def _check_options(path: Path, form: str, in_space: bool, rig: RigOptions, reading: Reading) -> None:
    """UserError for an option that does not apply to this form of log, or a shape that no rig can hold."""
    if not isinstance(rig.shape, Mesh) and rig.shape.extent > LARGEST_BODY:
        raise UserError(
            f"--shape: the {rig.shape.kind} reaches {rig.shape.extent:.3g} m from its centre: millimetres? --shape of "
            "the init command is in m, whatever the --units of the log: edges and heights in full length, radii and "
            "semi-axes."
        )
    given = {"wall"} if rig.walls else set()
    given |= {name for name in (*ONLY_TABLES, *ONLY_SPACE) if getattr(reading, name)}
    if form != TABLE and (
        useless := [name for name in ONLY_TABLES if name in given and not (form == TENSORS and name in OF_TENSORS)]
    ):
        raise UserError(f"--{useless[0]} is for tables; {path} is {form}, which contains this information.")
    if not in_space and (useless := [name for name in ONLY_SPACE if name in given]):
        option = useless[0].replace("_", "-")
        forms = "an export of motion capture, a bag, a table with --quaternion or with columns x, y, z and no angle"
        raise UserError(f"--{option} is for motions in space ({forms}); {path} is a planar table.")
    if in_space and (useless := [name for name in ONLY_PLANE if name in given]):
        raise UserError(f"--{useless[0]} is for planar tables; {path} is a motion in space.")
    if rig.walls and reading.cut:
        raise UserError("--cut looks for free falls; leave it out where the body moves between walls (--wall).")
    if reading.quaternion is not None and reading.quaternion not in ORDERS:
        raise UserError(f"--quaternion: '{reading.quaternion}' is unknown; give {' or '.join(ORDERS)}.")
    if reading.rotation is not None and reading.rotation not in SEQUENCES:
        raise UserError(f"--rotation: '{reading.rotation}' is unknown; give one of {', '.join(SEQUENCES)}.")


def _check_solid(path: Path, in_space: bool, rig: RigOptions, reading: Reading) -> None:
    """UserError for options that do not apply to a shape in space."""
    if not in_space:
        raise UserError(
            f"--shape: a {rig.shape.kind} is a body in space, but {path} is read as a planar table. If it has "
            "quaternions, give --quaternion xyzw or wxyz, and name its columns with --columns "
            "x=…,y=…,z=…,qx=…,qy=…,qz=…,qw=… where they differ."
        )
    given = {"plane": reading.plane, "frame": reading.frame, "k-g": rig.k_g}
    if useless := [name for name, value in given.items() if value is not None]:
        raise UserError(
            f"--{useless[0]} is for planar shapes; for a {rig.shape.kind} in space, edit dataset.yaml after conversion "
            "(inertia, tracked and surface)."
        )


def _view(form: str, reading: Reading, frame: tuple[float, float, float], named: bool) -> View:
    """Settings for the interpretation of the motion; `named`: the recordings state the trial of each sample."""
    return View(
        up=parse_direction(reading.up or ("y" if form in Y_UP else "z"), "--up"),
        normal=parse_direction(reading.plane, "--plane") if reading.plane else None,
        frame=frame,
        cut=not (named or reading.per_trial_files) if reading.cut is None else reading.cut,
        left_handed=reading.left_handed,
        up_is_given=reading.up is not None,
        tracked=reading.tracked is None,
        units=reading.si.given if form in (TABLE, TENSORS) else None,
    )


def _parse_frame(text: str) -> tuple[float, float, float]:
    """'X,Y,ANGLE' in m, m and degrees -> m, m, rad."""
    mistake = f"--frame: '{text}' is not X,Y,ANGLE in m, m and degrees (for example 0.004,-0.001,45)."
    x, y, turn = parse_numbers(text, 3, mistake)
    if max(abs(x), abs(y)) > FARTHEST:
        raise UserError(mistake)
    return x, y, float(np.radians(turn))


def convert_motions(
    motions: Sequence[Motion], name: str, files: Sequence[str | Path], rig: RigOptions, view: View, notes: list[str]
) -> Conversion:
    """A dataset of trajectories from the motions of one body, one motion per recording; adds to `notes`.

    The motion of a shape in space stays in space; any other is projected into its plane.  UserError if no free flight
    or no plane is found, rotations fit far better in another reading, or no drop is left.
    """
    rows = sum(map(len, motions))
    motions = [motion.distinct() for motion in motions]
    samples = sum(map(len, motions))
    if repeated := rows - samples:
        notes.append(f"{repeated} of {rows} samples left out: they repeat the one before, with its time")
    if not motions[0].oriented:
        needs_no_angle(rig.shape, motions[0].source)
    motion, piece = join([handed(motion, view.left_handed) for motion in motions], placed=rig.in_space)
    if len(motion) < samples:
        notes.append(f"{samples - len(motion)} of {samples} samples left out: the body was not seen")
    if unturned := int(np.sum(~motion.seen)):
        notes.append(
            f"{unturned} of {samples} samples have a position but no orientation: they are kept as rows without one"
        )
    piece = piece if view.cut else _as_named(motion, piece, notes)
    motion, piece = _at_exposure(motion, piece, rig.rate, notes)
    if together(np.diff(motion.t)[piece[1:] == piece[:-1]]).any():
        refuse_equal_times(motions, rig.in_space)
    try:
        recorded = Recorded(motion, piece, name, files, rig, view, notes)
        return keep_in_space(recorded) if rig.in_space else project(recorded)
    except UserError as error:
        text = str(error)
        raise error if str(files[0]) in text or text.startswith("--") else UserError(f"{files[0]}: {text}") from None


def _as_named(motion: Motion, piece: np.ndarray, notes: list[str]) -> np.ndarray:
    """The pieces with the numbers of the trials in the recording, if it has different ones; adds to `notes` if not."""
    if motion.trial is None:
        return piece
    names = motion.trial[np.flatnonzero(np.diff(piece, prepend=-1))].tolist()
    numbers = [int(name.partition(".")[0]) for name in names if re.fullmatch(r"\d{1,15}(\.0*)?", name)]
    if len(set(numbers)) == len(names):
        return np.array(numbers)[piece]
    notes.append(f"trials numbered in order of appearance: 0 = {names[0]}, …, {len(names) - 1} = {names[-1]}")
    return piece


def _at_exposure(motion: Motion, piece: np.ndarray, rate: float | None, notes: list[str]) -> tuple[Motion, np.ndarray]:
    """The motion at the times of exposure, if its stamps are times of arrival; as for the trials of a dataset.

    A long recording is treated in parts, because the delay common to all rows drifts.
    """
    first = np.flatnonzero(np.r_[True, np.diff(piece) != 0])
    row = np.arange(len(piece)) - np.repeat(first, np.diff(np.r_[first, len(piece)]))
    part = np.cumsum(row % PART == 0)
    samples = Samples(part, motion.t, motion.position, piece)  # rows after a part help to count its lost frames
    found = times_of_pictures(samples, rate or 1.0 / sampling_period(motion.t, piece), lengths=3)
    if found is None:
        return motion, piece
    sure, t, said = found
    notes.append(said)
    rises = t > np.maximum.accumulate(np.r_[-np.inf, t[:-1]])  # a part that counts one frame too many overlaps the next
    rows = np.flatnonzero(sure)[rises]
    return replace(motion.part(rows), t=t[rises]), piece[rows]
