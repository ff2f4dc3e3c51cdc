"""Import of a recording: the recorded motion in space, and the resulting dataset with notes and warnings.

`Conversion.notes` lists everything that was changed or left out, `Conversion.warnings` possible faults of a log.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import ValidationError

from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS, Dataset, unwrap
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.header_file import Model
from thesis_lib.datasets.format.samples import sampling_period
from thesis_lib.datasets.format.validate import first_of
from thesis_lib.datasets.sources.other_units import other_units
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, needs_no_angle
from thesis_lib.datasets.space.drops import SPATIAL, Cuts, Drop
from thesis_lib.datasets.space.falling_body import falling, too_few_fall
from thesis_lib.datasets.space.flights import too_slow
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.datasets.space.tracked_frame import TrackedFrame
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.mistakes import message
from thesis_lib.statistics.wording import plural

MOST_OUT = 0.05  # trials with a larger share of their energy out of the plane are left out
FRAMES, SMOOTHED = 5, 0.7  # a parabola through so many frames of a flight shows at least this share of gravity
READ = 8  # frames of a flight that is found also in a slow recording; six are not
STRAIGHT = 0.99  # a direction with a larger component along an axis is taken as that axis
NEAR_UP = 0.9  # cosine of the angle between the fall and the downward axis, from which on the upward axis is right
_OPTIONS = {"size": "homogeneous", "body": "shape"}  # keys of dataset.yaml whose option has another name


@dataclass(frozen=True, eq=False)
class View:
    """Settings for the interpretation of a motion in space.

    `up` (3,) points against gravity; `normal` (3,) is normal to the plane of motion (None: found from the motion).
    `frame` locates the body in its tracked frame: x, y (m) of the centre of mass, and the angle (rad) of the shape.
    `cut`: whether recordings are cut into drops; otherwise each recording, or each trial that it names, is one trial.
    """

    up: np.ndarray
    normal: np.ndarray | None = None
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cut: bool = True
    left_handed: bool = False
    up_is_given: bool = True  # otherwise `up` is the usual axis of the file format
    tracked: bool = True  # estimate the tracked frame of a shape in space; otherwise it is the frame of the shape
    flat: bool = False  # a planar table, whose axes are those of the plane
    units: Mapping[str, str] | None = None  # those of --units by quantity; None if the file states its units


@dataclass(frozen=True, eq=False)
class Recorded:
    """The samples in which one body was seen, and the information for their conversion.

    `piece` (n,) is the recording or trial of each sample, `name` the name of the dataset; `notes` collects all changes.
    """

    motion: Motion
    piece: np.ndarray
    name: str
    files: Sequence[str | Path]
    rig: RigOptions
    view: View
    notes: list[str]

    def no_flight(self) -> str:
        """Advice for a recording without a free flight in the expected direction."""
        motion, gravity = self.motion, self.rig.g
        if text := self._wrong_units():
            return text
        step = sampling_period(motion.t, self.piece)
        if slow := too_slow(1.0 / step):
            return (
                f"no free flight is found along the upward axis. {slow} Record at 100 Hz or more.{self._smoothed()} "
                f"Tosses that fall freely for {READ} frames ({READ * step:.2g} s) or more are read at this rate, too: "
                "critique then shows gravity with drag, and rests; in space, rollout compares whole tosses with a "
                "model from a faster recording."
            )
        if found := falling(motion.t, motion.position, gravity, {"": 1.0}):
            _, down, number = found
            there = f"there {'is' if number == 1 else 'are'} {plural(number, 'free flight')}"
            return f"nothing falls along the axis given as up; {there} with --up {_axis(-down)}."
        return (
            f"it contains no free flight: the body never accelerates by {gravity:g} m/s² along an axis. Check "
            "the units of length and time; for an inclined plane give --plane, and --gravity if that differs."
        )

    def require(self, flights: Sequence[slice]) -> None:
        """UserError if the recording has no free flight, or far more of them in other units."""
        if not flights:
            raise UserError(self.no_flight())
        if too_few_fall(len(flights), len(np.unique(self.piece))) and (text := self._wrong_units()):
            raise UserError(text)

    def _wrong_units(self) -> str:
        """Advice if bodies fall only with other units of length or time; "" if not."""
        found = other_units(self.motion, self.piece, self.rig.g, self.view.units)
        if found is None:
            return ""
        looks, options, down = found
        if down is not None and -down @ self.view.up < NEAR_UP:
            options.append(f"--up {_axis(-down)}")
        return f"{looks}. Give {' and '.join(options)}." if options else f"{looks}."

    def _smoothed(self) -> str:
        """Sentence for recordings in which no body falls freely over `FRAMES` frames; "" for all others."""
        most = []
        for piece in np.unique(self.piece):
            t, position = self.motion.t[self.piece == piece], self.motion.position[self.piece == piece]
            windows = [slice(i, i + FRAMES) for i in range(len(t) - FRAMES + 1)]
            if windows:
                a = 2.0 * np.array([np.polyfit(t[part] - t[part.start], position[part], 2)[0] for part in windows])
                rise = a @ self.view.up
                across = np.linalg.norm(a - rise[:, None] * self.view.up, axis=1)
                most.append(max(-rise.min(), across.max()))  # also across, in case another axis is up
        fastest = float(np.median(most)) if most else self.rig.g
        if fastest > SMOOTHED * self.rig.g:
            return ""
        return (
            f" Over {FRAMES} frames the body falls with {fastest:.1f} m/s² at most (median of {len(most)} recordings), "
            f"instead of {self.rig.g:g}: the positions were smoothed, the body was not released, or it flew for less."
        )

    def no_drop(self, drops: Sequence[Drop], height: np.ndarray, surface: float) -> str:
        """Advice if no drop can be used; `height` (n,) in m is that of the body's lowest point above `surface` in m."""
        if all(drop.left_out == SPATIAL for drop in drops):
            return (
                f"all {len(drops)} trials have more than {MOST_OUT:.0%} of their energy out of the plane: the "
                "motion is not planar, or the rotations are read in the wrong convention (order, handedness, "
                "sequence of angles)."
            )
        ends = [height[drop.flights[-1].stop - 1] for drop in drops if drop.flights]
        low = float(np.median(ends))
        return (
            f"none of {len(drops)} drops reaches the surface: their falls end {low:.3f} m above it (median). Is the "
            f"surface at {surface + low:.3f} m (--surface-height)? Are the shape and --frame right?"
        )


