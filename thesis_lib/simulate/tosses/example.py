"""Tosses of a homogeneous body as an example: z up, tracked off the centre, with a cause that is not stated."""

from collections.abc import Mapping

from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Solid, Sphere
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.causes_in_space import sizes_of
from thesis_lib.simulate.tosses.camera import CameraInSpace, film
from thesis_lib.simulate.tosses.world import TossedWorld, TossEngine
from thesis_lib.statistics.wording import listed

CONTACT_TIME = 2e-3  # s, duration of a central hit
SHAPES: Mapping[str, Solid] = {
    "box": Box(half_extents=(0.05, 0.04, 0.03)),
    "sphere": Sphere(radius=0.04),
    "ellipsoid": Ellipsoid(semi_axes=(0.05, 0.04, 0.03)),
    "cylinder": Cylinder(radius=0.03, half_length=0.05),
    "capsule": Capsule(radius=0.025, half_length=0.03),
}
DESCRIPTION = "Simulated tosses of a body that may not be quite what is written here."


def simulate_tosses(
    name: str,
    shape: str = "box",
    hidden: str | Mapping[str, float] = "nothing",
    size: float | None = None,
    drops: int = 60,
    seed: int = 0,
    engine: TossEngine | None = None,
    contact_time: float = CONTACT_TIME,
) -> Dataset:
    """Simulate tosses of a body at 240 Hz; `hidden` is a cause with a `size`, or the sizes by effect and parameter.

    Raises:
        UserError: a shape or a hidden cause is unknown, the engine cannot simulate it, or there are no drops.
    """
    if drops < 1:
        raise UserError(f"An example needs at least one drop; got {drops}.")
    if seed < 0:
        raise UserError(f"The seed must be 0 or more; got {seed}.")
    if shape not in SHAPES:
        raise UserError(f"--shape {shape}: with --space it is {listed(list(SHAPES), 'or')}.")
    header = SpaceHeader.model_validate(
        {
            "schema": 2,
            "description": DESCRIPTION,
            "body": {"shape": SHAPES[shape], "mass": 0.25, "homogeneous": True},
            "tracked": {"position": (0.02, 0.01, 0.03), "quaternion": (0.8, 0.6, 0.0, 0.0)},
            "rate": 240.0,
            "noise": {"position": 2e-4, "rotation": 3e-3},
        }
    )
    if engine is None:
        from thesis_lib.simulate.tosses.own import OwnTosses  # imported late: numba compiles it

        engine = OwnTosses()
    hidden = sizes_of(hidden, size) if isinstance(hidden, str) else hidden
    world = TossedWorld(header, contact_time=contact_time, hidden=hidden)
    return film(name, world, engine, CameraInSpace(seconds=1.2), drops, generator(seed, "tosses", shape))
