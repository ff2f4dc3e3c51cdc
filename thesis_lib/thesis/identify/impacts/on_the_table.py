"""Sliding and rest of a body on a level table after a throw, in axes of the throw, without any contact law.

*Slides.*  A parabola is fitted to x and y of the last samples at the final height at which the body moves.  Friction
acts against the motion; an acceleration to its left would mean that the table is not level.

*Faces.*  The tracked axis nearest to the vertical at the end leans as the recorded axes do: equally in all tosses if
these are the axes of the throw.  A rotation of the tracked frame in the body has another direction for each face.

| quantity                    | unit | meaning                                                                     |
|-----------------------------|------|-----------------------------------------------------------------------------|
| slide_against               | m/s² | acceleration of slides against their motion (median)                        |
| slide_left                  | m/s² | acceleration of slides to the left of their motion (mean)                   |
| lies_along, lies_left       | rad  | lean of the axis nearest to vertical, ahead and left of the throw (mean)    |
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.statistics.spread import median_error

LOW = 1.5e-3  # m from the final height, within which the body slides
SLOWEST = 0.08  # m/s
FEWEST = 10  # samples of a slide
BEGINS = 3  # samples left out at the beginning of a slide
LAST = 5  # samples of a rest
START = 8  # samples that determine the direction of the throw

Toss = tuple[np.ndarray, np.ndarray, Rotation]  # times (n,) in s, positions (n, 3) in m with z up, attitudes


def quantities(tosses: Sequence[Toss]) -> Iterator[tuple[str, float, float, str, int]]:
    """Yield quantity, value, standard error, unit and number of tosses; see the module's table."""
    if found := [slide for t, p, _ in tosses if (slide := _slide(t, p)) is not None]:
        against, left = np.array(found).T
        n = len(against)
        yield "slide_against", float(np.median(against)), median_error(against), "m/s²", n
        yield "slide_left", float(left.mean()), float(left.std()) / np.sqrt(n), "m/s²", n
    leans = np.array([_lean(*toss) for toss in tosses])
    for name, column in zip(("lies_along", "lies_left"), leans.T):
        yield name, float(column.mean()), float(column.std()) / np.sqrt(len(column)), "rad", len(column)


def _slide(t: np.ndarray, p: np.ndarray) -> tuple[float, float] | None:
    """Acceleration in m/s² of a slide against its motion, and to the left of it; None if there is no slide."""
    high = np.flatnonzero(np.abs(p[:, 2] - p[-LAST:, 2].mean()) > LOW)
    rows = slice(int(high[-1]) + BEGINS if len(high) else 0, len(t))
    t, p = t[rows], p[rows]
    if len(t) < FEWEST:
        return None
    slow = np.flatnonzero(np.linalg.norm(np.gradient(p[:, :2], t, axis=0), axis=1) < SLOWEST)
    end = int(slow[0]) if len(slow) else len(t)
    if end < FEWEST:
        return None
    tau = t[:end] - t[:end].mean()
    (a, v, _) = np.linalg.lstsq(np.vander(tau, 3), p[:end, :2], rcond=None)[0]
    ahead = v / np.linalg.norm(v)
    return float(-2.0 * a @ ahead), float(2.0 * a @ [-ahead[1], ahead[0]])


def _lean(t: np.ndarray, p: np.ndarray, q: Rotation) -> tuple[float, float]:
    """Lean in rad of the axis nearest to the vertical, ahead and to the left of the throw."""
    v = np.polyfit(t[:START], p[:START, :2], 1)[0]
    axes = q[-LAST:].as_matrix().mean(axis=0)
    which = int(np.abs(axes[2]).argmax())
    x, y, _ = np.sign(axes[2, which]) * axes[:, which]
    cos, sin = v / np.linalg.norm(v)
    return float(cos * x + sin * y), float(cos * y - sin * x)
