"""Arm and wheel in MuJoCo, with MuJoCo's own soft contact.

The contact is a spring and a damper in units of acceleration (`solref` with negative numbers), with an elliptic
friction cone and friction that creeps.  Every cause except cogging is a property of MuJoCo's model:

| cause                    | in the model                                                      |
|--------------------------|-------------------------------------------------------------------|
| viscous_joint_friction   | `damping` of the hinges                                           |
| coulomb_joint_friction   | `frictionloss` of the hinges, a constraint                        |
| gravity_direction        | the gravity vector                                                |
| payload                  | an additional body with mass and no size                          |
| rolling_resistance       | rolling friction of the contact with the ground, c_rr ρ in m      |
| cogging                  | `qfrc_applied`, updated every `CONTROL` seconds                   |

Source: E. Todorov, T. Erez, Y. Tassa, MuJoCo, IROS 2012, doi 10.1109/IROS.2012.6386109;
https://mujoco.readthedocs.io (contact parameters).
"""

# mujoco has no stubs
# pyright: reportAttributeAccessIssue=false

from collections.abc import Sequence

import mujoco
import numpy as np

from thesis_lib.simulate.engines.settings import CONTROL, DAMPING_RATIO, LINK_DEPTH, STEP, TIP_RADIUS, EngineMotion
from thesis_lib.simulate.mechanisms import motions as chapter2
from thesis_lib.simulate.mechanisms.hidden_forces import HiddenSizes, MechanismKind
from thesis_lib.simulate.mechanisms.motions import DEFAULT
from thesis_lib.simulate.stepping.stepping import SimulatedMotion

IMPEDANCE = 0.95  # impedance d of MuJoCo's contact: share of the constraint that is enforced, the same at any depth

# s, time constant of dry friction in a hinge; with MuJoCo's default of 20 ms it resists acceleration near a reversal
STIFF_FRICTION = 1e-3


def mujoco_motions(
    kind: MechanismKind, truth: str, plans: Sequence[SimulatedMotion], sizes: HiddenSizes, stiffness: float
) -> list[EngineMotion]:
    """Simulate the planned trials (start and torques) of a mechanism with the hidden cause `truth` in MuJoCo."""
    make = arm_xml if kind == "arm" else wheel_xml
    model = mujoco.MjModel.from_xml_string(make(truth, sizes, stiffness))
    cogging = (sizes.cogging, sizes.cogging_periods) if truth == "cogging" else (0.0, 1)
    return [_run(model, plan, *cogging) for plan in plans]


def _run(model: object, plan: SimulatedMotion, amplitude: float, periods: int) -> EngineMotion:
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = plan.q[0], plan.v[0]
    per_control, per_step = round(CONTROL / STEP), round(plan.h / CONTROL)
    q, v = [np.array(data.qpos)], [np.array(data.qvel)]
    for f in plan.f_ext:
        for _ in range(per_step):
            data.qfrc_applied[:] = f
            if amplitude:
                data.qfrc_applied[0] += amplitude * np.sin(periods * data.qpos[0])
            mujoco.mj_step(model, data, per_control)
            q.append(np.array(data.qpos))
            v.append(np.array(data.qvel))
    return EngineMotion.controlled(q, v)


def _head(gravity: Sequence[float]) -> str:
    return (
        f'<option timestep="{STEP}" integrator="implicitfast" cone="elliptic" impratio="10" '
        f'gravity="{gravity[0]} {gravity[1]} 0" solver="Newton" tolerance="1e-10"/>'
        '<compiler angle="radian" autolimits="true" boundmass="0" boundinertia="0"/>'
    )


def _pair(a: str, b: str, mu: float, rolling: float, stiffness: float) -> str:
    damping = 2.0 * DAMPING_RATIO * np.sqrt(stiffness)
    return (
        f'<pair geom1="{a}" geom2="{b}" condim="{6 if rolling else 3}" friction="{mu} {mu} 1e-9 {rolling} {rolling}" '
        f'solref="{-stiffness} {-damping}" solimp="{IMPEDANCE} {IMPEDANCE} 1e-3"/>'
    )


