"""The puck of `puck` in MuJoCo: recordings that share no line with ours.

Body and cushions are a sphere of the puck's radius, which slides and turns in the plane, and planes.  A contact is
MuJoCo's, a spring and damper with the restitution and time of its cushion (`simulate.mujoco.contact`).  Friction is
that of its elliptic cone: viscous near sticking, and where the rim slides it pushes the puck off the cushion a little.
Friction with the table is a force against the motion, set anew every `EVERY` steps.
"""

# MuJoCo has no types
# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mujoco.contact import solref
from thesis_lib.simulate.table.puck import CONTACT, CUSHIONS, FRICTION, MASS, RADIUS, SLOW, Cushions

STEP, EVERY = 2e-5, 25  # s; a fiftieth of the contact, and force of the table every half millisecond
IMPEDANCE, IMPRATIO = 0.01, 10.0  # as of dropped bodies
# of the inverse mass that MuJoCo assumes: two of the three axes along which a free body could move
SHARE = 1.0 / (IMPEDANCE + (1.0 - IMPEDANCE) * 2.0 / 3.0)


def slide_in_mujoco(q: np.ndarray, v: np.ndarray, omega: np.ndarray, table: Cushions, times: np.ndarray) -> np.ndarray:
    """Positions (n, T, 2) in m at `times` (T,) in s of pucks from q, v (n, 2) and spin omega (n,); NaN once at rest.

    UserError for a restitution that depends on speed, which no contact of MuJoCo's has.
    """
    if table.rise.any():
        raise UserError(
            "MuJoCo gives back the same share at any speed: there is no quick_cushion with --engine mujoco."
        )
    model = mujoco.MjModel.from_xml_string(_xml(table))
    path = np.full((len(q), len(times), 2), np.nan)
    for i in range(len(q)):
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = [*q[i], 0.0], [*v[i], omega[i]]
        for k, time in enumerate(times):
            while (left := round((time - data.time) / STEP)) > 0:
                speed = float(np.hypot(*data.qvel[:2]))
                if speed <= SLOW:
                    break
                data.qfrc_applied[:2] = -MASS * FRICTION * data.qvel[:2] / speed
                mujoco.mj_step(model, data, min(left, EVERY))
            if left > 0:
                break
            path[i, k] = data.qpos[:2]
    return path


def _xml(table: Cushions) -> str:
    planes = ""
    for wall, out, mu, (stiffness, damping) in zip(
        CUSHIONS, table.out, table.mu, solref(table.epsilon, np.full(len(CUSHIONS), CONTACT), SHARE)
    ):
        x, y = wall.point - out * wall.n
        planes += (
            f'<geom type="plane" size="5 5 1" pos="{x} {y} 0" zaxis="{wall.n[0]} {wall.n[1]} 0" priority="1" '
            f'condim="3" friction="{mu} 0 0" solref="{stiffness} {damping}" '
            f'solimp="{IMPEDANCE} {IMPEDANCE} 0.001 0.5 2"/>'
        )
    inertia = 0.5 * MASS * RADIUS**2
    return (
        f'<mujoco><option timestep="{STEP}" cone="elliptic" impratio="{IMPRATIO}" gravity="0 0 0"/>'
        f'<worldbody>{planes}<body><inertial pos="0 0 0" mass="{MASS}" diaginertia="{inertia} {inertia} {inertia}"/>'
        f'<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
        f'<geom type="sphere" size="{RADIUS}"/></body></worldbody></mujoco>'
    )
