"""The puck of `puck` in MuJoCo: recordings that are independent of our own simulator.

The puck is a sphere of its radius that slides and turns in the plane; the cushions are planes.  The contact is
MuJoCo's, a spring and damper with the restitution and time of the cushion (`simulate.mujoco.contact`).  Friction
follows MuJoCo's elliptic cone: it is viscous near sticking, and a sliding rim pushes the puck slightly off the cushion.
Friction with the table is a force against the motion, updated every `EVERY` steps.
"""

# MuJoCo has no type stubs
# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mujoco.contact import solref
from thesis_lib.simulate.table.puck import CONTACT, CUSHIONS, FRICTION, MASS, RADIUS, SLOW, Cushions

STEP, EVERY = 2e-5, 25  # s, a fiftieth of the contact time; steps between updates of the table's force, every 0.5 ms
IMPEDANCE, IMPRATIO = 0.01, 10.0  # as for dropped bodies
# d' over d with the inverse mass that MuJoCo assumes: two thirds, since two of three axes are free
SHARE = 1.0 / (IMPEDANCE + (1.0 - IMPEDANCE) * 2.0 / 3.0)


def slide_in_mujoco(q: np.ndarray, v: np.ndarray, omega: np.ndarray, table: Cushions, times: np.ndarray) -> np.ndarray:
    """Positions (n, T, 2) in m at `times` (T,) in s of pucks from q, v (n, 2) and spin omega (n,); NaN once at rest.

    UserError for a restitution that depends on speed, which MuJoCo's contacts cannot have.
    """
    if table.rise.any():
        raise UserError(
            "MuJoCo's restitution is the same at any speed: quick_cushion is not available with --engine mujoco."
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
