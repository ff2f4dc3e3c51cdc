"""Candidate effects of a mechanism: generalised forces that its believed model may lack.

    viscous_joint_friction   Q_i = -b_i q̇_i                                   each driven joint
    coulomb_joint_friction   Q_i = -f_i tanh(q̇_i / q̇_s)
    gravity_direction        Q = (Y(q, 0, 0; g) - Y(q, 0, 0; R(α) g)) π        α > 0 turns gravity towards +x
    payload                  Q = -m_p Y(q, v, v̇) π_1                           π_1 of 1 kg at the declared place
    rolling_resistance       Q_θ = -c_rr ρ N tanh(ω / ω_s)
    viscous_rotation         Q_θ = -b ω                                        the wheel in its air or guide
    torque_offset            Q_i = o_i                                         a fault of the torque sensor

All use the measured motion of a step, with v̇ = (v_{k+1} − v_k) / h.  N is the model's normal force in this step.  The
small speeds q̇_s and ω_s smooth the sign function.

Sources: H. Olsson et al., Eur. J. Control 4 (1998), doi 10.1016/S0947-3580(98)70113-X (friction); K. L. Johnson,
Contact Mechanics, 1985, doi 10.1017/CBO9781139171731, section 9 (rolling resistance).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.mechanisms.model import BelievedModel
from thesis_lib.effects.effect import Parameter

# rad/s; a hundredth of typical speeds: nearly a sign function, but smooth enough for a step at rest
SMOOTH_JOINT, SMOOTH_ROLLING = 0.02, 0.03


@dataclass(frozen=True)
class Motion:
    """n steps of measured motion: q, v, a (n, nv) in m, rad and s; normal forces `c_n` (n, p) of the pairs in N."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    c_n: np.ndarray


ForceOf = Callable[[BelievedModel, Motion, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class MechanismEffect:
    """One candidate effect.

    Attributes:
        name, family, title, equation, reference: as for effects of impacts.
        parameters: as for effects of impacts; the linear fit does not enforce their bounds.
        force: Q (n, nv) in N or N m from model, motion and parameters, (n_p,) or one set per step (n, n_p).
        needs_normal: whether Q depends on contact forces.
    """

    name: str
    family: str
    title: str
    equation: str
    parameters: tuple[Parameter, ...]
    force: ForceOf
    reference: str
    needs_normal: bool = False

    @property
    def scales(self) -> np.ndarray:
        """(n,) sizes that would matter."""
        return np.array([p.scale for p in self.parameters])


def _parameter(name: str, unit: str, high: float, scale: float, low: float = 0.0) -> Parameter:
    return Parameter(name, unit, null=0.0, low=low, high=high, scale=scale)


def _viscous(model: BelievedModel, motion: Motion, p: np.ndarray) -> np.ndarray:
    Q = np.zeros_like(motion.v)
    Q[:, : model.joints] = -p * motion.v[:, : model.joints]
    return Q


def _coulomb(model: BelievedModel, motion: Motion, p: np.ndarray) -> np.ndarray:
    Q = np.zeros_like(motion.v)
    Q[:, : model.joints] = -p * np.tanh(motion.v[:, : model.joints] / SMOOTH_JOINT)
    return Q


def _torque_offset(model: BelievedModel, motion: Motion, p: np.ndarray) -> np.ndarray:
    Q = np.zeros_like(motion.v)
    Q[:, : model.joints] = p
    return Q


def _gravity(model: BelievedModel, motion: Motion, p: np.ndarray) -> np.ndarray:
    alpha = p[..., 0]
    gx, gy = model.gravity
    # g - R(α) g; gravity's share of Y is linear in gravity
    change = (gx * (1.0 - np.cos(alpha)) + gy * np.sin(alpha), gy * (1.0 - np.cos(alpha)) - gx * np.sin(alpha))
    still = np.zeros_like(motion.v)
    shares = [model.regressor(motion.q, still, still, unit) @ model.parameters for unit in np.eye(2)]
    return sum((np.asarray(c)[..., None] * share for c, share in zip(change, shares)), np.zeros(1))


def _payload(model: BelievedModel, motion: Motion, p: np.ndarray) -> np.ndarray:
    return -p[..., :1] * (model.regressor(motion.q, motion.v, motion.a) @ model.payload)


def _rolling(model: BelievedModel, motion: Motion, p: np.ndarray) -> np.ndarray:
    radius, pairs = model.roller
    Q = np.zeros_like(motion.v)
    normal = motion.c_n[:, list(pairs)].sum(axis=1)
    Q[:, -1] = -p[..., 0] * radius * normal * np.tanh(motion.v[:, -1] / SMOOTH_ROLLING)
    return Q


def _rotation(model: BelievedModel, motion: Motion, p: np.ndarray) -> np.ndarray:
    Q = np.zeros_like(motion.v)
    Q[:, -1] = -p[..., 0] * motion.v[:, -1]
    return Q


_OLSSON = "Olsson et al. 1998"
_JOHNSON = "Johnson 1985, section 9"
GRAVITY = MechanismEffect(
    "gravity_direction",
    "surface",
    "gravity in another direction than believed",
    "g → R(α) g",
    (_parameter("alpha", "rad", 0.5, 0.01, low=-0.5),),
    _gravity,
    "geometry",
)
PAYLOAD = MechanismEffect(
    "payload",
    "inertia",
    "a payload that the model lacks",
    "π → π + m_p π_1",
    (_parameter("m_p", "kg", 10.0, 0.01),),
    _payload,
    "Khalil and Dombre 2002",
)
ROLLING = MechanismEffect(
    "rolling_resistance",
    "contact_law",
    "rolling resistance",
    "Q_θ = −c_rr ρ N sign(ω)",
    (_parameter("c_rr", "1", 0.5, 0.01),),
    _rolling,
    _JOHNSON,
    needs_normal=True,
)
ARM_EFFECTS: tuple[MechanismEffect, ...] = (
    MechanismEffect(
        "viscous_joint_friction",
        "joint",
        "viscous friction of the joints",
        "Q_i = −b_i q̇_i",
        (_parameter("b_1", "N m s", 5.0, 0.05), _parameter("b_2", "N m s", 5.0, 0.05)),
        _viscous,
        _OLSSON,
    ),
    MechanismEffect(
        "coulomb_joint_friction",
        "joint",
        "Coulomb friction of the joints",
        "Q_i = −f_i sign(q̇_i)",
        (_parameter("f_1", "N m", 5.0, 0.05), _parameter("f_2", "N m", 5.0, 0.05)),
        _coulomb,
        _OLSSON,
    ),
    GRAVITY,
    PAYLOAD,
    ROLLING,
    MechanismEffect(
        "torque_offset",
        "measurement",
        "an offset of the torque sensors",
        "Q_i = o_i",
        (_parameter("o_1", "N m", 5.0, 0.05, low=-5.0), _parameter("o_2", "N m", 5.0, 0.05, low=-5.0)),
        _torque_offset,
        "geometry",
    ),
)
WHEEL_EFFECTS: tuple[MechanismEffect, ...] = (
    GRAVITY,
    PAYLOAD,
    ROLLING,
    MechanismEffect(
        "viscous_rotation",
        "joint",
        "a moment against rotation, proportional to it",
        "Q_θ = −b ω",
        (_parameter("b", "N m s", 5.0, 0.05),),
        _rotation,
        _OLSSON,
    ),
)
