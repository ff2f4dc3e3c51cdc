"""Which body of a recording is meant, and its motion where only its markers were recorded."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from thesis_lib.datasets.space.markers import body_of_markers
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.foundation.errors import UserError

SHOWN = 20  # names in an error


def choose_body(path: Path, bodies: Sequence[str], body: str | None) -> str:
    """The body that is meant: the only one, or that named `body`, of which an end will do (of topic:frame the frame).

    UserError if there is none, or there are several.
    """
    shown = ", ".join(name or "(no name)" for name in bodies[:SHOWN])
    shown += f" and {len(bodies) - SHOWN} more" if len(bodies) > SHOWN else ""
    if body is None and len(bodies) == 1:
        return bodies[0]
    ways = (
        lambda name: name == body,
        lambda name: re.split("[:/]", name)[-1] == body,
        lambda name: name.endswith(body),
    )
    found = next(filter(None, ([name for name in bodies if way(name)] for way in ways)), []) if body else []
    if len(found) == 1:
        return found[0]
    if body is None:
        raise UserError(f"{path} has {len(bodies)} bodies: {shown}. Say which with --body NAME.")
    raise UserError(f"{path} has no body '{body}' (or several whose names end so). It has: {shown}.")


def choose_markers(path: Path, names: Sequence[str], body: str | None) -> tuple[str, list[str]]:
    """The body that is meant and the names of its markers, which are body:marker, or marker where they have no body.

    A marker may be named as `body`, too: a ball.  UserError if there are none, or the body is not among them.
    """
    bodies: dict[str, list[str]] = {}
    for name in names:
        if not name.startswith("*"):  # so are those that nobody has named
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
    """The motion of a body from its markers (n, m, 3) in m, NaN where lost; one marker is a point.  Adds to `notes`.

    UserError if they do not make a body.
    """
    seen = np.isfinite(markers).all(axis=2).any(axis=0)
    if not seen.all():
        notes.append(f"markers that no frame shows left out: {', '.join(np.array(names)[~seen][:SHOWN])}")
        markers = markers[:, seen]
    if markers.shape[1] == 1:
        return Motion.of_point(body, str(path), t, markers[:, 0])
    try:
        position, quaternion, odd = body_of_markers(markers)
    except ValueError as error:
        named = f"the markers of '{body}'" if body else "its markers"
        raise UserError(
            f"{path}, {named} ({', '.join(names[:SHOWN])}): {error}. One alone is a ball: name it with --body."
        ) from error
    if odd > len(markers) // 2:
        raise UserError(
            f"{path}: the markers {', '.join(names[:SHOWN])} do not move as one rigid body (in {odd} of {len(markers)} "
            "frames). Give the markers of a body a common name before a colon, or name one, a ball, with --body."
        )
    notes.append(
        f"the body is made of {markers.shape[1]} markers: its origin is their mean, its axes are those of the "
        "recording in the first frame that shows all; say with --frame where its centre of mass is"
    )
    if odd:
        notes.append(f"{odd} frames left out: their markers are not where a rigid body has them")
    return Motion(body, str(path), t, position, quaternion)
