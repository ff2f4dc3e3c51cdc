"""Sliding friction: a body that slides on the surface has another coefficient of friction than one that hits it.

    a_t = −μ_s a_n sign(v_t)   while the surface supports the body: for 15 ms nothing has hit it

The coefficient μ of the law is that of impacts, which last a millisecond at thousands of newtons per kilogram; dust,
creep of the contact and edges that plough make that of a slow slide another one.  Without the effect μ serves both.  In
space the friction is against the slip, whatever its direction.

| on paper | in code | unit | shape |                                              |
|----------|---------|------|-------|----------------------------------------------|
| μ_s      | `mu_s`  | 1    |       | coefficient of friction while supported      |
| a_n      |         | m/s² | (m,)  | acceleration of flight against the surface   |

Impacts and flights do not change.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class SlidingFriction(Effect):
    name = "sliding_friction"
    family = "contact_law"
    title = "another friction while sliding"
    equation = "a_t = −μ_s a_n sign(v_t) while supported, μ at impacts"
    parameters = (Parameter("mu_s", "1", null=0.3, low=0.0, high=2.0, scale=0.05, of="mu"),)
    channels = ("slide",)
    needs_trajectories = True
    dimensions = IN_SPACE
    reference = "Yu, Bauza, Fazeli and Rodriguez 2016, doi:10.1109/IROS.2016.7758091"

    def sliding(self, mu, contact, state, p, rig):
        return np.zeros_like(mu) + p["mu_s"]


EFFECT = SlidingFriction()
