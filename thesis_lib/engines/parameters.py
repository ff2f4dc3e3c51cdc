"""Contact parameters of physics engines, computed from μ, ε and the contact time T, and back.

The model file of an engine has no ε and no T.  MuJoCo has `solref` and `solimp` instead; Drake has a stiffness, or a
modulus, and Hunt and Crossley's dissipation.  Both engines act at points, and a solid body touches a plane in more
points than a planar one: the edge of a prism touches with its two ends.  `points` is the number of these points.

MuJoCo, direct `solref` (−K/s, −B/s): all points demand the acceleration a* = −(K φ + B v)/(s d), and with the
impedance d of `solimp` together produce the share s d of it,

    s = 1 / (d + (1 − d)/n)        n points, central contact of a free body

(`thesis_lib/simulate/mujoco/contact.py` for a planar body).  Off the centre, s also depends on d.  The contact is the
same in space and in the plane if R/n is the same; d is therefore smaller, the more points there are.  Positive `solref`
(t, ζ), MuJoCo's usual form, means K = 1/(d t ζ)², B = 2/(d t) in a*, with the impedance d of the deepest contact.

Drake, point contact: the springs of both bodies act in series, so each has 2 k/n; friction is the harmonic mean of both
coefficients, so each is μ; dissipation is the mean for equally stiff bodies, so each has d.

Bullet, soft contact: a spring k and a damper c at each point, all on the body; the surface is rigid and undamped.
Friction is the product of both coefficients, so the surface has 1.  Spring and damper act on the state after the time
step h, which damps like c + k h: the numbers hold for one time step, and the largest ε is the one that c = 0 leaves.

| on paper | in code       | unit      |                                                             |
|----------|---------------|-----------|-------------------------------------------------------------|
| K, B     |               | 1/s², 1/s | stiffness and damping per mass of a central contact         |
| d, s     | `impedance`, `share` | 1  | impedance; share of the acceleration over d                 |
| k        | `stiffness`   | N/m       | of the contact; `of_geometry` is the stiffness of one body's geometry |
| d        | `dissipation` | s/m       | Hunt and Crossley's                                         |
| c        | `damping`     | N s/m     | of a point in Bullet                                        |
| h        | `step`        | s         | Bullet's time step                                          |

Sources: MuJoCo's documentation, "Solver parameters"; Drake's documentation, "Compliant point contact"; PyBullet's
Quickstart Guide, "changeDynamics"; R. Smith, Open Dynamics Engine, User Guide, 3.8.2 (spring and damper as ERP, CFM).
"""

import cmath
from dataclasses import dataclass

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.drake.hunt_crossley import duration, restitution, spring
from thesis_lib.simulate.mujoco.contact import GROWS, restitution_and_time, solref, spring_and_damper
from thesis_lib.simulate.rig.hidden_causes import REFERENCE_SPEED

PLANAR = 2.0 / 3.0  # times 1/m: MuJoCo's estimate of the inverse mass of a body that cannot leave its plane
LEAST_FRICTION = 1e-5  # MuJoCo's smallest μ
SETTLE = 8  # iterations that determine the effect of the first step of Bullet's damper


@dataclass(frozen=True)
class MujocoNumbers:
    """Contact parameters of MJCF; `solref` is direct (negative), or (time constant in s, damping ratio)."""

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    friction: float
    impratio: float


@dataclass(frozen=True)
class DrakeNumbers:
    """Parameters of a point contact in SDF and URDF: `stiffness` of one geometry in N/m, `dissipation` in s/m, μ."""

    stiffness: float
    dissipation: float
    friction: float


@dataclass(frozen=True)
class BulletNumbers:
    """Parameters of a soft contact in Bullet: `stiffness` in N/m, `damping` in N s/m, μ."""

    stiffness: float
    damping: float
    friction: float


def share(impedance: float, points: float = 1) -> float:
    """Return s, dimensionless, of a central contact of a free body that touches in `points` points."""
    return 1.0 / (impedance + (1.0 - impedance) / points)


