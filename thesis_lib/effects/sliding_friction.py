"""Sliding friction: the coefficient of friction of a sliding body differs from the coefficient in impacts.

    a_t = −μ_s a_n sign(v_t)   while the surface supports the body: no impact in the last 15 ms

The coefficient μ of the law holds for impacts, which last a millisecond at thousands of newtons per kilogram; dust,
creep of the contact and ploughing edges make it differ in slow sliding.  Without the effect μ holds for both.  In space
friction opposes the slip, whatever its direction.

| on paper | in code | unit | shape |                                              |
|----------|---------|------|-------|----------------------------------------------|
| μ_s      | `mu_s`  | 1    |       | coefficient of friction while supported      |
| a_n      |         | m/s² | (m,)  | acceleration of flight towards the surface   |

Impacts and flights do not change.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class SlidingFriction(Effect):
    name = "sliding_friction"
    family = "contact_law"
    title = "another friction while sliding"
    equation = "a_t = −μ_s a_n sign(v_t) while supported, μ at impacts"
    equation_in_space = "a_t = −μ_s a_n v_t/|v_t| while supported, μ at impacts"
    parameters = (Parameter("mu_s", "1", null=0.3, low=0.0, high=2.0, scale=0.05, of="mu"),)
    channels = ("slide",)
    dimensions = IN_SPACE
    reference = "Yu, Bauza, Fazeli and Rodriguez 2016, doi:10.1109/IROS.2016.7758091"

    def sliding(self, mu, contact, state, p, rig):
        return np.zeros_like(mu) + p["mu_s"]


EFFECT = SlidingFriction()
