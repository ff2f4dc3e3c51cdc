"""Causes without an effect of the library (`causes.OUTSIDE`) in MuJoCo: parts added to the model, and pushes.

| cause         | in code                     | unit     |                                                           |
|---------------|-----------------------------|----------|-----------------------------------------------------------|
| loose_mass    | share, frequency, damping   | 1, Hz, 1 | a share of the mass hangs on three springs at the centre  |
| two_materials | edge, friction, restitution | m, 1, 1  | beyond t_1 = edge, both change by these factors           |
| hand          | push, share                 | m/s², 1  | a push in flight, during `HAND`, in a share of the tosses |
| second_object | x, y, radius                | m        | a ball that is fixed, half sunk in the table              |
| light_table   | mass, frequency, damping    | 1, Hz, 1 | the table (mass in body masses) yields on a spring        |
"""

import numpy as np

from thesis_lib.simulate.tosses.world import TossedWorld

HAND = (0.03, 0.06)  # s, start and end of the push after the release
_AXES = ("1 0 0", "0 1 0", "0 0 1")
_SMALL = 1e-9  # kg m², inertia of parts that do not rotate


def in_body(world: TossedWorld) -> str:
    """The loose mass in the body, as XML; empty if there is none."""
    mass = world.of("loose_mass.share") * world.mass
    if not mass:
        return ""
    place = " ".join(f"{part:.12g}" for part in world.rig.body.centre)
    joints = "".join(_spring(axis, mass, world, "loose_mass") for axis in _AXES)
    return f'<body pos="{place}">{joints}{_inertial(mass)}</body>'


def table(world: TossedWorld) -> str:
    """The table and the second object, as XML."""
    height = f"{world.height:.12g}"
    if mass := world.of("light_table.mass") * world.mass:
        # a plane cannot move in MuJoCo
        top = f'<geom type="box" size="3 3 0.5" pos="0 0 {world.height - 0.5:.12g}"/>'
        moves = _spring(_AXES[2], mass, world, "light_table")
        made = f'<body gravcomp="1">{moves}{_inertial(mass)}{top}</body>'
    else:
        made = f'<geom type="plane" size="10 10 1" pos="0 0 {height}"/>'
    if radius := world.of("second_object.radius"):
        x, y = world.vector("second_object.", "xy")
        made += f'<geom type="sphere" size="{radius:.12g}" pos="{x:.12g} {y:.12g} {height}"/>'
    return made


def material(world: TossedWorld, place: np.ndarray) -> tuple[float, float]:
    """Restitution and friction at a place (2,) in m, relative to the first material."""
    if not world.has(("two_materials",)) or place[0] < world.of("two_materials.edge"):
        return 1.0, 1.0
    return world.of("two_materials.restitution"), world.of("two_materials.friction")


def pushes(world: TossedWorld, tosses: int) -> np.ndarray:
    """Forces (3, n) in N with which a hand pushes the bodies; equal numbers of tosses give equal forces."""
    rng = np.random.default_rng(tosses)
    along = rng.standard_normal((3, tosses))
    touched = rng.random(tosses) < world.of("hand.share")
    return world.mass * world.of("hand.push") * touched * along / np.linalg.norm(along, axis=0)


def _spring(axis: str, mass: float, world: TossedWorld, cause: str) -> str:
    omega = 2.0 * np.pi * world.of(f"{cause}.frequency")
    damping = 2.0 * world.of(f"{cause}.damping") * omega * mass
    return f'<joint type="slide" axis="{axis}" stiffness="{omega**2 * mass:.12g}" damping="{damping:.12g}"/>'


def _inertial(mass: float) -> str:
    return f'<inertial pos="0 0 0" mass="{mass:.12g}" diaginertia="{_SMALL} {_SMALL} {_SMALL}"/>'
