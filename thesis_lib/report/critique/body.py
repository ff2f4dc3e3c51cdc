"""Picture of the body in space for a page: its faces, and the hits on them with the errors of the final model.

body.html draws one view as SVG; in the browser, thesis_lib/pages/body.js rotates the body with numbers from JSON in
the page.  A hit is drawn at a distance from its contact point along the surface normal, as many hits share a corner.

| on paper | in the JSON | unit | |
|----------|-------------|------|---------------------------------------------------------------------|
|          | `vertices`  | m    | of the believed solid, from its centre of mass, in axes of the body |
|          | `faces`     |      | numbers of their vertices, counter-clockwise from outside           |
|          | `hits`      | m    | positions of the hits, in the order of the circles                  |
|          | `axes`      | m    | point at which each axis leaves the body, and its end               |
|          | `beyond`    |      | for each hit and axis: faces beyond whose planes it ends            |
|          | `rungs`     | m/s  | errors of the hits by model, final model last, and how to draw them |

A point beyond the plane of a visible face is in front of the convex body; all other points are behind or beside it.
"""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from thesis_lib.bodies.solids import Solid
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.judgement import Judgement
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.results.candidates import Choice
from thesis_lib.critique.results.numbers import impact_errors
from thesis_lib.critique.results.titles import effect_title, law_title
from thesis_lib.figures.critique.where import top_of
from thesis_lib.mechanics.space import SPACE
from thesis_lib.pages import render
from thesis_lib.report.critique.impacts import HEIGHT, LEFT, WIDTH, as_json, drawn_impacts, key_of, look, scale_of
from thesis_lib.report.elements import amount
from thesis_lib.statistics.intervals import clustered_mean

TEMPLATE = Path(__file__).with_name("body.html")
MOST_CORNERS = 100  # a mesh with at most so many corners is drawn with all of them
MOST = 800  # hits drawn: 200 kB
OFF, BEYOND = 0.12, 0.3  # extents by which a hit is drawn off the body, and an axis drawn beyond it
START = (35.0, 20.0)  # degrees: azimuth and elevation of the first view
CENTRE, HALF = (WIDTH / 2, 218.0), 125.0  # centre of the picture, and half the largest extent on it, in pixels
_AZIMUTH, _ELEVATION = np.meshgrid(np.radians(np.arange(0, 360, 22.5)), np.radians(np.arange(-90, 91, 30)))
DIRECTIONS = np.stack(
    [np.cos(_ELEVATION) * np.cos(_AZIMUTH), np.cos(_ELEVATION) * np.sin(_AZIMUTH), np.sin(_ELEVATION)]
).reshape(3, -1)


class Polyhedron(NamedTuple):
    """A convex solid, as drawn.

    Attributes:
        vertices: (k, 3) in m.
        faces: numbers of their vertices, counter-clockwise seen from outside.
        planes: (f, 4) outward unit normals, and offsets: n·r + offset = 0.
    """

    vertices: np.ndarray
    faces: list[list[int]]
    planes: np.ndarray


def polyhedron(solid: Solid | Any) -> Polyhedron:
    """Return the solid with sharp edges; round parts are approximated by points 22.5° apart."""
    from scipy.spatial import ConvexHull

    with suppress(AttributeError):  # solids without edges
        solid = solid.rounded(0.0)  # pyright: ignore[reportAttributeAccessIssue]
    points, parts = solid.corners, solid.minkowski
    if not points.size:
        reach = (np.sqrt(parts.squares) + parts.radius)[:, None] * DIRECTIONS
        points = (parts.centres[:, :, None] + reach[:, None]).reshape(3, -1)
    elif points.shape[1] > MOST_CORNERS:
        points = solid.support(DIRECTIONS)
    size = np.abs(points).max()
    hull = ConvexHull(points.T / size)
    _, first, of = np.unique(np.round(hull.equations, 6) + 0.0, axis=0, return_index=True, return_inverse=True)
    planes, faces = hull.equations[first] * [1.0, 1.0, 1.0, size], []
    for i, normal in enumerate(planes[:, :3]):
        corners = np.unique(hull.simplices[of.ravel() == i])
        arm = hull.points[corners] - hull.points[corners].mean(axis=0)
        turn = np.arctan2(arm @ np.cross(normal, arm[0]), arm @ arm[0])
        faces.append(corners[np.argsort(turn)].tolist())
    number = {old: new for new, old in enumerate(hull.vertices.tolist())}
    return Polyhedron(points.T[hull.vertices], [[number[v] for v in face] for face in faces], planes)


def axes_of_view(azimuth: float, elevation: float) -> np.ndarray:
    """Return unit vectors to the right, upwards and towards the viewer, by row, for a view from angles in degrees."""
    (ca, ce), (sa, se) = (f(np.radians([azimuth, elevation])) for f in (np.cos, np.sin))
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def drawn_faces(places: np.ndarray, faces: Sequence[Sequence[int]]) -> tuple[list[bool], dict[str, str]]:
    """Return which faces are visible, and the paths of visible ("front") and hidden ("back") faces.

    `places` (k, 2): positions of the vertices, in pixels to the right and downwards.
    """
    paths, is_front = {"front": "", "back": ""}, []
    for face in faces:
        x, y = places[face].T
        is_front.append(bool(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0.0))
        paths["front" if is_front[-1] else "back"] += path(places[face]) + "Z"
    return is_front, paths


def path(places: np.ndarray) -> str:
    """Return the SVG path through positions (k, 2) in pixels."""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places)


