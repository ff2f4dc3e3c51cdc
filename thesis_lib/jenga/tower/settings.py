"""Settings of tower, robot, sensing and collection: SI units; "own choice" where the thesis gives no number."""

import math
from typing import Self

from pydantic import Field, model_validator

from thesis_lib.foundation.settings import Section


class HiddenEffects(Section):
    """Effects absent from training; none by default."""

    glued: tuple[int, ...] = Field((), description="numbers of blocks joined into one body; meant for up to three")
    slippery_layer: int | None = Field(None, ge=0, le=17, description="layer whose faces have `slippery_friction`")
    slippery_friction: float = Field(0.1, gt=0, description="of that layer's faces; own choice: waxed wood")
    pusher_mass: float | None = Field(None, gt=0, description="kg; the arm carries only `tip_mass`: it sags and rubs")


class TowerSettings(Section):
    """A tower of 18 layers of three blocks that differ in height only."""

    block: tuple[float, float, float] = Field((0.075, 0.025, 0.015), description="m, length, width, height; usual game")
    height_tolerance: float = Field(0.15e-3, ge=0, description="m, one sigma; own choice: 47 % movable; real: 0.175 mm")
    length_tolerance: float = Field(0.0, ge=0, description="m, one sigma; own choice: height alone makes blocks loose")
    width_tolerance: float = Field(0.0, ge=0, description="m, one sigma; own choice, as length")
    clip: float = Field(2.5, gt=0, description="sigmas at which tolerances are truncated; own choice")
    gap: float = Field(0.4e-3, ge=0, description="m, between blocks of a layer; own choice")
    density: float = Field(530.0, gt=0, description="kg/m³; own choice: light hardwood, 14.9 g a block")
    friction: float = Field(0.4, gt=0, description="wood on wood; own choice")
    timestep: float = Field(2e-3, gt=0, description="s; 4 ms is not robust with contacts this stiff")
    iterations: int = Field(200, ge=1, description="cap of the contact solver; reaching it is an error")
    impratio: float = Field(30.0, gt=0, description="ratio of impedances, friction to normal; own choice: 10 creeps")
    settling: float = Field(1.5, gt=0, description="s simulated before use; own choice: the tower is then at rest")
    settling_damping: float = Field(1.0, ge=0, description="N s/m a block, first two thirds of settling; own choice")
    topple_tilt: float = Field(30.0, gt=0, description="degrees from upright at which a block has fallen; own choice")
    topple_drop: float = Field(8e-3, gt=0, description="m, about half a block, at which it has fallen; own choice")
    hidden: HiddenEffects = Field(HiddenEffects(), description="differences from the towers of training")


class HealthSettings(Section):
    """Criteria that a tower must meet before it is used."""

    sinking: float = Field(2e-3, gt=0, description="m between settled top and sum of heights; own choice")
    drift: float = Field(10e-6, gt=0, description="m/s, median speed of blocks at rest")
    drift_time: float = Field(0.2, gt=0, description="s over which drift is measured")


