"""What a log becomes: a dataset, and in words what was changed, left out or may be wrong.

`Conversion.notes` lists everything that was changed or left out, `Conversion.warnings` what may be wrong with a log.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import ValidationError

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon, Shape
from thesis_lib.bodies.walls import Wall
from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS, Dataset, median_step, unwrap
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.space.drops import Cuts
from thesis_lib.foundation.errors import UserError

_OPTIONS = {"size": "homogeneous"}  # keys of dataset.yaml whose option has another name
GRAVITY = 9.81  # m/s²


@dataclass
class Conversion:
    """A converted log; `notes` and `warnings` are sentences, `cuts` what became of a motion in space."""

    dataset: Dataset
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    cuts: Cuts | None = None


@dataclass(frozen=True)
class Rig:
    """What is believed of body and rig, as the options of `datasets init` say it.

    Mass in kg, k_g (by default that of a uniform lamina) and surface_height in m, gravity in m/s² (by default
    `GRAVITY`, and 0 between walls, as they are seen from above), rate in Hz (by default that of the times).
    `size_uncertainty` (relative, one sigma) says that the body is homogeneous and how well its size is known.
    """

    shape: Shape
    mass: float | None = None
    k_g: float | None = None
    size_uncertainty: float | None = None
    rate: float | None = None
    gravity: float | None = None
    surface_height: float = 0.0
    walls: tuple[Wall, ...] = ()

    def __post_init__(self) -> None:
        if self.walls and self.surface_height:
            raise UserError("--surface-height: between walls (--wall) there is no surface; leave one of them out.")
        if self.rate is not None and not (np.isfinite(self.rate) and self.rate > 0):
            raise UserError(f"--rate: {self.rate} Hz is impossible; give a number above 0.")

    @property
    def radius(self) -> float:
        """Radius of gyration in m."""
        return self.shape.radius_of_gyration if self.k_g is None else self.k_g

    @property
    def g(self) -> float:
        """Gravity in m/s²."""
        return (0.0 if self.walls else GRAVITY) if self.gravity is None else self.gravity


def parse_shape(text: str) -> Shape:
    """'ellipse:A,B' | 'disk:R' | 'square:SIDE' | 'rect:W,H' | 'polygon:x1,y1;…' in m; UserError for anything else."""
    kind, _, rest = text.partition(":")
    try:
        points = [tuple(float(value) for value in point.split(",")) for point in rest.split(";")]
        if kind == "ellipse":
            return Ellipse(semi_axes=points[0])  # pyright: ignore[reportArgumentType]
        if kind == "disk":
            return Disk(radius=points[0][0])
        if kind in ("square", "rect"):
            width, height = points[0] * 2 if kind == "square" else points[0]
            w, h = width / 2.0, height / 2.0
            return Polygon(vertices=((w, h), (-w, h), (-w, -h), (w, -h)))
        if kind == "polygon":
            return Polygon(vertices=tuple(points))  # pyright: ignore[reportArgumentType]
    except (ValueError, ValidationError) as error:
        reason = error.errors()[0]["msg"] if isinstance(error, ValidationError) else str(error)
        raise UserError(f"--shape: '{text}' is not a shape ({reason}).") from error
    known = "ellipse:A,B (semi-axes), disk:R, square:SIDE, rect:WIDTH,HEIGHT or polygon:x1,y1;x2,y2;…"
    raise UserError(f"--shape: '{kind}' is unknown; give {known} in m.")


def parse_wall(text: str) -> Wall:
    """'NAME:X,Y,NX,NY' -> the wall through X, Y (m) with the normal NX, NY; UserError for anything else."""
    name, _, rest = text.partition(":")
    try:
        x, y, nx, ny = (float(value) for value in rest.split(","))
        return Wall(name=name.strip(), point=(x, y), normal=(nx, ny))
    except (ValueError, ValidationError) as error:
        reason = error.errors()[0]["msg"] if isinstance(error, ValidationError) else str(error)
        raise UserError(
            f"--wall: '{text}' is not NAME:X,Y,NX,NY, a name in small letters, a point of the wall in m, and its "
            f"normal towards the body ({reason}); for example east:0.6,0,-1,0."
        ) from error


def as_dataset(poses: pd.DataFrame, name: str, files: Sequence[str | Path], rig: Rig, notes: list[str]) -> Dataset:
    """The dataset of whole poses (`TRAJECTORY_COLUMNS`, SI) from `files`; adds to `notes`.  A disk may lack theta.

    UserError if a value of the experiment is impossible, or another shape has no theta.
    """
    has_angle = "theta" in poses
    if not has_angle:
        needs_no_angle(rig.shape, str(files[0]))
        notes.append(
            "theta is not measured: trajectories.csv has none, and the spin of the body stays unknown. The radius of "
            f"gyration of a solid ball would be {0.4**0.5 * rig.shape.extent:.5g} m (--k-g)"
        )
    poses = poses.assign(**({} if has_angle else {"theta": 0.0}))[list(TRAJECTORY_COLUMNS)]
    poses["t"] -= poses.groupby("trial", sort=False)["t"].transform("first")
    before = poses["theta"].to_numpy(copy=True)
    poses["theta"] = unwrap(before, poses["trial"].to_numpy())
    if wrapped := int(np.sum(before != poses["theta"].to_numpy())):
        notes.append(f"theta made continuous within trials ({wrapped} rows moved by whole turns)")

    lamina, step = rig.shape.radius_of_gyration, median_step(poses)
    body: dict = {"shape": rig.shape, "mass": rig.mass, "radius_of_gyration": rig.radius}
    if rig.size_uncertainty is not None:
        body |= {"homogeneous": True, "uncertainty": {"size": rig.size_uncertainty}}
    elif rig.k_g is None:
        notes.append(f"radius of gyration {lamina:.5g} m, that of a uniform lamina (--k-g to change)")
    if rig.walls and rig.gravity is None:
        notes.append("gravity 0, as of a motion seen from above (--gravity 9.81 for walls that are seen from the side)")
    others = f" and {len(files) - 1} more" if len(files) > 1 else ""
    content = {
        "schema": 1,
        "description": f"converted from {Path(files[0]).name}{others}",
        "body": body,
        **({"surfaces": rig.walls} if rig.walls else {"surface": {"height": rig.surface_height}}),
        "gravity": rig.g,
        "rate": rig.rate if rig.rate is not None else (float(f"{1.0 / step:.6g}") if step > 0 else None),
    }
    try:
        header = Header.model_validate(content)
    except ValidationError as error:
        mistake = error.errors()[0]
        option = _OPTIONS.get(str(mistake["loc"][-1]), str(mistake["loc"][-1]).replace("_", "-"))
        raise UserError(f"--{option}: {mistake['input']}: {mistake['msg']}.") from error
    return Dataset(name, header, poses, has_angle=has_angle)


def needs_no_angle(shape: Shape, where: str) -> None:
    """UserError if a recording without an angle is one of a shape that needs it."""
    if not isinstance(shape, Disk):
        raise UserError(
            f"{where}: no angle of the body is read from it (no theta, no orientation), and only a round body can do "
            "without: give --shape disk:RADIUS, or say where the angle is (--columns theta=NAME, --quaternion)."
        )
