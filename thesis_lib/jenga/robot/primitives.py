"""Primitives extract and place: a parallel-jaw gripper pulls a block out of the tower and puts it on top.

The open jaws approach along the middle of the block's place, with 8 mm clearance beside it.  They cannot grasp a block
whose end is further aside than `grasp_aside`; it stays in place (thesis, section 5.5.3: a block that was pushed
badly is difficult to grasp).  With 7 mm the exploration brings out 59 % of 58 blocks that it has pushed to the goal on
the development towers 0 to 7 (thesis: 56 %), without the limit 94 % of 53 (development_success.csv of
config/reference/chapter5).  Two thin jaws of limited force close on the long sides of the protruding end, touch nothing
else, and hold it by friction.  The hand pulls along the block until its other end has left the tower.  The transfer is
not simulated: hand and block are set down above a random free place of the top layer (a new layer if it is full), and
the jaws open.

Damage (thesis, section 5.5.3): the primitive displaces another block by more than 10 mm or turns it by more than 15
degrees.  A run ends when a block has fallen, on or off the tower.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.robot.robot import push_axes, way_out
from thesis_lib.jenga.tower.tower import PER_LAYER, Tower
from thesis_lib.jenga.tower.tower_model import BLOCKS, HAND, JAWS, OPEN, PARKED

GRASP = 10e-3  # m from the end of the block to the middle of the pads
SQUEEZE = -4e-3  # m past the block's side, commanded to the jaws: the force limit stops them earlier
CLOSING, OPENING, RESTING = 0.1, 0.1, 0.4  # s
BEYOND = 5e-3  # m by which the block is pulled beyond its length
SLIPPED = 10e-3  # m that a block may move in the jaws before it counts as lost
JAW = 16  # the jaws' bit of contype and conaffinity
ASIDE, LOST, FELL_FROM_TOP = "jaws miss it", "lost from the jaws", "fell from the top"


class PrimitiveOutcome(NamedTuple):
    """Result of a primitive: reason of failure ("" for success), and whether a block has fallen."""

    reason: str
    ends_run: bool

    @property
    def success(self) -> bool:
        return not self.reason


class Gripper:
    """Extracts blocks from a tower and places them on top, one at a time."""

    def __init__(self, tower: Tower):
        self.tower, self.settings = tower, tower.robot_settings
        model = tower.model
        self._hand, self._jaws = tower.drives(HAND), tower.drives(JAWS)
        self._pads = np.flatnonzero(model.geom_contype == JAW)
        self._body = model.body("hand").id
        self.held: int | None = None

    def extract(self, block: int) -> PrimitiveOutcome:
        """Grasp a block and pull it out of the tower; after success it is held.

        UserError if the block does not protrude far enough to be grasped, TowerError if the simulation breaks down.
        """
        tower, (u, v) = self.tower, push_axes(block)
        out = way_out(tower, block)
        if out < 2 * GRASP:
            raise UserError(f"block {block} protrudes by only {1e3 * out:.0f} mm: push it further before extraction.")
        before = tower.poses()
        if block in tower.settings.hidden.glued:  # glued blocks cannot be pulled out together
            return PrimitiveOutcome("it does not come out", False)
        aside = abs((self._grasped(block) - tower.reference[block, :3]) @ v)
        if self.settings.grasp_aside is not None and aside > self.settings.grasp_aside:
            return PrimitiveOutcome(ASIDE, False)
        self._grasp(block)
        distance = tower.sizes[block, 0] - out + BEYOND
        inside = self._in_hand()
        self._pull(u * distance, distance / self.settings.pull_speed)
        if np.linalg.norm(self._in_hand() - inside) > SLIPPED or not self._touching():
            reason = LOST
        else:
            reason = self._damage(block, before)
        # a held block may hang at an angle without falling
        ends = tower.toppled(block) or (reason == LOST and block in tower.fallen())
        if reason == LOST:
            self.let_go()
        return PrimitiveOutcome(reason, ends)

    def place(self, rng: np.random.Generator) -> PrimitiveOutcome:
        """Put the held block on a random free place of the top layer.  Errors as in `extract`."""
        if self.held is None:
            raise UserError("no block is held: extract one before placing it.")
        tower, block = self.tower, self.held
        before = tower.poses()
        layer, places = free_places(tower, block)
        place = int(rng.choice(places))
        pose = self._target(block, layer, place)
        self._carry(pose)
        tower.data.ctrl[self._jaws] = OPEN
        tower.simulate(OPENING)
        self.let_go()
        tower.simulate(RESTING)
        tower.layer[block], tower.place[block] = layer, place
        low = pose[2] - tower.position(block)[2]
        reason = FELL_FROM_TOP if low > tower.settings.topple_drop / 2 else self._damage(block, before)
        tower.reference[block] = tower.poses()[block]
        return PrimitiveOutcome(reason, reason == FELL_FROM_TOP or tower.toppled(block))

    def _grasped(self, block: int) -> np.ndarray:
        """Grasp point of the block, midway between the pads, (3,), m."""
        along = self.tower.matrix(block)[:, 0]
        return self.tower.position(block) + (self.tower.sizes[block, 0] / 2.0 - GRASP) * along

    def _grasp(self, block: int) -> None:
        tower = self.tower
        self.held = block
        tower.set_joints(HAND + JAWS, (*self._grasped(block), _turn(tower.matrix(block)), OPEN, OPEN))
        self._let_jaws_touch(block, True)
        mujoco.mj_forward(tower.model, tower.data)
        tower.data.ctrl[self._jaws] = SQUEEZE
        tower.simulate(CLOSING)

    def _let_jaws_touch(self, block: int, yes: bool) -> None:
        model, geom = self.tower.model, self.tower.core[block]
        for mask, row in ((model.geom_conaffinity, geom), (model.body_conaffinity, model.geom_bodyid[geom])):
            mask[row] = mask[row] | JAW if yes else mask[row] & ~JAW

    def _pull(self, way: np.ndarray, seconds: float) -> None:
        drives = self._hand[:3]
        start = self.tower.data.ctrl[drives].copy()
        # a cubic ramp starts and stops without a jerk
        steps = round(seconds / self.tower.settings.timestep)
        for step in range(steps):
            share = (step + 1) / steps
            self.tower.data.ctrl[drives] = start + way * share**2 * (3.0 - 2.0 * share)
            self.tower.step()
        self.tower.simulate(CLOSING)

    def _in_hand(self) -> np.ndarray:
        """Position of the held block in the hand's frame, (3,), m."""
        data = self.tower.data
        return data.xmat[self._body].reshape(3, 3).T @ (self.tower.position(self.held) - data.xpos[self._body])

    def _touching(self) -> bool:
        pairs = self.tower.data.contact.geom
        left, right = np.split(self._pads, 2)
        return bool(np.isin(left, pairs).any() and np.isin(right, pairs).any())

    def _damage(self, block: int, before: np.ndarray) -> str:
        if self.tower.toppled(block):
            return "tower toppled"
        return "tower damaged" if self.settings.is_damage(*self.tower.perturbation(block, before)) else ""

    def _target(self, block: int, layer: int, place: int) -> np.ndarray:
        """Pose x, y, z (m), yaw (rad) of a block just above its place, (4,), from the poses of the layer below."""
        tower = self.tower
        below = [other for other in range(BLOCKS) if tower.layer[other] == layer - 1]
        centre = np.mean([tower.position(other) for other in below], axis=0)
        matrix = tower.matrix(below[int(np.argmin([abs(tower.place[other] - 1) for other in below]))])
        # successive layers are a quarter turn apart, as in the tower as built
        turn = _turn(matrix) + (np.pi / 2 if layer % 2 else -np.pi / 2)
        pitch = tower.settings.block[1] + tower.settings.gap
        across = np.array([-np.sin(turn), np.cos(turn)]) * (place - 1) * pitch
        top = max(tower.position(other)[2] + tower.sizes[other, 2] / 2.0 for other in below)
        held = tower.matrix(block)
        hanging = np.abs(held[2]) @ tower.sizes[block] / 2.0  # half of its vertical extent, tilt included
        return np.array([*(centre[:2] + across), top + hanging + self.settings.release_height, turn])

    def _carry(self, pose: np.ndarray) -> None:
        """Move block and hand together to `pose`, at rest, with an unchanged grasp."""
        tower, model, data = self.tower, self.tower.model, self.tower.data
        here, turned = tower.position(self.held), pose[3] - _turn(tower.matrix(self.held))
        spin = np.array([np.cos(turned / 2), 0.0, 0.0, np.sin(turned / 2)])
        cos, sin = np.cos(turned), np.sin(turned)
        rotate = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        hand = np.array([data.joint(name).qpos[0] for name in HAND])
        stretch = data.ctrl[self._hand] - hand  # of the drives' springs, which is kept
        hand = np.append(rotate @ (hand[:3] - here) + pose[:3], hand[3] + turned)
        tower.set_joints(HAND, hand)
        data.ctrl[self._hand] += stretch
        joint = model.body_jntadr[model.geom_bodyid[tower.core[self.held]]]
        place, velocity = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        quaternion = np.empty(4)
        mujoco.mju_mulQuat(quaternion, spin, data.qpos[place + 3 : place + 7].copy())
        data.qpos[place : place + 3], data.qpos[place + 3 : place + 7] = pose[:3], quaternion
        data.qvel[velocity : velocity + 6] = 0.0
        mujoco.mj_forward(model, data)

    def let_go(self) -> None:
        """Release the held block where it is, and park the hand."""
        self._let_jaws_touch(self.held, False)
        self.tower.set_joints(HAND + JAWS, (*PARKED, 0.0, OPEN, OPEN))
        mujoco.mj_forward(self.tower.model, self.tower.data)
        self.held = None


def _turn(matrix: np.ndarray) -> float:
    """Angle (rad) of a body's long axis about the vertical."""
    return float(np.arctan2(matrix[1, 0], matrix[0, 0]))


def free_places(tower: Tower, held: int) -> tuple[int, np.ndarray]:
    """Layer that is being filled and its free places; if it is full, the next layer."""
    others = np.arange(BLOCKS) != held
    layer = int(tower.layer[others].max())
    taken = tower.place[others & (tower.layer == layer)]
    if len(taken) == PER_LAYER:
        return layer + 1, np.arange(PER_LAYER)
    return layer, np.setdiff1d(np.arange(PER_LAYER), taken)
