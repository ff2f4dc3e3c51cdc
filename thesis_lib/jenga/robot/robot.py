"""The point pusher and its sensors: approach a block, push in steps of 1 mm, change the contact, retract.

The finger is a sphere on a spring (stiffness k) at the end of an arm whose position is known exactly.  Against a block
that does not move, the force rises by k · 1 mm per step up to the arm's force limit.  Frame of a push: u along the
layer's long axis, v = z × u.  An action is a contact location on the end face and a heading φ: the arm advances by
1 mm (cos φ u + sin φ v).  To change the contact location the finger lifts, moves and presses again to the same
deflection BEFORE the state s_t is read, because no model could predict the force across a re-contact.

A push starts in contact or, with noisy sensors, `start_off` from the block: then it feels no block at first (thesis,
figure 5-8), and until first contact it changes the contact location without coming nearer.

The thesis is inconsistent here: pushes of at most 45 mm are 0.6 of the block, but extraction requires more than 3/4 (56
mm).  Here the gripper takes over at `goal` = 33 mm: at 45 mm the centre of mass lies beyond the support (37.5 mm).
config/chapter5_switches has the alternative, 56 mm with longer pushes, and the thesis's states without noise.

Readings are z_t = s_t + noise, Gaussian and independent from reading to reading.  The camera sees little of a block at
the start of a push, so pose noise falls with the advance a (thesis, section 5.5.4): σ_pose(a) = σ_last + (σ_first −
σ_last) exp(−a/ℓ).  Force noise is constant, and the arm knows its advance exactly (`SensingSettings`).
"""

import mujoco
import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.robot.samples import ADVANCE, F_N, F_T, MM, RADIUS_OF_GYRATION, STATE, TOWER, YAW, X, Y
from thesis_lib.jenga.tower.settings import SensingSettings
from thesis_lib.jenga.tower.tower import PER_LAYER, REACHABLE, Tower
from thesis_lib.jenga.tower.tower_model import PARKED, TIP

GAP = 1e-3  # m from the face at which an approach starts
APPROACH = 0.2e-3  # m that the arm moves between checks for contact
LIFT_TIME = 0.03  # s of each of the three moves of a re-contact


def standard_deviations(advance: float, settings: SensingSettings) -> np.ndarray:
    """Standard deviations (7,) of readings, mm and N, at an advance (mm); 0 if the robot reads true states."""
    sigma = np.zeros(len(STATE))
    if not settings.exact:
        falling = (settings.pose_first - settings.pose_last) * np.exp(-max(advance, 0.0) / (MM * settings.pose_length))
        sigma[[X, Y, YAW]] = MM * (settings.pose_last + falling)
        sigma[[F_N, F_T]] = settings.force
        sigma[TOWER] = MM * settings.tower
    return sigma


def reading(state: np.ndarray, settings: SensingSettings, rng: np.random.Generator) -> np.ndarray:
    """Simulated reading z_t of the true state s_t, (7,), mm and N (`samples.STATE`), by camera and force sensor."""
    return state + standard_deviations(state[ADVANCE], settings) * rng.standard_normal(len(STATE))


