"""A motion in space that is to become a dataset: its samples, how it is looked at, and what is believed of its rig."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thesis_lib.datasets.sources.tables.rig_options import RigOptions
from thesis_lib.datasets.space.drops import SPATIAL, Drop
from thesis_lib.datasets.space.flights import too_slow
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.datasets.space.torque_free import falling

MOST_OUT = 0.05  # share of the energy out of the plane from which on a trial is left out
PART = 100  # samples within which a clock of arrival wanders by less than it jitters
FRAMES, SMOOTHED = 5, 0.7  # frames whose parabola, in a flight, has this share of gravity at least
STRAIGHT = 0.99  # share of a direction along an axis, from which on it is that axis


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


@dataclass(frozen=True, eq=False)
class Recorded:
    """The seen samples of one body, `piece` (n,) the recording or the trial of each, and what is said of them.

    `name` is that of the dataset; `notes` grow by what is changed or left out.
    """

    motion: Motion
    piece: np.ndarray
    name: str
    files: Sequence[str | Path]
    rig: RigOptions
    view: View
    notes: list[str]

    def no_flight(self) -> str:
        """Advice where nothing falls as it should."""
        motion, gravity = self.motion, self.rig.g
        if slow := too_slow(1.0 / long_period(motion.t, self.piece)):
            return (
                f"no free flight is found along the axis that is up. {slow} Record at 100 Hz or more.{self._smoothed()}"
            )
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

    def _smoothed(self) -> str:
        """What it means where no recording falls over `FRAMES` frames as a free body does; "" elsewhere."""
        most = []
        for piece in np.unique(self.piece):
            t, position = self.motion.t[self.piece == piece], self.motion.position[self.piece == piece]
            windows = [slice(i, i + FRAMES) for i in range(len(t) - FRAMES + 1)]
            if windows:
                a = 2.0 * np.array([np.polyfit(t[part] - t[part.start], position[part], 2)[0] for part in windows])
                rise = a @ self.view.up
                across = np.linalg.norm(a - rise[:, None] * self.view.up, axis=1)
                most.append(max(-rise.min(), across.max()))  # across, too, where another axis is up
        fastest = float(np.median(most)) if most else self.rig.g
        if fastest > SMOOTHED * self.rig.g:
            return ""
        return (
            f" Over {FRAMES} frames the body falls with {fastest:.1f} m/s² at most (median of {len(most)} recordings), "
            f"and not with {self.rig.g:g}: the positions were smoothed, or it was not let go."
        )

    def no_drop(self, drops: Sequence[Drop], height: np.ndarray) -> str:
        """Advice where no drop can be used; `height` (n,) in m is that of the body's lowest point."""
        if all(drop.left_out == SPATIAL for drop in drops):
            return (
                f"all {len(drops)} trials have more than {MOST_OUT:.0%} of their energy out of the plane: the "
                "motion is one in space, or rotations are not read as they were written (order, handedness, "
                "sequence of angles)."
            )
        ends = [height[drop.flights[-1].stop - 1] for drop in drops if drop.flights]
        low = float(np.median(ends))
        surface = (self.rig.surface_height or 0.0) + low
        return (
            f"none of {len(drops)} drops reaches the surface: their falls end {low:.3f} m above it (median). Is the "
            f"surface at {surface:.3f} m (--surface-height)? Are the shape and --frame right?"
        )


def long_period(t: np.ndarray, piece: np.ndarray) -> float:
    """Median step in s over ever more rows: of a period that is nearly known, the steps between two rows are, too."""
    period = 0.0
    for span in 2 ** np.arange(2, 16):
        step = (t[span:] - t[:-span])[piece[span:] == piece[:-span]]
        if period and len(step) < PART:
            break
        steps = np.maximum(np.round(step / period), 1.0) if period else float(span)
        period = float(np.median(step / steps)) if len(step) else float(np.median(np.diff(t)))
    return period
