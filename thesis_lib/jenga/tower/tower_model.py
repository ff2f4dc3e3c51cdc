"""MuJoCo model of the tower, whose blocks rest on small spheres, with a point pusher and a gripper.

MuJoCo's box-box contact flips between one and four points when faces are not quite parallel, so a tower of boxes never
comes to rest.  Here a block's box touches only spheres: 12 feet embedded in the TOP face of each block (four under each
place of the layer above, so the support does not move with a block pushed out above it) and 4 bumpers on its sides.

| what | contype | conaffinity | touches |
|---|---|---|---|
| box | 0 | 15 (31 while held) | feet, bumpers, tip, floor (jaws) |
| foot | 1 | 0 | box, floor |
| bumper | 2 | 0 | box |
| tip | 4 | 0 | box |
| floor | 8 | 1 | box, foot |
| jaw | 16 | 0 | the held box |

Contacts are stiff with an elliptic cone and impratio 30; with a pyramidal cone or impratio 1 blocks creep.  Integration
is implicit, with Newton's method to 1e-10; a tolerance of 1e-6 takes twice as long because each step starts from a
worse solution.  See E. Todorov, T. Erez, Y. Tassa, IROS 2012, doi 10.1109/IROS.2012.6386109.
"""

import numpy as np

from thesis_lib.jenga.tower.settings import RobotSettings, TowerSettings
from thesis_lib.mechanics.space import rotation_matrix

LAYERS, PER_LAYER = 18, 3
BLOCKS = LAYERS * PER_LAYER
FOOT = 2.5e-3  # m, radius of feet, bumpers and pads
FOOT_INSET = 9.5e-3  # m along each axis from the middle of a place to its feet
HAND_MASS, JAW_MASS = 0.2, 0.02  # kg
HAND_STIFFNESS, JAW_STIFFNESS = 5000.0, 2000.0  # N/m
HAND_TURN = 20.0  # N m/rad
OPEN = 8e-3  # m between an open jaw's pads and the block
PARKED = np.array([0.4, 0.4, 0.5])  # m, position of idle tools
TIP = ("tip_x", "tip_y", "tip_z")  # joints of the robot, and the drives on them
HAND = ("hand_x", "hand_y", "hand_z", "hand_turn")
JAWS = ("jaw_left", "jaw_right")
ORIGIN = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])  # pose of a block in its own body


def _numbers(values) -> str:
    return " ".join(f"{value:.12g}" for value in np.atleast_1d(values))


def _geoms(block: int, size: np.ndarray, settings: TowerSettings, pose: np.ndarray = ORIGIN) -> str:
    """MJCF geoms of one block at `pose` (7,), m and quaternion, in the frame of its body."""
    length, width, _ = settings.block
    pitch = width + settings.gap
    half = size / 2.0
    feet = [
        (place * pitch + x, y, half[2] - FOOT)
        for place in (-1, 0, 1)
        for x in (-FOOT_INSET, FOOT_INSET)
        for y in (-FOOT_INSET, FOOT_INSET)
    ]
    bumpers = [(x, side * (half[1] - FOOT), 0.0) for x in (-length / 3, length / 3) for side in (-1, 1)]
    origin, turn = pose[:3], pose[3:]
    matrix = rotation_matrix(turn)
    slippery = settings.hidden.slippery_layer == block // PER_LAYER
    # MuJoCo takes the higher friction of two geoms unless one has priority
    surface = f' priority="1" friction="{settings.hidden.slippery_friction} .005 .0001"' if slippery else ""
    place = f'size="{_numbers(half)}" pos="{_numbers(origin)}" quat="{_numbers(turn)}"'
    lines = [f'<geom class="core" name="core{block}" {place}{surface}/>']
    lines += [f'<geom class="foot" pos="{_numbers(origin + matrix @ p)}"{surface}/>' for p in feet]
    lines += [f'<geom class="bumper" pos="{_numbers(origin + matrix @ p)}"{surface}/>' for p in bumpers]
    return "".join(lines)


def stacked(sizes: np.ndarray, settings: TowerSettings) -> np.ndarray:
    """Initial poses (54, 7), m and quaternions: each block at the top height of the layer below, not yet settled."""
    pitch = settings.block[1] + settings.gap
    poses, base = np.zeros((BLOCKS, 7)), 0.0
    for layer in range(LAYERS):
        rows = np.arange(PER_LAYER) + layer * PER_LAYER
        across = (np.arange(PER_LAYER) - 1) * pitch
        # odd layers are turned by 90 degrees: the block's long axis is y and its y axis is -x
        poses[rows, 0], poses[rows, 1] = (0.0, across) if layer % 2 == 0 else (-across, 0.0)
        poses[rows, 2] = base + sizes[rows, 2] / 2.0
        poses[rows, 3:] = (1, 0, 0, 0) if layer % 2 == 0 else (np.sqrt(0.5), 0, 0, np.sqrt(0.5))
        base += sizes[rows, 2].max()
    return poses


def _slides(name: str) -> str:
    axes = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    return "".join(f'<joint name="{name}_{n}" type="slide" axis="{axis}"/>' for n, axis in axes.items())


