"""MuJoCo as a contact model for bodies in space; all bodies are in one `mujoco.batch.Batch`.

Each contact point is a ball on a plane; all points act at the same time, as the corners of MuJoCo's own hulls do.
Each body has its own coefficients, points, and forces besides contact.  See `thesis_lib/engines/in_space.py`.
"""

# MuJoCo's type stubs lack the names that its compiled modules define
# pyright: reportAttributeAccessIssue=false

from dataclasses import dataclass
from typing import Literal

import numpy as np

from thesis_lib.engines.in_space import TouchPoints
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE
from thesis_lib.simulate.mujoco.contact import GROWS, solref

STEPS = 30  # in the shortest contact time of the bodies
AT_ONCE = 32  # steps between two checks of which bodies have left


@dataclass(frozen=True)
class MujocoSurface:
    """MuJoCo's friction cone, impratio, and impedance at the touch and in depth (`simulate/mujoco/contact.py`)."""

    cone: Literal["elliptic", "pyramidal"] = "elliptic"
    impratio: float = 10.0
    impedance: tuple[float, float] = (0.9, 0.9)


AT_DEFAULT = MujocoSurface("pyramidal", 1.0, (0.9, 0.95))


class MujocoInSpace:
    """n bodies on MuJoCo's plane."""

    name = "MuJoCo"

    def __init__(
        self,
        points: TouchPoints,
        inertia: np.ndarray,
        push: np.ndarray,
        coefficients: np.ndarray,
        surface: MujocoSurface = MujocoSurface(),
    ) -> None:
        """Arrays as in the table of `in_space`; UserError if MuJoCo is not installed."""
        try:
            import mujoco
            from mujoco.batch import Batch
        except ImportError as error:
            raise UserError(f"MuJoCo cannot be used here ({error}): pip install mujoco-core.") from error
        mu, epsilon, lasting = coefficients
        self.points, self.h = points, float(lasting.min()) / STEPS
        self.batch = Batch(mujoco.MjModel.from_xml_string(_xml(points, inertia, surface, self.h)), len(mu), 1)
        self.batch.expand("geom_pos")[:, 1:] = points.centres.transpose(2, 1, 0)
        self.batch.expand("pair_friction")[:, :, :2] = mu[:, None, None]
        self.batch.expand("pair_solref")[:] = solref(epsilon, lasting, 1.0)[:, None]
        self.batch.bind("xfrc_applied")[:, 1] = push.T

    def path(self, rows: np.ndarray, pose: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses (7, m, steps) and motions (6, m, steps) after each of `AT_ONCE` steps."""
        spin = SPACE.turned_back(pose[3:], motion[3:])  # MuJoCo's spin is in the axes of the body
        self.batch.bind("qpos")[rows], self.batch.bind("qvel")[rows] = pose.T, np.concatenate([motion[:3], spin]).T
        made = self.batch.rollout(AT_ONCE, record=("qpos", "qvel"), ids=rows)
        q, v = (np.moveaxis(made[name], -1, 0) for name in ("qpos", "qvel"))
        spin = SPACE.turned(q[3:].reshape(4, -1), v[3:].reshape(3, -1)).reshape(v[3:].shape)
        return q, np.concatenate([v[:3], spin])


def _xml(points: TouchPoints, inertia: np.ndarray, surface: MujocoSurface, step: float) -> str:
    """Return the MJCF of a 1 kg body with its joint at the centre of mass; geom positions are set later, per body."""
    moments = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    kind, size = "sphere", _text([points.radius])
    if points.squares.any():
        kind, size = "ellipsoid", _text(np.sqrt(points.squares) + points.radius)
    numbers = range(points.centres.shape[1])
    where = 'pos="1 1 1" contype="0" conaffinity="0"'  # not 0: MuJoCo would then ignore the position of a geom
    geoms = "".join(f'<geom name="p{i}" type="{kind}" size="{size}" {where}/>' for i in numbers)
    solimp = f'condim="3" solimp="{_text([*surface.impedance, *GROWS])}"'
    pairs = "".join(f'<pair geom1="plane" geom2="p{i}" {solimp}/>' for i in numbers)
    return f"""<mujoco>
  <compiler balanceinertia="false"/>
  <option timestep="{step:.17g}" gravity="0 0 0" integrator="RK4" cone="{surface.cone}"
    impratio="{surface.impratio:.17g}" tolerance="1e-12" iterations="100" ccd_tolerance="1e-10" ccd_iterations="200"/>
  <worldbody>
    <geom name="plane" type="plane" size="1 1 1" contype="0" conaffinity="0"/>
    <body><freejoint/><inertial pos="0 0 0" mass="1" fullinertia="{_text(moments)}"/>{geoms}</body>
  </worldbody>
  <contact>{pairs}</contact>
</mujoco>"""


def _text(values) -> str:
    return " ".join(f"{value:.17g}" for value in values)
