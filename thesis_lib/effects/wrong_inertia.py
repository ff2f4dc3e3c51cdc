"""Wrong inertia: the radius of gyration differs from its assumed value.

    k ← k √(1 + d_I),   I = m k²

| on paper | in code | unit | shape |                                                |
|----------|---------|------|-------|------------------------------------------------|
| d_I      | `d_I`   | 1    |       | relative error of the moment of inertia        |
| k        | `k_g`   | m    |       | radius of gyration                             |
"""

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class WrongInertia(Effect):
    name = "wrong_inertia"
    family = "inertia"
    title = "wrong inertia"
    equation = "k² = k₀² (1 + d_I)"
    equation_in_space = "I = I₀ (1 + d_I)"
    parameters = (Parameter("d_I", "1", null=0.0, low=-0.7, high=2.0, scale=0.1),)
    denies = "inertia"
    needs_angle = True
    dimensions = IN_SPACE
    reference = "definition of the radius of gyration"

    def inertia(self, G, p):
        return G * (1.0 + p["d_I"])


EFFECT = WrongInertia()