def _axis(direction: np.ndarray) -> str:
    """A direction (3,) as the value of --up: an axis if it is one."""
    axis = int(np.abs(direction).argmax())
    if abs(direction[axis]) > STRAIGHT:
        return ("-" if direction[axis] < 0.0 else "") + "xyz"[axis]
    return ",".join(f"{value:.3f}" for value in direction + 0.0)


def sampling_rate(rig: RigOptions, t: np.ndarray, piece: np.ndarray) -> float | None:
    """Sampling rate in Hz: as stated, else of times `t` (n,) in s within the recordings `piece` (n,); None if unknown.

    Single steps do not show it, because time stamps may have few digits.
    """
    period = np.nan if rig.rate is not None else sampling_period(t, piece)
    return float(f"{1.0 / period:.6g}") if period > 0.0 else rig.rate


@dataclass
class Conversion:
    """A converted log; `notes` and `warnings` are sentences, `cuts` the drops found in a motion in space."""

    dataset: Dataset
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    cuts: Cuts | None = None


def as_dataset(
    poses: pd.DataFrame, name: str, files: Sequence[str | Path], rig: RigOptions, notes: list[str]
) -> Dataset:
    """The dataset of complete poses (`TRAJECTORY_COLUMNS`, SI) from `files`; adds to `notes`.

    UserError if a value of the experiment is impossible, or theta is missing for a shape other than a disk.
    """
    has_angle = "theta" in poses
    if not has_angle:
        needs_no_angle(rig.shape, str(files[0]))
        notes.append(
            "theta is not measured: trajectories.csv lacks it, and the spin of the body stays unknown. The radius of "
            f"gyration of a solid ball would be {0.4**0.5 * rig.shape.extent:.5g} m (--k-g)"
        )
    poses = poses.assign(**({} if has_angle else {"theta": 0.0}))[list(TRAJECTORY_COLUMNS)]
    poses["t"] -= poses.groupby("trial", sort=False)["t"].transform("first")
    before = poses["theta"].to_numpy(copy=True)
    poses["theta"] = unwrap(before, poses["trial"].to_numpy())
    if wrapped := int(np.sum(before != poses["theta"].to_numpy())):
        notes.append(f"theta made continuous within trials ({wrapped} rows moved by whole turns)")

    lamina = rig.shape.radius_of_gyration
    body: dict = {"shape": rig.shape, "mass": rig.mass, "radius_of_gyration": rig.radius}
    if rig.size_uncertainty is not None:
        body |= {"homogeneous": True, "uncertainty": {"size": rig.size_uncertainty}}
    elif rig.k_g is None:
        notes.append(f"radius of gyration {lamina:.5g} m, as of a uniform lamina (--k-g to change)")
    if rig.walls and rig.gravity is None:
        notes.append("gravity 0, as for a motion seen from above (--gravity 9.81 for walls seen from the side)")
    content = {
        "schema": 1,
        "description": _description(files),
        "body": body,
        **({"surfaces": rig.walls} if rig.walls else {"surface": {"height": rig.surface_height or 0.0}}),
        "gravity": rig.g,
        "rate": sampling_rate(rig, poses["t"].to_numpy(), poses["trial"].to_numpy()),
    }
    return Dataset(name, _validated(Header, content), poses, has_angle=has_angle)


