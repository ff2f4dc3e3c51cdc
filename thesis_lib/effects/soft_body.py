"""Soft body: it is the body that gives way, so that the contact acts nearer to its centre.

    r ← r_shape (1 − d / |r_y,shape|),   d = λ |v_n|

Where a hard body sinks into a soft surface, the force acts at its lowest point.  Where a soft body is flattened, it
acts in the chord that the surface cuts off, whose middle lies on the line to the lowest point: of an ellipse exactly,
as all chords of one direction have their middles on one diameter.  In a corner it moves to the same side,
and about twice as far.

The depth d is the mean over the contact, weighted with the force.  Under a linear spring it is half of what the arc
sinks in until the impulse acts, so that λ = τ/2 if only the body gives way, and 0 if only the surface does.

| on paper | in code | unit | shape |                                                       |
|----------|---------|------|-------|-------------------------------------------------------|
| λ        | `lam`   | s    |       | mean depth in the body over the speed of the impact   |
| d        | `depth` | m    | (n,)  | mean depth in the body                                |
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class SoftBody(Effect):
    name = "soft_body"
    family = "geometry"
    title = "the body gives way"
    equation = "r = (1 − λ |v_n| / |r_y|) r_shape(θ)"
    parameters = (Parameter("lam", "s", null=0.0, low=0.0, high=3e-3, scale=1e-4),)
    needs_contact_time = True
    reference = "Johnson 1985, chapter 4 (both bodies give way in the ratio of their compliances)"

    def contact_point(self, r_x, r_y, state, p, rig):
        r = rig.shape.contact_point(state.theta)
        depth = p["lam"] * np.maximum(-(state.vy + r[:, 0] * state.omega), 0.0)
        return r_x + depth * r[:, 0] / r[:, 1], r_y + depth


EFFECT = SoftBody()