def push_axes(block: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors u along and v across a push of a block in its original place, (3,) each."""
    along = np.array([1.0, 0.0, 0.0]) if (block // PER_LAYER) % 2 == 0 else np.array([0.0, 1.0, 0.0])
    return along, np.cross([0.0, 0.0, 1.0], along)


def way_out(tower: Tower, block: int) -> float:
    """Displacement of a block out of its place in the direction of its push, m."""
    return float((tower.position(block) - tower.reference[block, :3]) @ push_axes(block)[0])


class Robot:
    """Pushes blocks of one tower and reads the sensors, with noise from `rng`; without `rng` it reads true states.

    After `start(block)`: `push_step(offset, heading)` any number of times, then `retract()`.  Arguments are in
    m; `state` and `observe` are in mm.
    """

    def __init__(
        self, tower: Tower, sensing: SensingSettings | None = None, rng: np.random.Generator | None = None
    ) -> None:
        self.tower, self.settings = tower, tower.robot_settings
        self.sensing, self.rng = sensing or SensingSettings(), rng
        self.block: int | None = None
        self._tip = tower.model.geom("tip").id
        self._drives = tower.drives(TIP)
        self._wrench = np.zeros(6)
        self._seen: np.ndarray | None = None

    def start(self, block: int, offset: float = 0.0, off: float | None = None) -> np.ndarray:
        """Bring the finger to a block's end face, at `offset` (m) across it, and return the first reading, (7,).

        off: m off the block, by default from `start_off`.  UserError if the block cannot be reached, TowerError if
        the simulation breaks down.
        """
        if block not in REACHABLE:
            raise UserError(
                f"block {block} cannot be pushed: choose one of 0 to {REACHABLE[-1]} that stands in the tower."
            )
        self.block = block
        self.u, self.v = push_axes(block)
        self.start_position, self.start_yaw = self.tower.position(block), self._yaw()
        self.start_poses = self.tower.poses()
        self.force, self.steps = np.zeros(3), 0
        if off is None and self.rng is not None and self.settings.start_off[1] > 0.0:
            off = self.rng.uniform(*self.settings.start_off)
        point = self._tip_place(offset) - (GAP if off is None else off) * self.u
        self.tower.set_joints(TIP, point)
        mujoco.mj_forward(self.tower.model, self.tower.data)
        self.arm, self._met = point, False
        for _ in range(round(3.0 * GAP / APPROACH) if off is None else 0):
            self._move(self.arm + APPROACH * self.u, 0.02)
            if self._met:
                break
        self.start_of_push = self.arm.copy()
        return self._look()

    def touch(self, offset: float) -> np.ndarray:
        """Move the contact to `offset` (m across the face), with the same deflection, and return the reading, (7,).

        Within `recontact` of the present contact nothing moves, and the last reading is returned.
        """
        tip = self.tower.data.geom_xpos[self._tip]
        here = self.tower.matrix(self.block).T @ (tip - self.tower.position(self.block))
        if abs(here[1] - offset) <= self.settings.recontact:
            return self._seen
        pressed = self._pressed()
        # computed before lifting: a block that springs back is pressed to where it was
        wanted = self._tip_place(offset)
        if not self._met:
            self._move(wanted - ((wanted - self.arm) @ self.u) * self.u, LIFT_TIME)
            return self._look()
        self._move(self.arm - (pressed + self.settings.clearance) * self.u, LIFT_TIME)
        self._move(wanted - self.settings.clearance * self.u, LIFT_TIME)
        self._move(wanted + pressed * self.u, LIFT_TIME)
        return self._look()

    def push_step(self, offset: float, heading: float) -> tuple[np.ndarray, np.ndarray]:
        """Make contact at `offset` (m), then advance 1 mm with this heading (rad, 0 along the block).

        Return the readings after re-contact and after the advance, (7,) each.
        """
        before = self.touch(offset)
        self.steps += 1
        way = self.settings.step * (np.cos(heading) * self.u + np.sin(heading) * self.v)
        self._move(self.arm + way, self.settings.step_time)
        return before, self._look()

    def retract(self) -> None:
        """Lift the finger off the block and park it."""
        self._move(self.arm - (self._pressed() + self.settings.clearance) * self.u, 2 * LIFT_TIME)
        self.tower.set_joints(TIP, PARKED)
        mujoco.mj_forward(self.tower.model, self.tower.data)
        self.block = None

    def at_end(self) -> bool:
        """Whether the longest push is over: 45 steps, even if re-contacts moved the finger back."""
        return self.steps * self.settings.step >= self.settings.longest_push - 0.5 * self.settings.step

    def state(self) -> np.ndarray:
        """True state s_t, (7,), mm and N; see `samples.STATE`.  Displacements are relative to the start of the push."""
        moved = self.tower.position(self.block) - self.start_position
        yaw = self._yaw() - self.start_yaw
        tower, _ = self.tower.perturbation(self.block, since=self.start_poses)
        pose = MM * (moved @ self.u), MM * (moved @ self.v), RADIUS_OF_GYRATION * np.arctan2(np.sin(yaw), np.cos(yaw))
        advance = float((self.arm - self.start_of_push) @ self.u)
        return np.array([*pose, self.force @ self.u, self.force @ self.v, MM * advance, MM * tower])

    def reached_goal(self) -> bool:
        """Whether the block protrudes far enough for the gripper."""
        return way_out(self.tower, self.block) >= self.settings.goal

    def _pressed(self) -> float:
        """Deflection of the finger along the push, m."""
        return max(self.force @ self.u, 0.0) / self.settings.stiffness

    def _look(self) -> np.ndarray:
        self._seen = self.state()
        if self.rng is not None:
            self._seen = reading(self._seen, self.sensing, self.rng)
        return self._seen

    def _yaw(self) -> float:
        along = self.tower.matrix(self.block)[:, 0]
        return float(np.arctan2(along @ self.v, along @ self.u))

    def _tip_place(self, offset: float) -> np.ndarray:
        """Centre of the tip in contact with the end face at `offset`, (3,), m."""
        matrix, length = self.tower.matrix(self.block), self.tower.sizes[self.block, 0]
        face = self.tower.position(self.block) + matrix @ np.array([-length / 2.0, offset, 0.0])
        return face - self.settings.tip_radius * matrix[:, 0]

    def _move(self, goal: np.ndarray, seconds: float) -> None:
        """Move the arm evenly to `goal` (3,), m, hold it there, and average the contact force meanwhile."""
        steps = max(round(seconds / self.tower.settings.timestep), self.settings.averaged + 1)
        ramp, start, total = steps - self.settings.averaged, self.arm, np.zeros(3)
        for step in range(steps):
            self.tower.data.ctrl[self._drives] = start + (goal - start) * min(1.0, (step + 1) / ramp)
            self.tower.step()
            if step >= ramp:
                total += self._contact_force()
        self.arm, self.force = goal, total / self.settings.averaged
        self._met = self._met or self.force @ self.u > 0.0

    def _contact_force(self) -> np.ndarray:
        """Contact force that the tip exerts on other bodies, (3,), N."""
        data, force = self.tower.data, np.zeros(3)
        pairs = data.contact.geom
        for row in np.flatnonzero((pairs == self._tip).any(axis=1)):
            mujoco.mj_contactForce(self.tower.model, data, row, self._wrench)
            sign = 1.0 if pairs[row, 0] == self._tip else -1.0
            force += sign * (data.contact.frame[row].reshape(3, 3).T @ self._wrench[:3])
        return force
