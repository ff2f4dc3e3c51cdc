"""Drake's own contact, without a pad: a spring with a loss that grows with depth and rate, and its map from (ε, T).

Drake's compliant contact is f = k δⁿ (1 + d δ̇)₊ (Hunt and Crossley): n = 1 in point contact; in hydroelastic contact
n depends on the overlap of the two shapes and is about 2 for an ellipsoid or an edge.  A mass m that lands with speed v
leaves with ε v after the contact time T; in units of v and of the length L, where m v² = k L^(n+1),

    x'' = −xⁿ (1 + D x'),    x(0) = 0,    x'(0) = 1,    D = d v,    T = S L / v
    D (1 + ε) = ln((1 + D) / (1 − ε D))        (from v dv / (1 + d v) = −k/m δⁿ dδ, for any n)

ε therefore falls with the speed, from 1 at v → 0.  (ε, T) are those of a central impact at `REFERENCE_SPEED`.

Source: K. H. Hunt and F. R. E. Crossley 1975, doi 10.1115/1.3423596; R. Tedrake and the Drake development team, Drake,
https://drake.mit.edu ("Compliant point contact", "Hydroelastic contact").
"""

import math
from dataclasses import dataclass

from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from thesis_lib.simulate.rig.hidden_causes import REFERENCE_SPEED


@dataclass(frozen=True)
class Spring:
    """Point contact: `stiffness` k in N/m, `dissipation` d in s/m."""

    stiffness: float
    dissipation: float


def dissipation(epsilon: float, speed: float = REFERENCE_SPEED) -> float:
    """Dissipation d in s/m of a contact with restitution `epsilon` at `speed` in m/s."""
    if epsilon >= 1.0:
        return 0.0

    def excess(D: float) -> float:
        return D * (1.0 + epsilon) - math.log((1.0 + D) / (1.0 - epsilon * D))

    # positive for small D, as 1 − ε > 0, and negative near the pole; if ε is below 0.04, the zero is even closer to it
    most = (1.0 - 1e-12) / epsilon
    if excess(most) >= 0.0:
        return most / speed
    return brentq(excess, 1e-3 * (1.0 - epsilon), most) / speed  # pyright: ignore[reportOperatorIssue]


def restitution(d: float, speed: float) -> float:
    """Restitution ε of a contact with dissipation `d` in s/m at `speed` in m/s."""
    return -_bounce(d * speed, 1.0)[1]


def duration(damping: float, exponent: float) -> float:
    """Dimensionless duration S of a contact with D = `damping` and n = `exponent`."""
    return _bounce(damping, exponent)[0]


def _bounce(damping: float, exponent: float) -> tuple[float, float]:
    """Duration and final velocity of the contact in units of L and v, by numerical integration."""

    def rate(_: float, state: tuple[float, float]) -> list[float]:
        x, v = state
        return [v, -(max(x, 0.0) ** exponent) * max(1.0 + damping * v, 0.0)]

    def over(_: float, state: tuple[float, float]) -> float:
        return state[0]

    over.terminal, over.direction = True, -1.0  # type: ignore[attr-defined]
    made = solve_ivp(rate, (0.0, 1e3), [0.0, 1.0], events=over, method="DOP853", rtol=1e-10, atol=1e-12)
    return float(made.t_events[0][0]), float(made.y_events[0][0][1])


def spring(epsilon: float, contact_time: float, mass: float, speed: float = REFERENCE_SPEED) -> Spring:
    """Point contact of a body of `mass` kg with restitution `epsilon` (1) and duration `contact_time` (s)."""
    d = dissipation(epsilon, speed)
    depth = contact_time * speed / duration(d * speed, 1.0)
    return Spring(mass * speed**2 / depth**2, d)  # m v² = k L², T = S L / v