def mujoco_numbers(
    mu: float,
    epsilon: float,
    contact_time: float,
    *,
    impedance: float = 0.01,
    impratio: float = 10.0,
    points: int = 1,
    estimate: float = PLANAR,
    on_pyramid: bool = False,
) -> MujocoNumbers:
    """Return MuJoCo's parameters for a free body that touches in `points` points; `contact_time` in s.

    `impedance` is defined as in `MujocoContact`, for a body that touches in one point and whose inverse mass MuJoCo
    estimates as `estimate` times 1/m (default: a planar body).  `on_pyramid`: pyramidal cone and an impratio of 1.
    """
    d = 1.0 / (1.0 + points * estimate * (1.0 - impedance) / impedance)
    # the four edges of the pyramid, each with R_e = 2 μ² R, act together along the normal
    shared = 2.0 * points / max(mu, LEAST_FRICTION) ** 2 if on_pyramid else points
    K, B = solref(epsilon, contact_time, share(d, shared))
    return MujocoNumbers((float(K), float(B)), (d, d, *GROWS), mu, impratio)


def of_mujoco(numbers: MujocoNumbers, points: int = 1) -> tuple[float, float, float]:
    """Return μ, ε and T (s) of a central impact with these parameters, at the impedance of a deep contact.

    UserError for a `solref` with one positive and one negative number, which MuJoCo also refuses.
    """
    first, second = numbers.solref
    d = numbers.solimp[1]
    if first > 0.0 and second > 0.0:
        first, second = -1.0 / (d * first * second) ** 2 * d, -2.0 / first  # values in the direct form
    if first >= 0.0 or second > 0.0:
        raise UserError(f"solref must be two positive or two negative numbers; got {numbers.solref}.")
    s = share(d, points)
    return (numbers.friction, *restitution_and_time(-first * s, -second * s))


def drake_numbers(
    mu: float, epsilon: float, contact_time: float, *, mass: float, points: int = 1, speed: float | None = None
) -> DrakeNumbers:
    """Return the point-contact parameters of both geometries, for a body of `mass` kg touching in `points` points.

    ε and T (s) refer to a central impact at `speed` in m/s; None: at `REFERENCE_SPEED`.
    """
    made = spring(epsilon, contact_time, mass, speed or REFERENCE_SPEED)
    return DrakeNumbers(2.0 * made.stiffness / points, made.dissipation, mu)


def of_drake(
    numbers: DrakeNumbers, mass: float, points: int = 1, speed: float | None = None
) -> tuple[float, float, float]:
    """Return μ, ε and T (s) of a central impact at `speed` with these parameters in both geometries."""
    speed = speed or REFERENCE_SPEED
    stiffness = 0.5 * points * numbers.stiffness
    lasts = duration(numbers.dissipation * speed, 1.0) * (mass / stiffness) ** 0.5
    return numbers.friction, restitution(numbers.dissipation, speed), lasts


def bullet_numbers(
    mu: float, epsilon: float, contact_time: float, *, mass: float, step: float, points: int = 1
) -> BulletNumbers:
    """Return Bullet's parameters for a body of `mass` kg touching in `points` points, with time steps of `step` s."""
    K = B = 0.0
    for _ in range(SETTLE):
        K, B = spring_and_damper(min(epsilon * _start(B, step), 1.0), contact_time)
    # a step multiplies a mode by exp(λ h) in the oscillation, and by 1/(1 − s h) in Bullet
    one, two = ((1.0 - cmath.exp(-rate * step)) / step for rate in _rates(K, B))
    stiffness, damping = (one * two).real, -(one + two).real
    return BulletNumbers(mass * stiffness / points, mass * max(damping, 0.0) / points, mu)


def of_bullet(numbers: BulletNumbers, mass: float, step: float, points: int = 1) -> tuple[float, float, float]:
    """Return μ, ε and T (s) of a central impact with these parameters and time steps of `step` s."""
    rates = _rates(points * numbers.stiffness / mass, points * numbers.damping / mass)
    one, two = (-cmath.log(1.0 - rate * step) / step for rate in rates)
    epsilon, contact_time = restitution_and_time((one * two).real, -(one + two).real)
    return numbers.friction, epsilon / _start(-(one + two).real, step), contact_time


def _start(damping: float, step: float) -> float:
    """Return the factor by which the first step lowers ε, because the damper's force starts with a jump."""
    return 1.0 + 0.5 * damping * step


def _rates(stiffness: float, damping: float) -> tuple[complex, complex]:
    """Return both eigenvalues λ in 1/s of x'' = −B x' − K x."""
    root = cmath.sqrt(0.25 * damping**2 - stiffness)
    return -0.5 * damping + root, -0.5 * damping - root
