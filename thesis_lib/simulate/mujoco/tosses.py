"""Tosses of a body in space in MuJoCo: a free joint over a plane, the engine's own contacts, recorded by a camera.

What can be hidden stands in `thesis_lib/simulate/rig/causes_in_space.py`.
"""

# MuJoCo's stubs do not have what its compiled modules define
# pyright: reportAttributeAccessIssue=false

from collections.abc import Mapping

import mujoco
import numpy as np
import pandas as pd

from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Solid, Sphere
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.space_header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import on_body
from thesis_lib.mechanics.inertia import in_world
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.causes_in_space import air, filmed, sizes_of, true_rig
from thesis_lib.statistics.wording import listed

SHAPES: Mapping[str, Solid] = {
    "box": Box(half_extents=(0.05, 0.04, 0.03)),
    "sphere": Sphere(radius=0.04),
    "ellipsoid": Ellipsoid(semi_axes=(0.05, 0.04, 0.03)),
    "cylinder": Cylinder(radius=0.03, half_length=0.05),
    "capsule": Capsule(radius=0.025, half_length=0.03),
}
RATE, SECONDS, NOISE = 240.0, 1.2, (2e-4, 3e-3)  # Hz, s, m and rad
STEP = 1e-4  # s
AIR_STEP = 1e-3  # s, between new forces of the air
MASS, MU = 0.25, 0.25  # kg
CONTACT = "0.002 0.25"  # solref: a central hit lasts some 2 ms and gives half of the speed back


def simulate_tosses(
    name: str,
    shape: str = "box",
    hidden: str | Mapping[str, float] = "nothing",
    size: float | None = None,
    drops: int = 60,
    seed: int = 0,
) -> Dataset:
    """Tosses of a homogeneous body, tracked at a corner of the shape's frame, z up; `hidden` is not written down.

    `hidden` is a cause of `CAUSES_IN_SPACE` with a `size`, or the sizes by effect and parameter.

    Raises:
        UserError: a shape or a hidden cause is unknown, or the shape cannot have it.
    """
    if shape not in SHAPES:
        raise UserError(f"--shape {shape}: with --space it is {listed(list(SHAPES), 'or')}.")
    rng, sizes = np.random.default_rng(seed), sizes_of(hidden, size) if isinstance(hidden, str) else hidden
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
    rig = true_rig(header, sizes)
    model = mujoco.MjModel.from_xml_string(_xml(rig))
    data, every = mujoco.MjData(model), round(1.0 / (RATE * STEP))
    frames, poses, motions = round(SECONDS * RATE), [], []
    for _ in range(drops):
        mujoco.mj_resetData(model, data)
        height = header.body.solid.extent + rng.uniform(0.1, 0.3)
        data.qpos[:3] = *rng.uniform(-0.1, 0.1, 2), height
        data.qpos[3:] = of_rotation_vector(2.0 * rng.standard_normal((3, 1)))[:, 0]
        data.qvel[:] = *rng.uniform(-0.7, 0.7, 2), rng.uniform(-1.0, 0.5), *(8.0 * rng.standard_normal(3))
        for _ in range(frames):
            poses.append(data.qpos.copy())
            motions.append(data.qvel.copy())
            _step(model, data, every, rig, sizes)
    trial, t = np.repeat(np.arange(drops), frames), np.tile(np.arange(frames) * every * STEP, drops)
    pose, motion = np.array(poses).T, np.array(motions).T
    motion[3:] = SPACE.turned(pose[3:], motion[3:])  # MuJoCo's spin is along axes of the body
    seen = filmed(on_body(State(pose, motion, trial, t, None, SPACE), *_tracked(rig)), header, sizes)
    attitude = SPACE.attitude_after(seen.attitude, NOISE[1] * rng.standard_normal((3, len(t))))
    attitude = attitude * np.where(attitude[:1] < 0.0, -1.0, 1.0)
    place = seen.position + NOISE[0] * rng.standard_normal((3, len(t)))
    table = pd.DataFrame({"trial": trial, "t": t} | dict(zip(POSE_IN_SPACE, np.concatenate([place, attitude]))))
    return Dataset(name, header, table)


def _step(model, data, every: int, rig: SpaceHeader, sizes: Mapping[str, float]) -> None:
    """A frame; what pushes a body in air changes with its motion."""
    if not any(name.startswith(("linear_drag", "quadratic_drag", "magnus")) for name in sizes):
        mujoco.mj_step(model, data, every)
        return
    steps = round(AIR_STEP / STEP)
    for done in range(0, every, steps):
        attitude, G = data.qpos[3:, None], rig.body.inertia_per_mass
        spin = SPACE.turned(attitude, data.qvel[3:, None])
        arm = SPACE.turned(attitude, rig.body.centre[:, None])
        a, alpha = air(sizes, SPACE.velocity_at(data.qvel[:3, None], spin, arm), spin)
        data.xfrc_applied[1] = MASS * np.concatenate([a, in_world(G, attitude)[..., 0] @ alpha])[:, 0]
        mujoco.mj_step(model, data, min(steps, every - done))


def _tracked(rig: SpaceHeader) -> tuple[np.ndarray, np.ndarray]:
    """Place (3,) in m and attitude (4,) of the tracked frame in that of the shape."""
    assert rig.tracked is not None
    return np.array(rig.tracked.position), rig.tracked.attitude


def _xml(rig: SpaceHeader) -> str:
    """The model, its joint at the origin of the shape's frame; a rounded box touches with balls at its corners."""
    solid, (xx, yy, zz, xy, xz, yz) = (
        rig.body.solid,
        MASS * rig.body.inertia_per_mass[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
    )
    inertia, centre, gravity, point = (
        " ".join(f"{value:.12g}" for value in numbers)
        for numbers in ((xx, yy, zz, xy, xz, yz), rig.body.centre, rig.gravity, rig.surface.point)
    )
    measures = {"box": "half_extents", "ellipsoid": "semi_axes"}.get(solid.kind)
    names = [measures] if measures else ["radius", "half_length"]
    lengths = np.ravel([getattr(solid, name) for name in names if hasattr(solid, name)])
    geoms = f'<geom type="{solid.kind}" size="{" ".join(f"{length:.12g}" for length in lengths)}"/>'
    if rho := getattr(solid, "edge_radius", 0.0):
        if not isinstance(solid, Box):
            raise UserError(f"--hidden rounded_corners: MuJoCo has no rounded {solid.kind}; toss a box.")
        corners = solid.corners - rho * np.sign(solid.corners)
        places = (" ".join(f"{value:.12g}" for value in corner) for corner in corners.T)
        geoms = "".join(f'<geom type="sphere" size="{rho:.12g}" pos="{place}"/>' for place in places)
    return f"""<mujoco>
  <compiler balanceinertia="false"/>
  <option timestep="{STEP}" gravity="{gravity}" integrator="implicitfast" cone="elliptic" impratio="10"/>
  <default><geom friction="{MU} 0.001 0.0001" solref="{CONTACT}" solimp="0.9 0.95 0.001"/></default>
  <worldbody>
    <geom type="plane" size="10 10 1" pos="{point}"/>
    <body><freejoint/>
      <inertial pos="{centre}" mass="{MASS}" fullinertia="{inertia}"/>
      {geoms}
    </body>
  </worldbody>
</mujoco>"""
