"""Write a fitted model for a physics engine: as a new file, or into one body of a user's file.

A new file is complete in itself.  A patched file is the user's file, except for the numbers of one body.
"""

from dataclasses import dataclass
from pathlib import Path

from thesis_lib.critique.drops.sliding import require_falling
from thesis_lib.critique.export import drake_files, mjcf, patch_drake, patch_mjcf
from thesis_lib.critique.export.of_plane import planar_body
from thesis_lib.critique.export.of_space import body_in_space
from thesis_lib.critique.export.patch import BodyAxes, Patch
from thesis_lib.critique.export.solid import FORMATS, ExportedBody, only_bounds
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import atomic

WRITERS = {"mjcf": mjcf.mjcf, "sdf": drake_files.sdf, "urdf": drake_files.urdf}


@dataclass(frozen=True)
class Exported:
    """Content of the file, and lines for the terminal on effects or changes in it, and on those it cannot express."""

    content: bytes
    held: tuple[str, ...]
    left_out: tuple[str, ...]


def exported(model: SavedModel, target: str, *, mass: float | None = None, depth: float | None = None) -> Exported:
    """Return a new file; UserError for an unknown format, an invalid depth or mass, or a prism that is too thin."""
    made = body_of(model, target, mass, depth)
    held = tuple(f"{name}: {where}" for name, where in made.expressed)
    left = [f"{name}: {why}" for name, why in made.left_out]
    if not made.mass_known:
        left.append("mass: not part of a model; 1 kg was written (use --mass KG)")
    if not made.time_known:
        left.append("contact time: not identifiable from impacts without trajectories; 1 ms was written")
    left += only_bounds(model)
    return Exported(WRITERS[target](made).encode(), held, tuple(left))


def body_of(model: SavedModel, target: str, mass: float | None = None, depth: float | None = None) -> ExportedBody:
    """Return the body of a model for the format `target`; errors as for `exported`."""
    if target not in FORMATS:
        raise UserError(f"There is no format {target!r}; known are {', '.join(FORMATS)}.")
    if isinstance(model, SavedSpaceModel):
        return body_in_space(model, target, mass, depth)
    require_falling(model.rig.gravity, model.rig.has_angle, model.rig.walls, "export")
    return planar_body(model, target, mass, depth)


def patched(
    model: SavedModel,
    target: str,
    file: str | Path,
    body: str,
    *,
    mass: float | None = None,
    depth: float | None = None,
    plane: str | None = None,
    points: int | None = None,
    surface: str = "",
) -> Exported:
    """Return a user's file with the model's numbers written into one body.

    Args:
        mass: kg; None: the mass in the file.
        depth: m across the plane, for a body without inertia.
        plane: axes of the body that are x and y of planar drops, by default "xz".
        points: number of points in which an edge of the body touches; None: by its geometry, in space one.
        surface: link of the surface (SDF, URDF), which gets the same contact.

    Raises:
        UserError: the file cannot be read, has another format, or lacks the body or an element that a patch needs.
    """
    if plane is not None and not model.space.is_plane:
        raise UserError("--plane is for planar models: in space, your body must have the same frame as the shape.")
    if points is not None and points < 1:
        raise UserError(f"--points must be 1 or more; got {points}.")
    if surface and target == "mjcf":
        raise UserError("--surface is for SDF and URDF: MuJoCo uses only the numbers of the geom with priority.")
    own = Patch(file, BodyAxes(("xz" if plane is None else plane) if model.space.is_plane else None))
    of_file = patch_mjcf.mass_in(own, body) if target == "mjcf" else patch_drake.mass_in(own, body, target)
    if mass is None and of_file is not None and not of_file > 0.0:
        raise UserError(f"{file}: the mass of {body!r} is {of_file:g} kg; it must be positive.")
    made = body_of(model, target, mass or of_file, depth)
    if target == "mjcf":
        patch_mjcf.patch(own, body, made, points)
    else:
        patch_drake.patch(own, body, made, target, points, surface)
    if not made.time_known:
        own.left.append("contact time: not identifiable from impacts without trajectories; 1 ms was written")
    own.left.extend(only_bounds(model))
    return Exported(own.content(), tuple(own.changed), tuple(own.left))


def write(made: Exported, path: str | Path) -> None:
    """Write the file atomically: completely or not at all."""
    with atomic(path) as part:
        part.write_bytes(made.content)
