"""Tosses of a body in space in MuJoCo: a free joint over a plane, the engine's own contacts, recorded by a camera.

What is hidden in the true body or in its surroundings has the name and the meaning of an effect: true minus believed.
"""

# MuJoCo's stubs do not have what its compiled modules define
# pyright: reportAttributeAccessIssue=false

from collections.abc import Mapping

import mujoco
import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Solid, Sphere
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import tracked_of_body
from thesis_lib.datasets.format.space_header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.wording import listed

SHAPES: Mapping[str, Solid] = {
    "box": Box(half_extents=(0.05, 0.04, 0.03)),
    "sphere": Sphere(radius=0.04),
    "ellipsoid": Ellipsoid(semi_axes=(0.05, 0.04, 0.03)),
    "cylinder": Cylinder(radius=0.03, half_length=0.05),
    "capsule": Capsule(radius=0.025, half_length=0.03),
}
# what can be hidden -> its default size, unit and meaning
HIDDEN = {
    "nothing": (0.0, "", "the body is as believed"),
    "com_offset": (2e-3, "m", "of the centre of mass along the body's x axis"),
    "wrong_inertia": (0.2, "1", "d_I: the whole inertia times 1 + d_I"),
    "wrong_gravity": (-0.3, "m/s²", "along believed gravity"),
    "wrong_size": (0.03, "1", "s: all lengths of the shape times 1 + s"),
}
RATE, SECONDS, NOISE = 240.0, 1.2, (2e-4, 3e-3)  # Hz, s, m and rad
STEP = 1e-4  # s
MASS, MU = 0.25, 0.25  # kg
CONTACT = "0.002 0.25"  # solref: a central hit lasts some 2 ms and gives half of the speed back


def simulate_tosses(
    name: str, shape: str = "box", hidden: str = "nothing", size: float | None = None, drops: int = 60, seed: int = 0
) -> Dataset:
    """Tosses of a homogeneous body, tracked at a corner of the shape's frame, z up; `hidden` is not written down.

    Raises:
        UserError: a shape or a hidden cause is unknown.
    """
    for what, known, option in ((shape, SHAPES, "--shape"), (hidden, HIDDEN, "--hidden")):
        if what not in known:
            raise UserError(f"{option} {what}: with --space it is {listed(list(known), 'or')}.")
    rng, amount = np.random.default_rng(seed), HIDDEN[hidden][0] if size is None else size
    header = SpaceHeader.model_validate(
        {
            "schema": 2,
            "description": "Simulated tosses in MuJoCo, of a body that may not be quite what is written here.",
            "body": {"shape": SHAPES[shape], "mass": MASS, "homogeneous": True},
            "tracked": {"position": (0.02, 0.01, 0.03), "quaternion": (0.8, 0.6, 0.0, 0.0)},
            "rate": RATE,
            "noise": {"position": NOISE[0], "rotation": NOISE[1]},
        }
    )
    model = mujoco.MjModel.from_xml_string(_xml(header, {hidden: amount}))
    data, every = mujoco.MjData(model), round(1.0 / (RATE * STEP))
    frames, poses = round(SECONDS * RATE), []
    for _ in range(drops):
        mujoco.mj_resetData(model, data)
        height = header.body.solid.extent + rng.uniform(0.1, 0.3)
        data.qpos[:3] = *rng.uniform(-0.1, 0.1, 2), height
        data.qpos[3:] = of_rotation_vector(2.0 * rng.standard_normal((3, 1)))[:, 0]
        data.qvel[:] = *rng.uniform(-0.7, 0.7, 2), rng.uniform(-1.0, 0.5), *(8.0 * rng.standard_normal(3))
        for _ in range(frames):
            poses.append(data.qpos.copy())
            mujoco.mj_step(model, data, every)
    trial, t = np.repeat(np.arange(drops), frames), np.tile(np.arange(frames) * every * STEP, drops)
    true = State(np.array(poses).T, np.zeros((6, len(t))), trial, t, None, SPACE)  # of the shape's frame
    seen = tracked_of_body(true, header)
    attitude = SPACE.attitude_after(seen.attitude, NOISE[1] * rng.standard_normal((3, len(t))))
    attitude = attitude * np.where(attitude[:1] < 0.0, -1.0, 1.0)
    place = seen.position + NOISE[0] * rng.standard_normal((3, len(t)))
    table = pd.DataFrame({"trial": trial, "t": t} | dict(zip(POSE_IN_SPACE, np.concatenate([place, attitude]))))
    return Dataset(name, header, table)


def _xml(header: SpaceHeader, hidden: Mapping[str, float]) -> str:
    """The model, its joint at the origin of the shape's frame."""
    solid, moments = header.body.solid, MASS * np.diag(header.body.inertia_per_mass)
    inertia = " ".join(f"{value:.12g}" for value in moments * (1.0 + hidden.get("wrong_inertia", 0.0)))
    measures = {"box": "half_extents", "ellipsoid": "semi_axes"}.get(solid.kind)
    names = [measures] if measures else ["radius", "half_length"]
    lengths = np.ravel([getattr(solid, name) for name in names if hasattr(solid, name)])
    size = " ".join(f"{length * (1.0 + hidden.get('wrong_size', 0.0)):.12g}" for length in lengths)
    gravity = header.gravity[2] - hidden.get("wrong_gravity", 0.0)
    return f"""<mujoco>
  <option timestep="{STEP}" gravity="0 0 {gravity:.12g}" integrator="implicitfast" cone="elliptic" impratio="10"/>
  <default><geom friction="{MU} 0.001 0.0001" solref="{CONTACT}" solimp="0.9 0.95 0.001"/></default>
  <worldbody>
    <geom type="plane" size="10 10 1"/>
    <body><freejoint/>
      <inertial pos="{hidden.get("com_offset", 0.0):.12g} 0 0" mass="{MASS}" diaginertia="{inertia}"/>
      <geom type="{solid.kind}" size="{size}"/>
    </body>
  </worldbody>
</mujoco>"""