class RobotSettings(Section):
    """Point pusher on a compliant finger, and a parallel-jaw gripper."""

    tip_radius: float = Field(3e-3, gt=0, description="m; own choice")
    tip_friction: float = Field(0.42, gt=0, description="PLA on wood; thesis, figure 5-7")
    tip_mass: float = Field(0.05, gt=0, description="kg of finger and mount; own choice")
    stiffness: float = Field(650.0, gt=0, description="N/m of the finger; own choice: bottom blocks move after 5 steps")
    force_limit: float = Field(4.0, gt=0, description="N of the arm; own choice: too little to drag the bottom layers")
    start_off: tuple[float, float] = Field((0.0, 0.0), description="m off the block, where pushes start; 0: in contact")
    step: float = Field(1e-3, gt=0, description="m per step of a push; thesis")
    step_time: float = Field(0.05, gt=0, description="s simulated for it; own choice: 0.1 s takes twice the CPU time")
    averaged: int = Field(10, ge=1, description="time steps at its end over which force is averaged; own choice")
    longest_push: float = Field(45e-3, gt=0, description="m, after which the push ends; thesis")
    goal: float = Field(33e-3, gt=0, description="m that a block must protrude for extraction; see `robot`")
    recontact: float = Field(1e-3, gt=0, description="m off the wanted contact at which the finger lifts; own choice")
    clearance: float = Field(2e-3, gt=0, description="m by which the finger lifts off; own choice")
    jaw_force: float = Field(6.0, gt=0, description="N of each jaw; own choice: ten times what a free block needs")
    jaw_friction: float = Field(0.8, gt=0, description="rubber on wood; own choice")
    pull_speed: float = Field(0.06, gt=0, description="m/s; own choice")
    release_height: float = Field(0.6e-3, gt=0, description="m above the top at which a block is let go; own choice")
    grasp_aside: float | None = Field(7e-3, gt=0, description="m aside beyond which a grasp fails; null: no limit")
    damage_distance: float = Field(10e-3, gt=0, description="m of any other block that counts as damage; thesis")
    damage_angle: float = Field(15.0, gt=0, description="degrees of any other block that count as damage; thesis")

    @model_validator(mode="after")
    def _goal_within_reach(self) -> Self:
        if self.goal > self.longest_push:
            raise ValueError("goal is beyond longest_push, so no block could ever be extracted: raise longest_push too")
        return self

    def is_damage(self, distance: float, angle: float) -> bool:
        """Whether another block displaced by `distance` (m) and turned by `angle` (rad) counts as damage."""
        return distance > self.damage_distance or angle > math.radians(self.damage_angle)


class SensingSettings(Section):
    """Standard deviations of the robot's readings; all are own choices, none is published."""

    exact: bool = Field(False, description="read true states (thesis, section 5.4.3); the rest is then unused")
    pose_first: float = Field(0.8e-3, ge=0, description="m, of x, y and yaw·r_g at the start of a push")
    pose_last: float = Field(0.3e-3, ge=0, description="m, of the same when much of the block is visible")
    pose_length: float = Field(8e-3, gt=0, description="m of advance over which the difference falls by e")
    force: float = Field(0.03, ge=0, description="N, each axis, of a wrist sensor after averaging")
    tower: float = Field(0.3e-3, ge=0, description="m, of the tower's perturbation")


class CollectSettings(Section):
    """The base exploration policy; all are own choices."""

    change: float = Field(0.25, ge=0, le=1, description="probability per step of a new contact and heading")
    offset: float = Field(8e-3, ge=0, description="m, contact locations are uniform within this of the centre")
    heading: float = Field(0.15, ge=0, description="rad, headings are uniform within this")
    miss: float = Field(0.0, ge=0, le=1, description="probability that a push touches no block")
    fewest: int = Field(1, ge=1, description="steps before a push may be given up at random")
    retract: float = Field(0.1, ge=0, le=1, description="probability per step of giving up: many blocks in 100 samples")
    force_limit: float | None = Field(None, gt=0, description="measured N that end the push; null: the arm's limit")
    tower_limit: float = Field(6e-3, gt=0, description="m of perturbation seen that ends the push, to spare the tower")
    stray_limit: float = Field(12e-3, gt=0, description="m sideways or of yaw·r_g that ends the push: the block leaves")
    reduced: bool = Field(False, description="push on the reduced tower (declared fast variant)")


class MovableSettings(Section):
    """Criterion by which a block counts as movable in a straight centred push."""

    steps: int = Field(6, ge=1, description="of 1 mm; own choice: a stuck block bends the finger by up to 4 mm")
    threshold: float = Field(1e-3, gt=0, description="m that others may move; 47 % of towers 0 to 4 are then movable")
    follows: float = Field(0.5, ge=0, lt=1, description="share of the advance that the block must follow; own choice")

    @property
    def threshold_mm(self) -> float:
        """The threshold in mm."""
        return 1e3 * self.threshold


class Setup(Section):
    """All settings of a run on a tower, except those of learner and controller."""

    tower: TowerSettings = Field(TowerSettings(), description="the blocks and their simulation")
    health: HealthSettings = Field(HealthSettings(), description="criteria that a tower must meet before it is used")
    robot: RobotSettings = Field(RobotSettings(), description="pusher and gripper")
    sensing: SensingSettings = Field(SensingSettings(), description="noise of the readings")
    collect: CollectSettings = Field(CollectSettings(), description="the base exploration policy")
    movable: MovableSettings = Field(MovableSettings(), description="the criterion of the hidden label")