def turnable(critique: DropsCritique, choices: Sequence[Choice] = ()) -> Markup:
    """Return the rotatable picture of the body with its hits; empty for planar motion, which needs none.

    The reader can choose between the models of `choices`, or between the rungs of the ladder.
    """
    if critique.space.is_plane:
        return Markup()
    o, final = critique.observations.single, critique.ladder[-1][1]
    error = impact_errors(final, o)
    if not np.isfinite(error).any():
        return Markup()
    rows = drawn_impacts(error, np.flatnonzero(np.isfinite(error)), MOST)
    before = final.on(o).at_impulse[0].select(rows)
    solid = polyhedron(o.rig.shape)
    extent = float(np.linalg.norm(solid.vertices, axis=1).max())
    down = SPACE.turned_back(before.attitude, np.array([[0.0], [0.0], [-1.0]]))
    hits = (SPACE.turned_back(before.attitude, o.rig.lowest(before)) + OFF * extent * down).T
    axes = np.diag(solid.vertices.max(axis=0)) + np.multiply.outer([0.0, BEYOND * extent], np.eye(3))
    ends = np.concatenate([hits, axes[1]]) @ solid.planes[:, :3].T + solid.planes[:, 3]
    beyond = [np.flatnonzero(row > 0.0).tolist() for row in ends]
    scale, view = HALF / extent, axes_of_view(*START)
    is_front, paths = drawn_faces(_seen(solid.vertices, view, scale), solid.faces)
    top = top_of(error[rows])
    held_out = np.isin(o.trial[rows], critique.held_out.trial)
    is_before = [any(is_front[face] for face in faces) for faces in beyond]
    circles: dict[bool, list] = {True: [], False: []}
    for i, ((x, y), row) in enumerate(zip(_seen(hits, view, scale), rows)):
        label = f"trial {o.trial[row]}, impact {o.impact[row]}: {amount(float(error[row]), 'm/s')}"
        radius, color = look(min(float(error[row]) / top, 1.0) ** 0.5)
        circles[is_before[i]].append((i, x, y, radius, color, held_out[i], label))
    numbers = {"vertices": solid.vertices, "hits": hits, "axes": axes.swapaxes(0, 1)}
    models = _choices(critique, choices) if choices else _rungs(critique)
    rungs = _errors(models, o, rows, top) if len(models) > 1 else {}
    held_out_errors = error[rows][held_out]
    finding = f"{len(rows)} single hits, {len(held_out_errors)} of them held out, on the body."
    if len(held_out_errors):
        mean, most = (amount(one, "m/s") for one in (held_out_errors.mean(), held_out_errors.max()))
        finding += f" The error of the held-out hits is {mean} on average and {most} at most."
    return render(
        TEMPLATE,
        width=WIDTH,
        height=HEIGHT,
        left=LEFT,
        key=key_of(top),
        paths=paths,
        circles=circles,
        axes=list(zip("xyz", *(_seen(ends, view, scale) for ends in axes), is_before[-3:])),
        finding=finding,
        rungs=rungs.pop("titles", []),
        numbers=as_json(
            {name: rounded(array, 1e-5) for name, array in numbers.items()}
            | {"faces": solid.faces, "beyond": beyond, "centre": CENTRE, "scale": scale, "start": START}
            | ({"rungs": rungs} if rungs else {})
        ),
    )


def _rungs(critique: DropsCritique) -> list[tuple[str, Fit]]:
    """Return each rung of the ladder with its title."""
    found, law = [], ""
    for label, fitted, judged in critique.ladder:
        name = f"and {effect_title(label)}" if found else law_title(fitted.base)
        name += f", {law_title(fitted.base)}" if found and fitted.base != law else ""
        law = fitted.base
        found.append((f"{name}: {_held_out(judged)}", fitted))
    return found


def _choices(critique: DropsCritique, choices: Sequence[Choice]) -> list[tuple[str, Fit]]:
    """Return each choice of effects with its title, the final model last."""
    final, found = {e.name for e in critique.ladder[-1][1].effects}, []
    for one in sorted(choices, key=lambda one: set(one.effects) == final):
        name = ", ".join(map(effect_title, one.effects))
        name = f"{law_title(one.fitted.base)} and {name}" if name else law_title(one.fitted.base)
        found.append((f"{name}: {_held_out(one.judged)}", one.fitted))
    return found


def _held_out(judged: Judgement) -> str:
    return f"{amount(float(clustered_mean(judged.error, judged.trial)[0]), 'm/s')} held out"


def _errors(models: Sequence[tuple[str, Fit]], o: Observations, rows: np.ndarray, top: float) -> dict:
    """Return the errors of each model at the hits `rows`, its title, and how errors are drawn."""
    titles, fits = zip(*models)
    errors = [
        [float(f"{e:.3g}") if np.isfinite(e) else None for e in impact_errors(fitted, o)[rows]] for fitted in fits
    ]
    return {"titles": titles, "errors": errors, **scale_of(top)}


def _seen(r: np.ndarray, view: np.ndarray, scale: float) -> np.ndarray:
    """Return the positions (n, 2) in pixels of points r (n, 3) in m."""
    return CENTRE + scale * (r @ view[:2].T) * [1.0, -1.0]


def rounded(values: np.ndarray, step: float) -> list:
    """Return the values as nested lists, rounded to multiples of `step`, a power of ten."""
    return np.round(values, -round(np.log10(step))).tolist()
