"""Hidden forces that act on a mechanism but are missing from its believed model (our addition to thesis chapter 2).

Each is a generalised force Q(q, v) on the right-hand side of M v̇ + C v = g + f_ext + Q + J'c:

    viscous joint friction    Q_i = -b_i q̇_i
    Coulomb joint friction    Q_i = -f_i tanh(q̇_i / q̇_s)
    gravity direction         Q = Σ_b m_b J_b' g ((sin α, -cos α) - (0, -1))      J_b: of the centre of mass of body b
    rolling resistance        Q_θ = -c_rr ρ N tanh(ω / ω_s)        ρ: radius of the disk, or length of a spoke
    cogging                   Q_1 = A sin(n q_1)                   not a candidate: the critique must report a misfit
    payload                   a point mass m_p at the tip of link 2, or on a spoke of the wheel, r from the hub

tanh over q̇_s and ω_s smooths the sign of a speed, because an explicit step cannot hold a body at rest with a sign
function.  N is the normal force of the same step, found by `N_SOLVES` fixed-point iterations: the step is solved, and
its N gives the moment in the next solve.  c_rr is small; each solve therefore gains about two digits.  A payload is not
a force but changes the mechanism: to a heavier link, or to a wheel whose centre of mass is off the hub.

Starts and torques are drawn for the believed mechanism and applied to the true mechanism, as on a real rig whose
experiments were planned with the believed model.

Sources: H. Olsson et al., Eur. J. Control 4 (1998), doi 10.1016/S0947-3580(98)70113-X (friction); K. L. Johnson,
Contact Mechanics, 1985, doi 10.1017/CBO9781139171731, section 9 (rolling resistance).
"""

from typing import Literal

import numpy as np
from pydantic import Field

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.mechanisms import motions as chapter2
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.simulate.stepping.arm_disk import ArmDisk
from thesis_lib.simulate.stepping.multibody import Mechanism
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel
from thesis_lib.simulate.stepping.stepping import Force, SimulatedMotion, StateTerms, simulate, step_lcp

MechanismKind = Literal["arm", "wheel"]
TRUTHS: dict[MechanismKind, tuple[str, ...]] = {
    "arm": (
        *("nothing", "viscous_joint_friction", "coulomb_joint_friction", "gravity_direction"),
        *("payload", "rolling_resistance", "cogging"),
    ),
    "wheel": ("nothing", "gravity_direction", "payload", "rolling_resistance"),
}
N_SOLVES = 2  # solutions of a step, after which its normal force and moment agree


class HiddenSizes(Section):
    """Sizes of the hidden causes: a few per cent of the acting torques and weights; all are our own choices."""

    viscous: tuple[float, float] = Field((0.1, 0.06), description="N m s, b; at 2 rad/s a twentieth of the torques")
    coulomb: tuple[float, float] = Field((0.15, 0.1), description="N m, f; a few per cent, as in a geared motor")
    coulomb_speed: float = Field(
        0.02, gt=0, description="rad/s, q̇_s; a hundredth of the speeds; h f/(M q̇_s) < 1 keeps time steps stable"
    )
    tilt: float = Field(0.02, description="rad, α; as for a rig levelled by eye")
    rolling: float = Field(0.02, ge=0, description="1, c_rr; rubber on a hard floor has 0.01 to 0.04")
    rolling_speed: float = Field(0.03, gt=0, description="rad/s, ω_s; as for Coulomb friction")
    payload: float = Field(0.05, ge=0, description="kg, m_p on the arm; a twentieth of a link")
    wheel_payload: float = Field(0.05, ge=0, description="kg, m_p on the wheel; a twentieth of its mass")
    payload_radius: float = Field(0.5, ge=0, description="m, r on spoke 0 of the wheel; half a spoke")
    cogging: float = Field(0.3, ge=0, description="N m, A; of the order of the other forces")
    cogging_periods: int = Field(12, ge=1, description="n per turn; a motor with 12 slots")
    wheel_omega: tuple[float, float] = Field(
        (1.0, 2.5), description="rad/s, |ω| of the wheel's starts; enough to pass the next spoke downhill"
    )
    wheel_steps: int = Field(300, ge=1, description="1.5 s, two or more spokes")


