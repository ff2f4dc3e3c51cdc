"""MuJoCo's contact as a damped half-oscillation: settings, and the map from (ε, T) to stiffness and damping.

MuJoCo requires the acceleration a* = −B v − K φ of a contact (`solref`, direct: −K, −B), where φ < 0 is the gap and v
its rate.  It applies a force, never a pull, that changes the acceleration a without contact to

    a + d' (a* − a),    d' = A / (A + R),    R = (1 − d)/d · Â

A is the effective inverse mass of the contact, Â MuJoCo's estimate of it (`body_invweight0`, one number for a body in
any pose), and d the impedance (`solimp`).  MuJoCo divides its K and B by d.  The contact therefore has

    d near 1   the same duration and restitution for any effective mass: a lever does not shorten the contact
    d near 0   an independent spring and damper: the force depends only on gap and rate, as in real materials

MuJoCo's default is 0.9 to 0.95; the default here is 0.01, since no material depends on the mass behind a contact.

Friction requires a* = −B v of the slip, within the elliptic cone |f_t| ≤ μ f_n.  It is viscous, and Coulomb friction
only in fast sliding: near d = 1 it has the rate B of the normal damping, and a sticking contact keeps the share ε² of
its slip; near d = 0 it is `impratio` times as strong as the normal damper.  Since a convex program determines force and
slip together, a sliding body is lifted by the part of the friction beyond the cone, μ v_t / v_n of the damper's force.
A faster decay of the slip (`solreffriction`) lifts it more, until bodies gain energy, and is not used.

A mass that lands with v at φ = 0 and leaves when the force is 0 has, with K = ω², B = 2 ζ ω,

    ω T = 2 arccos ζ / √(1 − ζ²),    ε = exp(−ζ ω T)

(arcosh ζ / √(ζ² − 1) for ζ > 1), independent of v.  ε falls to exp(−2) at ζ = 1.

Sources: E. Todorov, T. Erez, Y. Tassa, IROS 2012, doi 10.1109/IROS.2012.6386109, and MuJoCo's documentation,
"Computation", section "Constraint model" (a*, d, R); T. Schwager and T. Pöschel 2007, Granular Matter 9, 465, doi
10.1007/s10035-007-0065-z (a spring and damper without pull).
"""

import math

import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from thesis_lib.simulate.rig.hidden_causes import CompliantContact

COARSEST = 20  # smallest number of steps per contact time; ε then varies by 1 % with the instant of touch within a step
GROWS = (1e-3, 0.5, 2.0)  # width in m, midpoint and power of solimp, MuJoCo's defaults
MOST_DAMPED = 20.0  # largest damping ratio ζ; ε is then 0.0006


class MujocoContact(CompliantContact):
    """MuJoCo's contact; `exponent` must be 1, as its spring is linear."""

    contact_time: float = Field(1e-3, gt=0, le=5e-3, description="s, central impact at any speed")
    impedance: float = Field(
        0.01, ge=1e-4, le=0.9999, description="d of solimp, 1; near 0: an independent spring and damper"
    )
    deep_impedance: float | None = Field(
        None, ge=1e-4, le=0.9999, description="d at a depth of 1 mm or more; null: as at the touch"
    )
    # at 10, slip decays ten times as fast as by the damper of the normal force: within a tenth of the contact
    impratio: float = Field(10.0, ge=1, le=1000, description="impedance of friction over that of the normal force, 1")

    @property
    def solimp(self) -> tuple[float, ...]:
        """MuJoCo's five numbers of the impedance: at the touch, at depth, and its growth between them."""
        return (self.impedance, self.deep_impedance or self.impedance, *GROWS)


def damped_bounce(damping_ratio: float) -> tuple[float, float]:
    """Restitution ε and duration ω T, both 1, of a contact with the damping ratio ζ ≥ 0."""
    z = damping_ratio
    if abs(z - 1.0) < 1e-6:
        duration = 2.0
    elif z < 1.0:
        duration = 2.0 * math.acos(z) / math.sqrt(1.0 - z * z)
    else:
        duration = 2.0 * math.acosh(z) / math.sqrt(z * z - 1.0)
    return math.exp(-z * duration), duration


def spring_and_damper(epsilon: float, contact_time: float) -> tuple[float, float]:
    """K in 1/s² and B in 1/s, per mass, for a central impact with restitution `epsilon` that lasts `contact_time` s."""
    ratio = brentq(lambda z: damped_bounce(z)[0] - epsilon, 0.0, MOST_DAMPED, xtol=1e-14) if epsilon < 1.0 else 0.0
    omega = damped_bounce(ratio)[1] / contact_time  # pyright: ignore[reportArgumentType]
    return omega**2, 2.0 * ratio * omega  # pyright: ignore[reportOperatorIssue]


def restitution_and_time(stiffness: float, damping: float) -> tuple[float, float]:
    """ε (1) and T (s) of a central impact with K (1/s²) and B (1/s) per mass: the inverse of `spring_and_damper`."""
    omega = math.sqrt(stiffness)
    epsilon, duration = damped_bounce(damping / (2.0 * omega))
    return epsilon, duration / omega


def solref(epsilon: np.ndarray | float, contact_time: np.ndarray | float, share: float) -> np.ndarray:
    """MuJoCo's `solref` (..., 2) for restitutions and times in s (...); `share` is d' of a central impact over d."""
    both = zip(np.ravel(epsilon), np.ravel(contact_time))
    flat = [spring_and_damper(float(one), float(time)) for one, time in both]
    return -np.array(flat).reshape(*np.shape(epsilon), 2) / share
