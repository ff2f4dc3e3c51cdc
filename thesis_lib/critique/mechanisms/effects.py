"""Candidate effects of a mechanism: generalised forces that its believed model may lack.

    viscous_joint_friction   Q_i = -b_i q̇_i                                   each driven joint
    coulomb_joint_friction   Q_i = -f_i tanh(q̇_i / q̇_s)
    gravity_direction        Q = (Y(q, 0, 0; g) - Y(q, 0, 0; R(α) g)) π        α > 0 turns gravity towards +x
    payload                  Q = -m_p Y(q, v, v̇) π_1                           π_1 of 1 kg at the stated place
    rolling_resistance       Q_θ = -c_rr ρ N tanh(ω / ω_s)
    viscous_rotation         Q_θ = -b ω                                        the wheel in its air or guide
    torque_offset            Q_i = o_i                                         a fault of the torque sensor

All effects use the measured motion of a step, with v̇ = (v_{k+1} − v_k) / h.  N is the model's normal force in this
step.  The small speeds q̇_s and ω_s smooth the sign function.

Sources: H. Olsson et al., Eur. J. Control 4 (1998), doi 10.1016/S0947-3580(98)70113-X (friction); K. L. Johnson,
Contact Mechanics, 1985, doi 10.1017/CBO9781139171731, section 9 (rolling resistance); W. Khalil, E. Dombre, Modeling,
Identification and Control of Robots, 2002, doi 10.1016/B978-1-903996-66-9.X5000-3 (payload).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from thesis_lib.critique.mechanisms.model import BelievedModel
from thesis_lib.effects.effect import Parameter
from thesis_lib.simulate.mechanisms.hidden_forces import MechanismKind

# rad/s; a hundredth of typical speeds: nearly a sign function, but smooth enough for a step at rest
SMOOTH_JOINT, SMOOTH_ROLLING = 0.02, 0.03


@dataclass(frozen=True)
class MotionSteps:
    """n steps of measured motion: q, v, a (n, nv) in m, rad and s; normal forces `c_n` (n, p) of the pairs in N.

    `f` (n, nv) is the known force in N or N m, `df` (n, nv) its time derivative; empty where neither is needed.
    """

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    c_n: np.ndarray
    f: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    df: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


Force = Callable[[BelievedModel, MotionSteps, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class MechanismEffect:
    """One candidate effect.

    Attributes:
        name, family, title, equation: as for effects of impacts.
        force: Q (n, nv) in N or N m from model, motion and parameters (n_p,).
        parameters: 0 without the effect; the linear fit ignores bounds.
        needs_normal: whether Q depends on contact forces.
        prior: standard deviation of each parameter about 0, for errors that a recording states; empty: no prior.
    """

    name: str
    family: str
    title: str
    equation: str
    force: Force
    parameters: tuple[Parameter, ...]
    needs_normal: bool = False
    prior: tuple[float, ...] = ()


def parameters(unit: str, scale: float, *names: str) -> tuple[Parameter, ...]:
    """Return parameters that are 0 without the effect and have no bounds."""
    return tuple(Parameter(name, unit, null=0.0, low=-np.inf, high=np.inf, scale=scale) for name in names)


def at_joints(of_joints: Callable[[np.ndarray, MotionSteps, int], np.ndarray]) -> Force:
    """Return the force at the driven joints, from a function of parameters, motion, and number of joints."""

    def force(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
        Q = np.zeros_like(motion.v)
        Q[:, : model.joints] = of_joints(p, motion, model.joints)
        return Q

    return force


def _gravity(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    (alpha,), (gx, gy) = p, model.gravity
    # g - R(α) g; gravity's share of Y is linear in gravity
    change = (gx * (1.0 - np.cos(alpha)) + gy * np.sin(alpha), gy * (1.0 - np.cos(alpha)) - gx * np.sin(alpha))
    still = np.zeros_like(motion.v)
    along_x, along_y = (model.regressor(motion.q, still, still, unit) @ model.parameters for unit in np.eye(2))
    return change[0] * along_x + change[1] * along_y


def _payload(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    return -p * (model.regressor(motion.q, motion.v, motion.a) @ model.payload)


def _on_roller(of_spin: Callable[[BelievedModel, MotionSteps, np.ndarray], np.ndarray]) -> Force:
    """Return the moment on the rolling body, from a function of its spin."""

    def force(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
        Q = np.zeros_like(motion.v)
        Q[:, -1] = -p * of_spin(model, motion, motion.v[:, -1])
        return Q

    return force


def _resisted(model: BelievedModel, motion: MotionSteps, spin: np.ndarray) -> np.ndarray:
    radius, pairs = model.roller
    return radius * motion.c_n[:, list(pairs)].sum(axis=1) * np.tanh(spin / SMOOTH_ROLLING)


OFFSET = at_joints(lambda p, motion, n: p)
GRAVITY = MechanismEffect(
    *("gravity_direction", "surface", "gravity in another direction than believed", "g → R(α) g"),
    *(_gravity, parameters("rad", 0.01, "alpha")),
)
PAYLOAD = MechanismEffect(
    *("payload", "inertia", "a payload that the model lacks", "π → π + m_p π_1"),
    *(_payload, parameters("kg", 0.01, "m_p")),
)
ROLLING = MechanismEffect(
    *("rolling_resistance", "contact_law", "rolling resistance", "Q_θ = −c_rr ρ N sign(ω)"),
    *(_on_roller(_resisted), parameters("1", 0.01, "c_rr")),
    needs_normal=True,
)
CANDIDATES: dict[MechanismKind, tuple[MechanismEffect, ...]] = {
    "arm": (
        MechanismEffect(
            *("viscous_joint_friction", "joint", "viscous friction of the joints", "Q_i = −b_i q̇_i"),
            *(at_joints(lambda p, motion, n: -p * motion.v[:, :n]), parameters("N m s", 0.05, "b_1", "b_2")),
        ),
        MechanismEffect(
            *("coulomb_joint_friction", "joint", "Coulomb friction of the joints", "Q_i = −f_i sign(q̇_i)"),
            at_joints(lambda p, motion, n: -p * np.tanh(motion.v[:, :n] / SMOOTH_JOINT)),
            parameters("N m", 0.05, "f_1", "f_2"),
        ),
        *(GRAVITY, PAYLOAD, ROLLING),
        MechanismEffect(
            *("torque_offset", "measurement", "an offset of the torque sensors", "Q_i = o_i"),
            *(OFFSET, parameters("N m", 0.05, "o_1", "o_2")),
        ),
    ),
    "wheel": (
        *(GRAVITY, PAYLOAD, ROLLING),
        MechanismEffect(
            *("viscous_rotation", "joint", "a moment against rotation, proportional to its rate", "Q_θ = −b ω"),
            *(_on_roller(lambda model, motion, spin: spin), parameters("N m s", 0.05, "b")),
        ),
    ),
}