class LoadedWheel(RimlessWheel):
    """Rimless wheel with a point mass fixed at `offset` (2,) m from the hub, in the wheel's axes; q is of the hub."""

    constant = False

    def __init__(self, wheel: RimlessWheel, payload: float, offset: np.ndarray) -> None:
        super().__init__(wheel.spokes, wheel.length, wheel.mass, wheel.inertia, wheel.slope, wheel.g)
        self.payload, self.offset = float(payload), np.asarray(offset, dtype=float)

    def _arm(self, q: np.ndarray) -> np.ndarray:
        cos, sin = np.cos(q[2]), np.sin(q[2])
        x, y = self.offset
        return self.payload * np.array([cos * x - sin * y, sin * x + cos * y])

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        M = np.array(super().mass_matrix(q))
        px, py = self._arm(q)
        M[0, 0] += self.payload
        M[1, 1] += self.payload
        M[2, 2] += self.payload * self.offset @ self.offset
        M[0, 2] = M[2, 0] = -py
        M[1, 2] = M[2, 1] = px
        return M

    def bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array([*(-(v[2] ** 2) * self._arm(q)), 0.0])

    def gravity(self, q: np.ndarray) -> np.ndarray:
        px, py = self._arm(q)
        gx, gy = self.g * np.sin(self.slope), -self.g * np.cos(self.slope)
        return super().gravity(q) + np.array([self.payload * gx, self.payload * gy, px * gy - py * gx])


