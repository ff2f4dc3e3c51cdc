"""Later friction: hits after the first of a toss have another friction (a face that has become wet or dusty).

    μ ← μ (1 + d)   for all hits but the first of each toss

| on paper | in code | unit | shape |                                                       |
|----------|---------|------|-------|-------------------------------------------------------|
| d        | `d`     | 1    |       | relative change from the first hit to all later ones  |

A change from toss to toss is described by wear.
"""

import numpy as np

from thesis_lib.effects.effect import ONLY_SPACE, Effect, Parameter


class LaterFriction(Effect):
    name = "later_friction"
    family = "contact_law"
    title = "another friction at later hits"
    equation = "μ = μ₀ (1 + d) after the first hit"
    parameters = (Parameter("d", "1", null=0.0, low=-0.95, high=3.0, scale=0.1),)
    needs_history = True
    dimensions = ONLY_SPACE
    reference = "definition of the coefficient of friction"

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        later = rig.recorded is not None and rig.recorded.is_later(state)
        factor = np.where(later, 1.0 + p["d"], 1.0)
        return mu * factor, epsilon


EFFECT = LaterFriction()
