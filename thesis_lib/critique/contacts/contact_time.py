"""How long a contact takes, to first order, and the parameters of a law without effects.

A real contact takes time.  Let s(t) be the share of the impulse that has acted t after touch.  Between touch and
release the body moves by v⁻ t + Δv ∫ s dt, so to first order the free arcs before and after meet at the centroid
t̄ = ∫ t s' dt of the impulse.  A time t̄ earlier the free arc touches; there the contact point is about t̄ |v_n| below:

    φ_n(q⁻(−t̄)) = 0,    t̄ = τ / √b,    b = Δv_n / c_n

b⁻¹ is the mass that the contact sees, K_nn⁻¹ without friction; a spring under it swings with the root of it.

Until the impulse acts the body has turned by more than that arc says, because Δω builds up meanwhile.  Weighted with
the impulse this is Δω ∫ s' S dt with S = ∫ s dt; for a half sine of force t̄ = T/2 and the integral is T/8:

    r = r(θ + Δω t̄/4)

A half sine that returns the share ε² of its work from a steeper spring (Walton and Braun 1986) has
τ = T (ε + (1 − ε) 2/π) / (1 + ε), so T is 1.6 to 2 times τ.  Impacts without trajectories do not show τ.  Effects may
change τ from impact to impact.

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
# of a convex contact: damping of the slip over that of the normal force
DAMPING_RATIO = Parameter("damping_ratio", "1", null=10.0, low=0.01, high=500.0, scale=1.0)
# of a convex contact: near 0 its force is that of a spring and a damper, near 1 it gives the contact the same motion
# whatever mass stands behind it; d of MuJoCo's solimp, for a body that cannot leave its plane
IMPEDANCE = Parameter("impedance", "1", null=0.01, low=1e-3, high=0.9999, scale=0.1, starts=(0.9, 0.99))
# of friction on a pyramid: R_t m = (1 − d)/d; d of MuJoCo's solimp at an impratio of 1
OF_PYRAMID = replace(IMPEDANCE, null=0.9, low=0.1)
# the turn of a pyramid's edges about the normal, from t_1: an engine's axes are not those of the camera
EDGE_ANGLE = Parameter("edge_angle", "rad", null=0.0, low=-1.0, high=1.0, scale=0.05, starts=(-0.5, 0.5))
# of a pressure field: the slip at which friction is half of Coulomb's
STICTION_TOLERANCE = Parameter("stiction_tolerance", "m/s", null=1e-3, low=0.0, high=0.05, scale=1e-3)
OF_FRICTION = {
    ConvexDamper: (DAMPING_RATIO, IMPEDANCE),
    PyramidDamper: (OF_PYRAMID, EDGE_ANGLE),
    PressureField: (STICTION_TOLERANCE,),
}
LEAST_MOBILITY = 0.25  # b; less is a jam, in which a contact does not act as a spring under a mass
TURNED = 0.25  # of t̄ Δω: turning of the body until the impulse acts, beyond that of the arc before


def duration(tau: float, epsilon: float) -> float:
    """T in s of a central contact with τ in s and the restitution ε, for the hysteretic spring of the docstring."""
    return tau * (1.0 + epsilon) / (epsilon + (1.0 - epsilon) * 2.0 / np.pi)


def normal_mobility(push: np.ndarray, gained: np.ndarray) -> np.ndarray:
    """b (n,) from the gain of normal velocity of the centre of mass and of the contact point; 1 without a push."""
    b = np.divide(gained, push, out=np.ones_like(push), where=push > 0.0)
    return np.maximum(b, LEAST_MOBILITY)