def coulomb_joint_friction(f: tuple[float, float], speed: float) -> Force:
    """Q (5,) of the arm and disk with Coulomb friction f in N m, smoothed over `speed` in rad/s."""

    def force(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array([-f[0] * np.tanh(v[0] / speed), -f[1] * np.tanh(v[1] / speed), 0.0, 0.0, 0.0])

    return force


def cogging(amplitude: float, periods: int) -> Force:
    """Q (5,) of the arm and disk with a cogging torque of `amplitude` in N m, `periods` times per turn of joint 1."""
    return lambda t, q, v: np.array([amplitude * np.sin(periods * q[0]), 0.0, 0.0, 0.0, 0.0])


def gravity_direction(mechanism: ArmDisk | RimlessWheel, alpha: float) -> Force:
    """Q (nv,) due to gravity that is rotated by alpha in rad from its believed direction."""
    if isinstance(mechanism, RimlessWheel):
        turned = mechanism.slope + alpha
        change = mechanism.g * np.array(
            [np.sin(turned) - np.sin(mechanism.slope), np.cos(mechanism.slope) - np.cos(turned)]
        )
        constant = np.array([*(mechanism.mass * change), 0.0])
        return lambda t, q, v: constant
    dx, dy = mechanism.g * np.sin(alpha), mechanism.g * (1.0 - np.cos(alpha))
    (m1, m2), coms, l1 = mechanism.link_masses, mechanism.link_coms, mechanism.link_lengths[0]

    def lever(angle: float, point: np.ndarray) -> float:
        # ∂(R(angle) point)/∂angle, times the change of gravity
        cos, sin = np.cos(angle), np.sin(angle)
        return (-sin * point[0] - cos * point[1]) * dx + (cos * point[0] - sin * point[1]) * dy

    def force(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        first, second = q[0], q[0] + q[1]
        outer = m2 * lever(second, coms[1])
        inner = m1 * lever(first, coms[0]) + m2 * lever(first, np.array([l1, 0.0]))
        return np.array([inner + outer, outer, mechanism.disk_mass * dx, mechanism.disk_mass * dy, 0.0])

    return force


def loaded_arm(settings: Chapter2Bodies, payload: float) -> Chapter2Bodies:
    """Settings whose second link has a point mass of `payload` kg at its tip."""
    a = settings.arm
    m, c, length = a.link_masses[1], a.link_coms[1], a.link_lengths[1]
    mass = m + payload
    com = (m * c + payload * length) / mass
    inertia = a.link_inertias[1] + m * (c - com) ** 2 + payload * (length - com) ** 2
    arm = a.model_copy(
        update={
            "link_masses": (a.link_masses[0], mass),
            "link_coms": (a.link_coms[0], com),
            "link_inertias": (a.link_inertias[0], inertia),
        }
    )
    return settings.model_copy(update={"arm": arm})


def planned(
    kind: MechanismKind, n: int, rng: np.random.Generator, settings: Chapter2Bodies, sizes: HiddenSizes
) -> tuple[SimulatedMotion, ...]:
    """Simulate n trials of the believed mechanism; `run_with` applies their starts and torques to the true mechanism.

    The wheel starts on a spoke, alternately downhill and uphill: a resistance then changes its sign, a slope does not.
    """
    if kind == "arm":
        return chapter2.arm_trajectories(n, rng, settings).records
    wheel, w = chapter2.wheel(settings), settings.wheel
    low, high = sizes.wheel_omega
    records = []
    for i in range(n):
        omega = (-1.0) ** (i + 1) * (low + (high - low) * rng.random())
        lean = np.pi / wheel.spokes * rng.uniform(-0.9, 0.9)
        q, v = wheel.standing(lean, omega)
        records.append(simulate(wheel, q, v, None, settings.h, sizes.wheel_steps, w.mu, w.epsilon))
    return tuple(records)


def run_with(
    kind: MechanismKind, truth: str, plans: tuple[SimulatedMotion, ...], settings: Chapter2Bodies, sizes: HiddenSizes
) -> tuple[SimulatedMotion, ...]:
    """Simulate the planned trials on a mechanism with a hidden cause of `TRUTHS[kind]`; leave out unsolvable trials.

    Raises:
        UserError: this hidden cause does not exist for the mechanism.
    """
    if truth not in TRUTHS[kind]:
        raise UserError(f"The {kind} hides one of {', '.join(TRUTHS[kind])}; got {truth!r}.")
    if truth == "nothing":
        return plans
    mechanism: Mechanism
    if kind == "arm":
        mu, epsilon = settings.arm.mu, settings.arm.epsilon
        loaded = loaded_arm(settings, sizes.payload) if truth == "payload" else settings
        mechanism = chapter2.arm_disk(loaded)
        radius, ground = mechanism.disk_radius, [1]
    else:
        mu, epsilon = settings.wheel.mu, settings.wheel.epsilon
        mechanism = chapter2.wheel(settings)
        if truth == "payload":
            mechanism = LoadedWheel(mechanism, sizes.wheel_payload, np.array([sizes.payload_radius, 0.0]))
        radius, ground = mechanism.length, list(range(mechanism.spokes))

    def viscous(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array([-sizes.viscous[0] * v[0], -sizes.viscous[1] * v[1], 0.0, 0.0, 0.0])

    def rolling(plan: SimulatedMotion) -> Force:
        """Q (nv,) on the last coordinate, with the normal force N of the ground in the same step."""

        def force(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            k = min(round(t / plan.h), plan.steps - 1)
            Q, terms = np.zeros(mechanism.nv), StateTerms.of(mechanism, q, v)
            for _ in range(N_SOLVES):
                step = step_lcp(mechanism, q, v, plan.f_ext[k] + Q, plan.h, mu, epsilon, terms)[2]
                normal = step.c_n[ground].sum() / plan.h
                Q[-1] = -sizes.rolling * radius * normal * np.tanh(v[-1] / sizes.rolling_speed)
            return Q

        return force

    hidden = {
        "viscous_joint_friction": lambda plan: viscous,
        "coulomb_joint_friction": lambda plan: coulomb_joint_friction(sizes.coulomb, sizes.coulomb_speed),
        "cogging": lambda plan: cogging(sizes.cogging, sizes.cogging_periods),
        "gravity_direction": lambda plan: gravity_direction(mechanism, sizes.tilt),
        "rolling_resistance": rolling,
        "payload": lambda plan: None,
    }[truth]
    records = [
        simulate(mechanism, plan.q[0], plan.v[0], plan.f_ext, plan.h, plan.steps, mu, epsilon, hidden=hidden(plan))
        for plan in plans
    ]
    return tuple(record for record in records if record.solved)