def _drive(joint: str, stiffness: float, mass: float, limit: float | None = None) -> str:
    """MJCF position drive of a joint, critically damped for the mass or inertia it moves (kg, kg m²); limit in N."""
    force = "" if limit is None else f' forcerange="{-limit} {limit}"'
    damping = 2.0 * np.sqrt(stiffness * mass)
    return f'<position name="{joint}" joint="{joint}" kp="{stiffness}" kv="{damping:.9g}"{force}/>'


def _pusher(robot: RobotSettings, settings: TowerSettings) -> tuple[str, str]:
    mass = settings.hidden.pusher_mass or robot.tip_mass
    body = (
        f'<body name="tip" gravcomp="{robot.tip_mass / mass:.9g}">{_slides("tip")}<geom name="tip" type="sphere" '
        f'size="{robot.tip_radius}" mass="{mass}" contype="4" conaffinity="0" priority="2" '
        f'friction="{robot.tip_friction} .005 .0001"/></body>'
    )
    return body, "".join(_drive(joint, robot.stiffness, mass, robot.force_limit) for joint in TIP)


def _gripper(robot: RobotSettings, settings: TowerSettings) -> tuple[str, str]:
    half = settings.block[1] / 2.0
    jaws = ""
    for name, side in (("left", 1), ("right", -1)):
        pads = "".join(
            f'<geom type="sphere" size="{FOOT}" pos="{x} {side * (half + FOOT)} {z}" mass="{JAW_MASS / 4}" '
            f'contype="16" conaffinity="0" priority="2" friction="{robot.jaw_friction} .005 .0001"/>'
            for x in (-5e-3, 5e-3)
            for z in (-4e-3, 4e-3)
        )
        # the joint coordinate is the distance from the pads to the block's nominal side
        joint = f'<joint name="jaw_{name}" type="slide" axis="0 {side} 0"/>'
        jaws += f'<body name="{name}" gravcomp="1">{joint}{pads}</body>'
    body = (
        f'<body name="hand" gravcomp="1">{_slides("hand")}<joint name="hand_turn" type="hinge" axis="0 0 1"/>'
        f'<inertial pos="0 0 0" mass="{HAND_MASS}" diaginertia="1e-4 1e-4 1e-4"/>{jaws}</body>'
    )
    drives = [_drive(joint, HAND_STIFFNESS, HAND_MASS + 2 * JAW_MASS) for joint in HAND[:3]]
    drives.append(_drive("hand_turn", HAND_TURN, 2e-4))
    drives += [_drive(joint, JAW_STIFFNESS, JAW_MASS, robot.jaw_force) for joint in JAWS]
    return body, "".join(drives)


def tower_xml(
    sizes: np.ndarray,
    poses: np.ndarray,
    settings: TowerSettings,
    robot: RobotSettings,
    static: frozenset[int] = frozenset(),
    lump: frozenset[int] = frozenset(),
) -> str:
    """Return the MJCF (MuJoCo's XML) of a tower with its robot.

    sizes: (54, 3), m.  poses: (54, 7), m and quaternions.  `static` blocks are fixed to the world, `lump` blocks form
    one body, as do the settings' glued blocks.  All others are free bodies.
    """
    groups = {"static": static, "lump": lump, "glued": frozenset(settings.hidden.glued) - static - lump}
    geoms = {
        name: "".join(_geoms(block, sizes[block], settings, poses[block]) for block in sorted(group))
        for name, group in groups.items()
    }
    bodies = [f'<body name="{name}"><freejoint/>{geoms[name]}</body>' for name in ("lump", "glued") if geoms[name]]
    single = sorted(set(range(BLOCKS)).difference(*groups.values()))
    for block in single:
        where = f'pos="{_numbers(poses[block, :3])}" quat="{_numbers(poses[block, 3:])}"'
        bodies.append(f'<body name="block{block}" {where}><freejoint/>{_geoms(block, sizes[block], settings)}</body>')
    pusher, pusher_drives = _pusher(robot, settings)
    gripper, gripper_drives = _gripper(robot, settings)
    return f"""<mujoco>
<compiler angle="radian"/>
<option timestep="{settings.timestep}" integrator="implicitfast" solver="Newton" iterations="{settings.iterations}"
        tolerance="1e-10" cone="elliptic" impratio="{settings.impratio}">
  <flag multiccd="disable" autoreset="disable"/>
</option>
<size memory="64M"/>
<default>
  <geom condim="3" solref="0.004 1" solimp=".99 .999 1e-4 .5 2" friction="{settings.friction} .005 .0001"/>
  <default class="core"><geom type="box" density="{settings.density}" contype="0" conaffinity="15"/></default>
  <default class="foot"><geom type="sphere" size="{FOOT}" mass="0" contype="1" conaffinity="0"/></default>
  <default class="bumper"><geom type="sphere" size="{FOOT}" mass="0" contype="2" conaffinity="0"/></default>
</default>
<worldbody>
  <geom name="floor" type="plane" size="1 1 .1" contype="8" conaffinity="1"/>
  {geoms["static"]}{"".join(bodies)}{pusher}{gripper}
</worldbody>
<actuator>{pusher_drives}{gripper_drives}</actuator>
</mujoco>"""
