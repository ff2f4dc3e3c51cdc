"""Columns of trajectories.csv and impacts.csv, in the plane (schema 1) and in space (schema 2)."""

from collections.abc import Sequence
from dataclasses import dataclass

from thesis_lib.datasets.format.impacts import COVARIANCE_COLUMNS, IMPACT_COLUMNS, V_POST, V_PRE

POSITION, QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
POSE_IN_SPACE = POSITION + QUATERNION
V_PRE_IN_SPACE, V_POST_IN_SPACE = (
    tuple(f"{name}_{when}" for name in ("vx", "vy", "vz", "wx", "wy", "wz")) for when in ("pre", "post")
)
CONTACT_POINT = ("r_x", "r_y", "r_z")


@dataclass(frozen=True)
class TableForm:
    """Columns of a table, and the message on columns that belong to the other schema."""

    required: Sequence[str]
    optional: Sequence[str] = ()
    may_be_empty: Sequence[str] = ()  # columns whose cells may be empty
    foreign: frozenset[str] = frozenset()  # columns of the other schema
    what: str = ""  # fault and remedy for these
    remedy: str = ""
    instead: "TableForm | None" = None  # form of a table with columns of the other schema, where that is right, too


_OF_SPACE = frozenset(
    ("z", "vz", "roll", "pitch", "yaw", "qx", "qy", "qz", "qw", "omega_x", "omega_y", "wx", "wy", "wz", "r_z")
) | (set(V_PRE_IN_SPACE + V_POST_IN_SPACE) - set(V_PRE + V_POST))
_SAID_OF_SPACE = (
    "the motion is in space, but 'schema: 1' is for planar motions (x, y and one angle theta)",
    "write 'schema: 2' in dataset.yaml, with a body in space (docs/reference_dataset.md); or, if the body moves in a "
    "plane, project it (x along the surface, y up, theta about the normal of the plane: README, 'Your own drops')",
)
_OF_PLANE = frozenset(("theta", "omega", "omega_pre", "omega_post", "angle", *COVARIANCE_COLUMNS))
_SAID_OF_PLANE = "belongs to motions in a plane"


def trajectory_form(schema: int, turns_unseen: bool) -> TableForm:
    """Columns of trajectories.csv; `turns_unseen`: for a disk or a sphere, whose orientation may be missing."""
    orientation = ("theta",) if schema == 1 else QUATERNION
    place = ("trial", "t", "x", "y") if schema == 1 else ("trial", "t", *POSITION)
    needed, optional = (place, orientation) if turns_unseen else (place + orientation, ())
    if schema == 1:
        return TableForm(needed, optional, (), _OF_SPACE, *_SAID_OF_SPACE)
    wanted = f"in space the columns are {','.join(needed)}"
    return TableForm(needed, optional, POSE_IN_SPACE, _OF_PLANE, _SAID_OF_PLANE, wanted)


def impact_form(schema: int, turns_unseen: bool) -> TableForm:
    """Columns of impacts.csv, with the arguments of `trajectory_form`."""
    if schema == 1:
        optional = ("t", "r_x", "r_y", "flags", *COVARIANCE_COLUMNS)
        return TableForm(IMPACT_COLUMNS, optional, ("t",), _OF_SPACE, *_SAID_OF_SPACE)
    pose, orientation = (POSITION, QUATERNION) if turns_unseen else (POSE_IN_SPACE, ())
    needed = ("trial", "impact", *pose, *V_PRE_IN_SPACE, *V_POST_IN_SPACE)
    wanted = f"in space the columns are {','.join(needed)}, and optionally t,{','.join(CONTACT_POINT)}"
    optional = (*orientation, "t", *CONTACT_POINT)
    return TableForm(needed, optional, ("t", *orientation), _OF_PLANE, _SAID_OF_PLANE, wanted)