def solid_dataset(
    recorded: Recorded, up: np.ndarray, found: TrackedFrame | None = None, height: float = 0.0
) -> Dataset:
    """The dataset of a body in space, without its tables; `up` (3,) points against gravity.

    Tracked frame and surface are taken from `found`, except for a surface of given height.  Without `found`, the
    tracked frame is the frame of the shape, and the surface is at the given height, or at `height` in m along `up`.

    UserError if a value of the experiment is impossible, or a mesh is not closed.
    """
    rig, motion = recorded.rig, recorded.motion
    body: dict = {"shape": rig.shape, "mass": rig.mass}
    body |= {"homogeneous": True} if rig.radii_of_gyration is None else {"radii_of_gyration": rig.radii_of_gyration}
    if rig.center_of_mass is not None:
        body["center_of_mass"] = rig.center_of_mass
    if rig.size_uncertainty is not None:
        body["uncertainty"] = {"size": rig.size_uncertainty}
    point, normal = (height if rig.surface_height is None else rig.surface_height) * up, up
    if found is not None and rig.surface_height is None:
        point, normal = found.point, found.normal
    content = {
        "schema": 2,
        "description": _description(recorded.files),
        "body": body,
        **({} if found is None else {"tracked": found.tracked}),
        "surface": {"point": tuple(point), "normal": tuple(normal)},
        "gravity": tuple(-rig.g * up),
        "rate": sampling_rate(rig, motion.t, recorded.piece),
    }
    return Dataset(recorded.name, _validated(SpaceHeader, content))


def _description(files: Sequence[str | Path]) -> str:
    return f"converted from {first_of([Path(file).name for file in files], 1)}"


def _validated(model: type[Model], content: dict) -> Model:
    """The header with this content; a UserError names the option whose value is impossible."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        mistake = error.errors()[0]
        key, what = str(mistake["loc"][-1]), message(mistake)
        value = "" if isinstance(mistake["input"], dict) else f"{mistake['input']}: "
        option = f"--{_OPTIONS.get(key, key.replace('_', '-'))}"
        where = "the surface (--surface-height)" if key == "surface" else option
        raise UserError(f"{where}: {value}{what}{'' if what.endswith('?') else '.'}") from error
