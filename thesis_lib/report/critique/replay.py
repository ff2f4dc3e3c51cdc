"""Replay of tosses on a page: the measured body, the prediction of the final model after each hit, heights over time.

The prediction starts from the measured state before a hit, and continues to the next hit that was used, or until the
body would touch again.  Planar motion is drawn as motion in space, seen along the surface.

replay.html draws one frame of each toss and the heights; in the browser, thesis_lib/pages/body.js moves the bodies
with numbers that the page contains as JSON.

| on paper  | in the JSON | unit | |
|-----------|-------------|------|--------------------------------------------------------------------------------|
|           | `vertices`, `faces` | m | of the body, as in `body`                                                  |
| p, q      | `measured`, `predicted` | m, 1 | pose in each frame, x axis along the path of the toss; null: none  |
| t         | `t`         | s    | time of each frame, from the first frame of the toss                           |
| −φ_n      | `heights`   | mm   | of the lowest point, measured and predicted                                    |
|           | `scale`, `origin`, `at` | | pixels per metre; positions of the origin and of each frame over the heights |
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from thesis_lib.bodies.shapes import Shape
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.likelihood.in_space.instants import readable
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.pages import render
from thesis_lib.report.critique.body import Polyhedron, axes_of_view, drawn_faces, path, polyhedron, rounded
from thesis_lib.report.critique.impacts import LEFT, MARGIN, WIDTH, as_json, scale
from thesis_lib.report.elements import amount

TEMPLATE = Path(__file__).with_name("replay.html")
MOST_FRAMES = 240  # of a toss: 30 kB
LONGEST = 0.5  # s for which a prediction is shown
AGAIN = 0.1  # extents below the surface at which a predicted body has touched again
ELEVATION = 12.0  # degrees above the surface of the view of tosses
SCENE, HEIGHTS = 250, 250  # heights of the pictures in pixels
LARGEST = (("largest", 0), ("second largest", 1), ("third largest", 2))  # name and rank of errors
OUTLINE = 60  # points of a round planar shape
SQUARE = 0.1  # m: the squares of the surface
LATER = 4  # frames shown after the end of the last prediction


class Toss(NamedTuple):
    """A measured toss in a frame along its path: times (k,) in s, poses (7, k), NaN without a prediction, heights
    (2, k) in m of the lowest point, measured and predicted, and the instants of the hits used."""

    t: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    heights: np.ndarray
    hits: np.ndarray


def replay(critique: DropsCritique) -> Markup:
    """Return the held-out tosses with the largest, the median and the smallest error.

    Empty without trajectories, and if the body does not fall onto a single surface.
    """
    source, judged, is_plane = critique.source, critique.ladder[-1][2], critique.space.is_plane
    o = critique.observations
    if source is None or not o.arcs or not source.gravity or o.surface.any():
        return Markup()
    solid = _lamina(source.shape) if is_plane else polyhedron(o.rig.shape)
    kind, elevation, square = ("drop", 0.0, None) if is_plane else ("toss", ELEVATION, SQUARE)
    trials = np.unique(judged.trial)
    errors = np.array([judged.error[judged.trial == trial].mean() for trial in trials])
    order = np.argsort(-errors, kind="stable")
    measured, drawn, content, labels = _measured(source), [], [], []
    for name, rank in (*LARGEST, ("median", len(order) // 2), ("smallest", len(order) - 1)):
        i = order[min(rank, len(order) - 1)]
        frames = measured.select(measured.trial == trials[i])
        picture, numbers = _drawn(tossed(critique, frames), solid, axes_of_view(-90.0, elevation))
        drawn.append(picture)
        content.append(numbers)
        labels.append(f"{name} error: trial {trials[i]}, {amount(float(errors[i]), 'm/s')}")
    numbers = {"vertices": rounded(solid.vertices, 1e-5), "faces": solid.faces, "elevation": elevation}
    finding = f"Held-out {kind}{'s' if is_plane else 'es'} by the mean error of their hits: {'; '.join(labels)}."
    sizes = {"width": WIDTH, "scene": SCENE, "heights": HEIGHTS, "left": LEFT, "right": WIDTH - MARGIN}
    shared = as_json(numbers | {"tosses": content})
    said = {"kind": kind, "finding": finding, "square": square}
    return render(TEMPLATE, tosses=drawn, labels=labels, numbers=shared, **said, **sizes)


def _measured(source: Dataset) -> State:
    """Return all measured poses; in space, in the frame of the surface."""
    if source.space.is_plane:
        assert source.trajectories is not None
        columns = (source.trajectories[name].to_numpy(float) for name in ("x", "y", "theta", "trial", "t"))
        x, y, theta, trial, t = columns
        return State.planar(x, y, theta, np.nan, np.nan, np.nan, trial, t)
    (surface,) = surface_frames(source.in_space)
    return surface.seen(body_states(tracked_states(readable(source)[0]), source.in_space))


def _lamina(shape: Shape) -> Polyhedron:
    """Return a planar shape as the single face of an upright solid, seen along y."""
    x, z = shape.outline(OUTLINE).T
    vertices = np.column_stack([x, np.zeros_like(x), z])
    return Polyhedron(vertices, [list(range(len(vertices)))], np.zeros((1, 4)))


def _upright(pose: np.ndarray, height: float) -> np.ndarray:
    """Return planar poses (3, k) as poses (7, k) of an upright body over a surface at `height` in m."""
    x, y, theta = pose
    none = np.where(np.isnan(x), np.nan, 0.0)
    return np.array([x, none, y - height, np.cos(theta / 2), none, -np.sin(theta / 2), none])


def tossed(critique: DropsCritique, frames: State) -> Toss:
    """Return one held-out toss from its measured frames; in space, in the frame of the surface."""
    t = frames.t - frames.t[0]
    o = critique.held_out.select(frames.trial[:1])
    here = critique.ladder[-1][1].on(o)
    found, before, after = here.prediction, here.before, o.t + o.span
    pose = before.q if found.q is None else np.where(np.isnan(found.q), before.q, found.q)
    starts = State.of(pose, found.v, o.trial, after, space=critique.space)
    ends = np.append(o.t[1:], np.inf)
    predicted = np.full(frames.pose.shape, np.nan)
    for i, (start, end) in enumerate(zip(after, np.minimum(ends, after + LONGEST))):
        rows = np.flatnonzero((t >= start) & (t < end))
        if not len(rows):
            continue
        poses = here.dynamics.path(t[rows][None] - start, starts.select(slice(i, i + 1)))[0].T
        again = _heights(critique, frames, poses) < -AGAIN * o.rig.shape.extent
        rows = rows[: np.append(again, True).argmax()]
        predicted[:, rows] = poses[:, : len(rows)]
    last = np.flatnonzero(np.isfinite(predicted[0])).max(initial=0) + 1 or len(t)
    rows = np.unique(np.linspace(0, min(last + LATER, len(t)) - 1, MOST_FRAMES).round().astype(int))
    both = [frames.pose[:, rows], predicted[:, rows]]
    heights = np.full((2, len(rows)), np.nan)
    for row, poses in zip(heights, both):
        known = np.isfinite(poses[0])
        row[known] = _heights(critique, frames, poses[:, known])
    if critique.space.is_plane:
        both = [_upright(poses, critique.observations.rig.height) for poses in both]
    else:
        both = _along_its_way(frames.select(rows), both)
    return Toss(t[rows], *both, heights, o.t[o.t <= t[rows[-1]]])


def _along_its_way(frames: State, both: list[np.ndarray]) -> list[np.ndarray]:
    """Return measured and predicted poses of these frames in axes whose first is the direction of largest spread."""
    middle = both[0][:3].mean(axis=1) * [1.0, 1.0, 0.0]
    x, y = both[0][:2] - middle[:2, None]
    way = 0.5 * np.arctan2(2.0 * (x * y).sum(), (x * x - y * y).sum())
    turned = Frame(middle, of_rotation_vector(np.array([[0.0], [0.0], [way]]))[:, 0])
    return [turned.seen(frames.with_pose(poses)).pose for poses in both]


def _heights(critique: DropsCritique, frames: State, poses: np.ndarray) -> np.ndarray:
    """Return the height (k,) in m of the lowest point at k poses by column, of the body in `frames`."""
    return critique.observations.rig.gap(frames.select(np.zeros(poses.shape[1], int)).with_pose(poses))


def _drawn(toss: Toss, solid: Polyhedron, view: np.ndarray) -> tuple[dict, dict]:
    """Return one toss for replay.html, in pixels, and its numbers for the script."""
    extent = np.linalg.norm(solid.vertices, axis=1).max()
    places = toss.measured[:3].T @ view[:2].T  # to the right and upwards, in m
    low, high = places.min(axis=0) - extent, places.max(axis=0) + extent
    per_m = float(np.min(np.array([WIDTH - 2 * MARGIN, SCENE - 2 * MARGIN]) / (high - low)))
    middle = 0.5 * (low + high)
    origin = np.array([WIDTH / 2 - per_m * middle[0], SCENE / 2 + per_m * middle[1]])

    def seen(r: np.ndarray) -> np.ndarray:
        return origin + per_m * (r @ view[:2].T) * [1.0, -1.0]

    def outline(pose: np.ndarray) -> str:
        if np.isnan(pose[0]):
            return ""
        r = pose[:3, None] + SPACE.turned(pose[3:, None], solid.vertices.T)
        return drawn_faces(seen(r.T), solid.faces)[1]["front"]

    reach = SQUARE * np.ceil(np.abs([low[0], high[0]]).max() / SQUARE)
    x, y = np.arange(-reach, reach + SQUARE / 2, SQUARE), SQUARE * np.array([-1.0, 0.0, 1.0])
    lines = [[(one, y[0], 0.0), (one, y[-1], 0.0)] for one in x] + [[(x[0], one, 0.0), (x[-1], one, 0.0)] for one in y]
    at, ticks = scale(toss.t, LEFT, WIDTH - MARGIN, 0.0)
    millimetres = 1e3 * toss.heights
    is_known = np.isfinite(millimetres)
    px = np.full(millimetres.shape, np.nan)
    px[is_known], y_ticks = scale(millimetres[is_known], HEIGHTS - 40.0, 24.0, 0.0)
    hits = np.interp(toss.hits, toss.t, at)
    apart = np.where(is_known[1], np.linalg.norm(toss.measured[:3] - toss.predicted[:3], axis=0), -1.0)
    first = int(np.argmax(apart))
    pieces = np.split(np.arange(len(at)), np.flatnonzero(np.diff(is_known[1])) + 1)
    picture = {
        "surface": "".join(path(seen(np.array(line))) for line in lines),
        "trail": path(seen(toss.measured[:3].T)),
        "bodies": [outline(poses[:, first]) for poses in (toss.measured, toss.predicted)],
        "measured": path(np.column_stack([at, px[0]])),
        "predicted": "".join(path(np.column_stack([at, px[1]])[rows]) for rows in pieces if is_known[1, rows[0]]),
        "x_ticks": ticks,
        "y_ticks": y_ticks,
        "hits": hits.tolist(),
        "now": at[first],
    }
    known = [None if np.isnan(pose[0]) else rounded(pose, 1e-4) for pose in toss.predicted.T]
    numbers = {"t": rounded(toss.t, 1e-3), "measured": rounded(toss.measured.T, 1e-4), "predicted": known}
    numbers |= {"heights": [[None if np.isnan(h) else round(float(h), 1) for h in row] for row in millimetres]}
    numbers |= {"scale": per_m, "origin": rounded(origin, 0.1), "at": rounded(at, 0.1), "first": first}
    return picture, numbers
