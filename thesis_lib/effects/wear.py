"""Wear: restitution drifts from one release to the next (worn corners, warming, loosening parts).

    ε ← clip(ε (1 + w (i − i_0)), 0, 1),   i the number of the release

ε on the right holds at the release i_0, the middle of the releases to which the model was fitted.

| on paper | in code       | unit    | shape |                                                |
|----------|---------------|---------|-------|------------------------------------------------|
| w        | `w`           | 1/trial |       | relative change per release; negative: wear    |
| i        | `state.trial` | 1       | (n,)  | order in which the releases were made          |
| i_0      | `rig.reference.trial` | 1 |     | release from which i is counted                |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class Wear(Effect):
    name = "wear"
    family = "contact_law"
    title = "wear"
    equation = "ε = ε₀ (1 + w (i − i₀))"
    parameters = (Parameter("w", "1/trial", null=0.0, low=-0.02, high=0.02, scale=1e-3),)
    along = ("trial",)
    dimensions = IN_SPACE
    reference = "first order of a slow drift (our choice)"

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + p["w"] * (state.trial - rig.reference.trial)), 0.0, 1.0)


EFFECT = Wear()