def _inertial(mass: float, com: float, inertia: float) -> str:
    # only the moment about z matters in the plane
    return f'<inertial pos="{com} 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'


def _load(truth: str, mass: float, radius: float) -> str:
    if truth != "payload" or not mass:
        return ""
    return f'<body pos="{radius} 0 0"><inertial pos="0 0 0" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/></body>'


def _gravity(truth: str, slope: float, sizes: HiddenSizes) -> tuple[float, float]:
    angle, g = slope + (sizes.tilt if truth == "gravity_direction" else 0.0), DEFAULT.gravity
    return g * float(np.sin(angle)), -g * float(np.cos(angle))


def arm_xml(truth: str, sizes: HiddenSizes, stiffness: float) -> str:
    """MuJoCo model (XML) of the arm, its disk and the ground y = 0."""
    a = DEFAULT.arm
    (l1, l2), R = a.link_lengths, a.disk_radius
    viscous = sizes.viscous if truth == "viscous_joint_friction" else (0.0, 0.0)
    coulomb = sizes.coulomb if truth == "coulomb_joint_friction" else (0.0, 0.0)
    hinges = [
        f'<joint type="hinge" axis="0 0 1" damping="{b}" frictionloss="{f}" solreffriction="{STIFF_FRICTION} 1"/>'
        for b, f in zip(viscous, coulomb)
    ]
    inertias = [_inertial(m, c, i) for m, c, i in zip(a.link_masses, a.link_coms, a.link_inertias)]
    rolling = sizes.rolling * R if truth == "rolling_resistance" else 0.0
    depth = 0.5 * LINK_DEPTH
    return f"""<mujoco>{_head(_gravity(truth, 0.0, sizes))}
    <worldbody>
      <geom name="ground" type="plane" size="50 50 1" zaxis="0 1 0" contype="0" conaffinity="0"/>
      <body pos="{a.base[0]} {a.base[1]} 0">{hinges[0]}{inertias[0]}
        <body pos="{l1} 0 0">{hinges[1]}{inertias[1]}
          <geom name="link" type="box" size="{0.5 * l2} {depth} 0.1" pos="{0.5 * l2} {depth} 0" contype="0"
            conaffinity="0"/>{_load(truth, sizes.payload, l2)}
        </body>
      </body>
      <body>
        <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>
        {_inertial(a.disk_mass, 0.0, a.disk_inertia)}
        <geom name="disk" type="sphere" size="{R}" contype="0" conaffinity="0"/>
      </body>
    </worldbody>
    <contact>{_pair("link", "disk", a.mu, 0.0, stiffness)}{_pair("ground", "disk", a.mu, rolling, stiffness)}</contact>
    </mujoco>"""


def wheel_xml(truth: str, sizes: HiddenSizes, stiffness: float) -> str:
    """MuJoCo model (XML) of the rimless wheel, in the axes of its slope."""
    w, made = DEFAULT.wheel, chapter2.wheel()
    rolling = sizes.rolling * w.length if truth == "rolling_resistance" else 0.0
    tips = made.contact_points(np.zeros(1))[0] * (1.0 - TIP_RADIUS / w.length)
    geoms = "".join(
        f'<geom name="tip_{i}" type="sphere" size="{TIP_RADIUS}" pos="{x} {y} 0" contype="0" conaffinity="0"/>'
        for i, (x, y) in enumerate(tips)
    )
    pairs = "".join(_pair("ground", f"tip_{i}", w.mu, rolling, stiffness) for i in range(w.spokes))
    return f"""<mujoco>{_head(_gravity(truth, w.slope, sizes))}
    <worldbody>
      <geom name="ground" type="plane" size="50 50 1" zaxis="0 1 0" contype="0" conaffinity="0"/>
      <body>
        <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>
        {_inertial(w.mass, 0.0, w.inertia)}{geoms}{_load(truth, sizes.wheel_payload, sizes.payload_radius)}
      </body>
    </worldbody>
    <contact>{pairs}</contact>
    </mujoco>"""
