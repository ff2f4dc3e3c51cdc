"""The motion of a body from its recorded markers.

The rotation R and position p of the body in a frame best map the reference positions of its markers to the measured:

    R, p = argmin Σ |p + R (m_i − m̄) − x_i|²       (Kabsch 1976, doi:10.1107/S0567739476001873)

x_i (3,) are the markers seen in a frame, m_i their positions in the first frame that shows all of them.  In that frame
the axes of the body are those of the recording; its origin is the mean m̄ of the markers.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.sources.tables.several_bodies import SHOWN, choose_body
from thesis_lib.datasets.space.motion import Motion, quaternions
from thesis_lib.foundation.errors import UserError

FEWEST = 3  # markers seen
FLAT = 0.05  # second singular value over the first: markers on a line give no rotation
RIGID = 0.003  # m, rms distance of markers from the rigid body; more means confused markers


def choose_markers(path: Path, names: Sequence[str], body: str | None) -> tuple[str, list[str]]:
    """The selected body and the names of its markers, which are body:marker, or marker if they have no body.

    `body` may also name a marker, as for a ball.  UserError if there are no markers, or the body is not among them.
    """
    bodies: dict[str, list[str]] = {}
    for name in names:
        if not name.startswith("*"):  # unlabelled markers
            bodies.setdefault(name.rpartition(":")[0], []).append(name)
    if not bodies:
        raise UserError(f"{path} has neither a rigid body nor markers with names; export the rigid bodies.")
    if len(alone := bodies.get("", [])) == 1:
        bodies = {name or alone[0]: markers for name, markers in bodies.items()}
    if body is not None and body in names and body not in bodies:
        return body, [body]
    chosen = choose_body(path, list(bodies), body)
    return chosen, bodies[chosen]


def motion_of_markers(
    path: Path, body: str, names: Sequence[str], markers: np.ndarray, t: np.ndarray, notes: list[str]
) -> Motion:
    """The motion of a body from its markers (n, m, 3) in m, NaN or zeros where lost; one marker is a point.

    Adds to `notes`.  UserError if the markers do not determine the motion of a body.
    """
    markers = np.where(np.any(markers != 0.0, axis=2, keepdims=True), markers, np.nan)
    seen = np.isfinite(markers).all(axis=2).any(axis=0)
    if not seen.all():
        notes.append(f"markers left out that no frame shows: {', '.join(np.array(names)[~seen][:SHOWN])}")
        markers = markers[:, seen]
    if markers.shape[1] == 1:
        return Motion.of_point(body, str(path), t, markers[:, 0])
    try:
        position, quaternion, odd = body_of_markers(markers)
    except ValueError as error:
        named = f"the markers of '{body}'" if body else "its markers"
        raise UserError(
            f"{path}, {named} ({', '.join(names[:SHOWN])}): {error}. A single marker is a ball: name it with --body."
        ) from error
    if odd > len(markers) // 2:
        raise UserError(
            f"{path}: the markers {', '.join(names[:SHOWN])} do not move as one rigid body (in {odd} of {len(markers)} "
            "frames). Give the markers of a body a common name before a colon, or name one (a ball) with --body."
        )
    notes.append(
        f"the body is made of {markers.shape[1]} markers: its origin is their mean, its axes are those of the "
        "recording in the first frame that shows all; locate its centre of mass with --frame"
    )
    if odd:
        notes.append(f"{odd} frames left out: their markers do not fit a rigid body")
    return Motion(body, str(path), t, position, quaternion)


def body_of_markers(markers: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Positions (n, 3) in m and quaternions (n, 4) of a body from markers (n, m, 3), NaN where lost.

    The third value is the number of frames whose markers do not fit a rigid body; these are NaN.  ValueError, with the
    reason, if the markers do not determine the motion of a body.
    """
    n, count, _ = markers.shape
    shown = np.isfinite(markers.sum(axis=2))
    if count < FEWEST:
        raise ValueError(f"{count} markers do not determine a rotation; three or more do")
    whole = np.flatnonzero(shown.sum(axis=1) == count)
    if len(whole) == 0:
        raise ValueError("no frame shows all of its markers; leave out those that are seldom seen")
    reference = markers[whole[0]]
    reference = reference - reference.mean(axis=0)
    sizes = np.linalg.svd(reference, compute_uv=False)
    if sizes[1] < FLAT * sizes[0]:
        raise ValueError("its markers lie on a line, so the rotation about it is unknown")
    weight = shown[:, :, None].astype(float)
    seen: np.ndarray = weight.sum(axis=1)
    usable = np.flatnonzero(seen[:, 0] >= FEWEST)
    x, w = np.where(shown[:, :, None], markers, 0.0)[usable], weight[usable]
    middle_x, middle_m = (x * w).sum(axis=1) / seen[usable], (reference * w).sum(axis=1) / seen[usable]
    a, b = (x - middle_x[:, None]) * w, (reference - middle_m[:, None]) * w
    u, _, vt = np.linalg.svd(np.einsum("nmi,nmj->nij", a, b))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]  # no reflection
    rotation = u @ vt
    rest = a - np.einsum("nij,nmj->nmi", rotation, b)
    rigid = np.sqrt(np.sum(rest**2, axis=(1, 2)) / seen[usable, 0]) < RIGID
    position, rotations, good = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), usable[rigid]
    position[good] = (middle_x - np.einsum("nij,nj->ni", rotation, middle_m))[rigid]
    rotations[good] = rotation[rigid]
    return position, quaternions(rotations, Rotation.from_matrix), int(np.sum(~rigid))
