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
Contact Mechanics, 1985, doi 10.1017/CBO9781139171731, section 9 (rolling resistance); W. Khalil, E. Dombre, Modeling,
Identification and Control of Robots, 2002, doi 10.1016/B978-1-903996-66-9.X5000-3 (payload).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from thesis_lib.critique.mechanisms.model import BelievedModel
from thesis_lib.effects.effect import Parameter
from thesis_lib.simulate.chapter2.hidden_forces import MechanismKind

# rad/s; a hundredth of typical speeds: nearly a sign function, but smooth enough for a step at rest
SMOOTH_JOINT, SMOOTH_ROLLING = 0.02, 0.03


@dataclass(frozen=True)
class MotionSteps:
    """n steps of measured motion: q, v, a (n, nv) in m, rad and s; normal forces `c_n` (n, p) of the pairs in N.

    `f` (n, nv) is the known force in N or N m, `df` (n, nv) its time derivative; None where neither is needed.
    `kept` is what `once` has made of the motion, which does not change with the normal forces.
    """

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    c_n: np.ndarray
    f: np.ndarray | None = None
    df: np.ndarray | None = None
    kept: dict[tuple[str, BelievedModel], tuple[np.ndarray, ...]] = field(default_factory=dict, repr=False)

    def once(
        self, name: str, model: BelievedModel, make: Callable[[], tuple[np.ndarray, ...]]
    ) -> tuple[np.ndarray, ...]:
        """What `make` returns of this motion under this model, normal forces apart; it is asked once for a `name`."""
        if (name, model) not in self.kept:
            self.kept[name, model] = make()
        return self.kept[name, model]


@dataclass(frozen=True)
class MechanismEffect:
    """One candidate effect.

    Attributes:
        name, family, title, equation: as for effects of impacts.
        force: Q (n, nv) in N or N m from model, motion and parameters (n_p,).
        parameters: 0 without the effect; the linear fit knows no bounds.
        needs_normal: whether Q depends on contact forces.
        prior: standard deviation of each parameter about 0, of errors that a recording states; empty: free.
    """

    name: str
    family: str
    title: str
    equation: str
    force: Callable[[BelievedModel, MotionSteps, np.ndarray], np.ndarray]
    parameters: tuple[Parameter, ...]
    needs_normal: bool = False
    prior: tuple[float, ...] = ()


def _parameters(unit: str, scale: float, *names: str) -> tuple[Parameter, ...]:
    return tuple(Parameter(name, unit, null=0.0, low=-np.inf, high=np.inf, scale=scale) for name in names)


def _at_joints(model: BelievedModel, motion: MotionSteps, of_speed: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Q of forces at the driven joints, from their speeds."""
    Q = np.zeros_like(motion.v)
    Q[:, : model.joints] = of_speed(motion.v[:, : model.joints])
    return Q


def _viscous(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    return _at_joints(model, motion, lambda speed: -p * speed)


def _coulomb(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    return _at_joints(model, motion, lambda speed: -p * np.tanh(speed / SMOOTH_JOINT))


def _torque_offset(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    return _at_joints(model, motion, lambda speed: np.broadcast_to(p, speed.shape))


def _gravity(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    (alpha,), (gx, gy) = p, model.gravity
    # g - R(α) g; gravity's share of Y is linear in gravity
    change = (gx * (1.0 - np.cos(alpha)) + gy * np.sin(alpha), gy * (1.0 - np.cos(alpha)) - gx * np.sin(alpha))

    def along_each() -> tuple[np.ndarray, ...]:
        still = np.zeros_like(motion.v)
        return tuple(model.regressor(motion.q, still, still, unit) @ model.parameters for unit in np.eye(2))

    along_x, along_y = motion.once("gravity", model, along_each)
    return change[0] * along_x + change[1] * along_y


def _payload(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    (of_unit,) = motion.once("payload", model, lambda: (model.regressor(motion.q, motion.v, motion.a) @ model.payload,))
    return -p * of_unit


def _rolling(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    radius, pairs = model.roller
    normal = motion.c_n[:, list(pairs)].sum(axis=1)
    Q = np.zeros_like(motion.v)
    Q[:, -1] = -p * radius * normal * np.tanh(motion.v[:, -1] / SMOOTH_ROLLING)
    return Q


def _rotation(model: BelievedModel, motion: MotionSteps, p: np.ndarray) -> np.ndarray:
    Q = np.zeros_like(motion.v)
    Q[:, -1] = -p * motion.v[:, -1]
    return Q


GRAVITY = MechanismEffect(
    *("gravity_direction", "surface", "gravity in another direction than believed", "g → R(α) g"),
    *(_gravity, _parameters("rad", 0.01, "alpha")),
)
PAYLOAD = MechanismEffect(
    *("payload", "inertia", "a payload that the model lacks", "π → π + m_p π_1"),
    *(_payload, _parameters("kg", 0.01, "m_p")),
)
ROLLING = MechanismEffect(
    *("rolling_resistance", "contact_law", "rolling resistance", "Q_θ = −c_rr ρ N sign(ω)"),
    *(_rolling, _parameters("1", 0.01, "c_rr")),
    needs_normal=True,
)
CANDIDATES: dict[MechanismKind, tuple[MechanismEffect, ...]] = {
    "arm": (
        MechanismEffect(
            *("viscous_joint_friction", "joint", "viscous friction of the joints", "Q_i = −b_i q̇_i"),
            *(_viscous, _parameters("N m s", 0.05, "b_1", "b_2")),
        ),
        MechanismEffect(
            *("coulomb_joint_friction", "joint", "Coulomb friction of the joints", "Q_i = −f_i sign(q̇_i)"),
            *(_coulomb, _parameters("N m", 0.05, "f_1", "f_2")),
        ),
        *(GRAVITY, PAYLOAD, ROLLING),
        MechanismEffect(
            *("torque_offset", "measurement", "an offset of the torque sensors", "Q_i = o_i"),
            *(_torque_offset, _parameters("N m", 0.05, "o_1", "o_2")),
        ),
    ),
    "wheel": (
        *(GRAVITY, PAYLOAD, ROLLING),
        MechanismEffect(
            *("viscous_rotation", "joint", "a moment against rotation, proportional to it", "Q_θ = −b ω"),
            *(_rotation, _parameters("N m s", 0.05, "b")),
        ),
    ),
}
