"""Soft body: it is the body that gives way, so that the contact acts nearer to its centre.

    r ← r_shape + d (l, 1),   d = λ |v_n|

Where a hard body sinks into a soft surface, the force acts at its lowest point.  Where a soft body is flattened, it
acts in the middle of the chord that the surface cuts off.  Of an ellipse that lies on the line from the lowest point to
the centre, l = r_x/r_y, as all chords of one direction have their middles on one diameter.  Of a corner it lies between
the two sides that meet there, l = (cot β + cot β')/2 with their angles β, β' from the surface.

The depth d is the mean over the contact, weighted with the force.  Under a linear spring it is half of what the arc
sinks in until the impulse acts, so that λ = τ/2 if only the body gives way, and 0 if only the surface does.

| on paper | in code | unit | shape |                                                       |
|----------|---------|------|-------|-------------------------------------------------------|
| λ        | `lam`   | s    |       | mean depth in the body over the speed of the impact   |
| d        | `depth` | m    | (n,)  | mean depth in the body                                |
| l        | `lean`  | 1    | (n,)  | way along the surface over way up, of the chord's middle |
"""

import numpy as np

from thesis_lib.bodies.shapes import Corner, Polygon, Shape
from thesis_lib.effects.effect import Effect, Parameter

STEEPEST = 4.0  # cot β of a side 14° from the surface


class SoftBody(Effect):
    name = "soft_body"
    family = "geometry"
    title = "the body gives way"
    equation = "r = r_shape(θ) + λ |v_n| (l, 1)"
    parameters = (Parameter("lam", "s", null=0.0, low=0.0, high=3e-3, scale=1e-4),)
    needs_contact_time = True
    needs_angle = True
    reference = "Johnson 1985, chapter 4 (both bodies give way in the ratio of their compliances)"

    def contact_point(self, r, state, p, rig):
        depth = p["lam"] * np.maximum(-(state.vy + rig.lowest(state)[0] * state.omega), 0.0)
        return r + np.array((depth * lean(rig.shape, state.theta), depth))


def lean(shape: Shape | Corner, theta: np.ndarray) -> np.ndarray:
    """l (n,) of bodies at angles θ (n,) in rad, at most `STEEPEST`: further on, the whole side touches."""
    polygon = shape.polygon if isinstance(shape, Corner) else shape
    r = shape.contact_point(theta)
    if not isinstance(polygon, Polygon):
        return r[:, 0] / r[:, 1]
    corners, sin, cos = polygon.corners, np.sin(theta), np.cos(theta)
    index = (
        shape.index
        if isinstance(shape, Corner)
        else (np.outer(sin, corners[:, 0]) + np.outer(cos, corners[:, 1])).argmin(axis=1)
    )
    slopes = []
    for step in (1, -1):
        x, y = (corners[(index + step) % len(corners)] - corners[index]).T
        across, up = cos * x - sin * y, sin * x + cos * y
        slopes.append(np.clip(np.divide(across, up, out=np.zeros_like(up), where=up > 0.0), -STEEPEST, STEEPEST))
    return 0.5 * (slopes[0] + slopes[1])


EFFECT = SoftBody()
