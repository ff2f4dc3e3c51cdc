"""Result of an import: a dataset, and in words what was changed, left out or may be wrong.

`Conversion.notes` lists everything that was changed or left out, `Conversion.warnings` what may be wrong with a log.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from pydantic import ValidationError

from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS, Dataset, median_step, unwrap
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.header_file import Model
from thesis_lib.datasets.format.validate import first_of
from thesis_lib.datasets.sources.recorded import Recorded, long_period
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, needs_no_angle
from thesis_lib.datasets.space.drops import Cuts
from thesis_lib.foundation.errors import UserError

if TYPE_CHECKING:
    from thesis_lib.datasets.space.tracked_frame import TrackedFrame

_OPTIONS = {"size": "homogeneous", "body": "shape"}  # keys of dataset.yaml whose option has another name


@dataclass
class Conversion:
    """A converted log; `notes` and `warnings` are sentences, `cuts` what became of a motion in space."""

    dataset: Dataset
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    cuts: Cuts | None = None


def as_dataset(
    poses: pd.DataFrame, name: str, files: Sequence[str | Path], rig: RigOptions, notes: list[str]
) -> Dataset:
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
    content = {
        "schema": 1,
        "description": _description(files),
        "body": body,
        **({"surfaces": rig.walls} if rig.walls else {"surface": {"height": rig.surface_height or 0.0}}),
        "gravity": rig.g,
        "rate": rig.rate if rig.rate is not None else (float(f"{1.0 / step:.6g}") if step > 0 else None),
    }
    return Dataset(name, _validated(Header, content), poses, has_angle=has_angle)


def solid_dataset(recorded: Recorded, up: np.ndarray, found: "TrackedFrame | None" = None) -> Dataset:
    """The dataset of a body in space, without its tables; `up` (3,) is against gravity.

    Tracked frame and surface are as `found`, but for a surface whose height is given; else the tracked frame is that
    of the shape, and the surface at the height given, or at 0.

    UserError if a value of the experiment is impossible, or a mesh is not closed.
    """
    rig, motion = recorded.rig, recorded.motion
    body: dict = {"shape": rig.shape, "mass": rig.mass}
    body |= {"homogeneous": True} if rig.radii_of_gyration is None else {"radii_of_gyration": rig.radii_of_gyration}
    if rig.center_of_mass is not None:
        body["center_of_mass"] = rig.center_of_mass
    if rig.size_uncertainty is not None:
        body["uncertainty"] = {"size": rig.size_uncertainty}
    point, normal = (rig.surface_height or 0.0) * up, up
    if found is not None and rig.surface_height is None:
        point, normal = found.point, found.normal
    # of many steps together, as stamps of a long recording may have few digits
    rate = float(f"{1.0 / long_period(motion.t, recorded.piece):.6g}") if len(motion) > 1 else None
    content = {
        "schema": 2,
        "description": _description(recorded.files),
        "body": body,
        **({} if found is None else {"tracked": found.tracked}),
        "surface": {"point": tuple(point), "normal": tuple(normal)},
        "gravity": tuple(-rig.g * up),
        "rate": rig.rate if rig.rate is not None else rate,
    }
    return Dataset(recorded.name, _validated(SpaceHeader, content))


def _description(files: Sequence[str | Path]) -> str:
    return f"converted from {first_of([Path(file).name for file in files], 1)}"


def _validated(model: type[Model], content: dict) -> Model:
    """The header with this content; UserError names the option whose value is impossible."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        mistake = error.errors()[0]
        key = str(mistake["loc"][-1])
        value = "" if isinstance(mistake["input"], dict) else f"{mistake['input']}: "
        raise UserError(f"--{_OPTIONS.get(key, key.replace('_', '-'))}: {value}{mistake['msg']}.") from error
