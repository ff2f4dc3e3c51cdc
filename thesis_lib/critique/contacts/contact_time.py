"""Duration of a contact, to first order, and the parameters of a law without effects.

A real contact has a finite duration.  Let s(t) be the fraction of the impulse that has acted at the time t after touch.
Between touch and release the body moves by v⁻ t + Δv ∫ s dt; to first order the free arcs (ballistic trajectories)
before and after therefore meet at the centroid t̄ = ∫ t s' dt of the impulse.  The arc before touches the surface at
the time t̄ before they meet, and where they meet the contact point is about t̄ |v_n| below the surface:

    φ_n(q⁻(−t̄)) = 0,    t̄ = τ / √b,    b = Δv_n / c_n

b⁻¹ is the effective mass of the contact, K_nn⁻¹ without friction; the period of a spring under it grows as its root.

By the time the impulse acts, the body has turned further than on the arc before, because Δω builds up in the meantime.
Weighted with the impulse this turn is Δω ∫ s' S dt, S = ∫ s dt; for a half sine of force t̄ = T/2, the integral is T/8:

    r = r(θ + Δω t̄/4)

A half sine that returns the fraction ε² of its work from a steeper spring (Walton and Braun 1986) has
τ = T (ε + (1 − ε) 2/π) / (1 + ε); T is 1.6 to 2 times τ.  Only trajectories show τ.  Effects may vary τ by impact.

| on paper | in code | unit | shape | meaning                                                                  |
|----------|---------|------|-------|--------------------------------------------------------------------------|
| τ        | `tau`   | s    |       | time from touch to the centroid of the impulse, in a central impact      |
| t̄        | `delay` | s    | (n,)  | the same in each impact                                                  |
| b        |         | 1    | (n,)  | normal velocity over normal impulse per unit mass, with its friction     |
| T        |         | s    |       | duration of a central contact                                            |
"""

from dataclasses import replace

import numpy as np

from thesis_lib.contact.compliant.normal_force import ConvexDamper, PressureField, PyramidDamper
from thesis_lib.effects.effect import Parameter

BASE_PARAMETERS = (
    Parameter("mu", "1", null=0.1, low=0.0, high=2.0, scale=0.05),
    Parameter("epsilon", "1", null=0.5, low=0.0, high=1.0, scale=0.05),
)
CONTACT_TIME = Parameter("tau", "s", null=0.0, low=0.0, high=5e-3, scale=1e-3)
# of a convex contact: ratio of tangential to normal damping
DAMPING_RATIO = Parameter("damping_ratio", "1", null=10.0, low=0.01, high=500.0, scale=1.0)
# of a convex contact: near 0 the force is that of a spring and a damper, near 1 the motion of the contact does not
# depend on the effective mass; d of MuJoCo's solimp, for a body that cannot leave its plane
IMPEDANCE = Parameter("impedance", "1", null=0.01, low=1e-3, high=0.9999, scale=0.1, starts=(0.9, 0.99))
# of friction on a pyramid: R_t m = (1 − d)/d; d of MuJoCo's solimp for impratio = 1
OF_PYRAMID = replace(IMPEDANCE, null=0.9, low=0.1)
# angle of a pyramid's edges about the normal, from t_1: an engine's axes differ from the camera's
EDGE_ANGLE = Parameter("edge_angle", "rad", null=0.0, low=-1.0, high=1.0, scale=0.05, starts=(-0.5, 0.5))
# of a pressure field: the slip at which friction is half of Coulomb's limit
STICTION_TOLERANCE = Parameter("stiction_tolerance", "m/s", null=1e-3, low=0.0, high=0.05, scale=1e-3)
OF_FRICTION = {
    ConvexDamper: (DAMPING_RATIO, IMPEDANCE),
    PyramidDamper: (OF_PYRAMID, EDGE_ANGLE),
    PressureField: (STICTION_TOLERANCE,),
}
LEAST_MOBILITY = 0.25  # least b; below it the contact jams and does not act as a spring under a mass
TURNED = 0.25  # relative to t̄ Δω: turn of the body until the impulse acts, beyond the arc before


def duration(tau: float, epsilon: float) -> float:
    """Duration T in s of a central contact with τ in s and restitution ε, for the hysteretic spring described above."""
    return tau * (1.0 + epsilon) / (epsilon + (1.0 - epsilon) * 2.0 / np.pi)


def normal_mobility(push: np.ndarray, gained: np.ndarray) -> np.ndarray:
    """b (n,) from the normal velocity that the centre of mass (`push`) and contact point gain; 1 without a push."""
    b = np.divide(gained, push, out=np.ones_like(push), where=push > 0.0)
    return np.maximum(b, LEAST_MOBILITY)
