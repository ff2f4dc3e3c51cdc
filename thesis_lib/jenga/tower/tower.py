"""A tower of 54 blocks of unequal height in MuJoCo, and its present state.

Heights are h_b = h + δ_b, δ_b ~ N(0, σ_h²) cut at 2.5 σ_h, drawn from the tower's seed: the only cause of loose and
stuck blocks.  A tower is settled before use; `reference` then holds the settled poses.

Blocks are numbered 3 layer + place, from the bottom; 0 to 44 are reachable (thesis: the last three layers are not).
Even layers lie along x, odd ones along y; place 1 is the middle.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.tower.settings import RobotSettings, TowerSettings
from thesis_lib.jenga.tower.tower_model import BLOCKS, LAYERS, PARKED, PER_LAYER, rotation, stacked, tower_xml

REACHABLE = np.arange(BLOCKS - 3 * PER_LAYER)
STATE_KIND = mujoco.mjtState.mjSTATE_INTEGRATION


class TowerError(UserError):
    """A tower that cannot be used: it exploded, toppled, never came to rest, or the solver gave up."""


@dataclass(frozen=True)
class Snapshot:
    """All that is needed to continue: MuJoCo's integration state, and layer, place and reference of each block."""

    state: np.ndarray
    layer: np.ndarray
    place: np.ndarray
    reference: np.ndarray


def draw_sizes(settings: TowerSettings, seed: int) -> np.ndarray:
    """Length, width and height of the blocks of tower `seed`; (54, 3), m."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(5,)))
    normal = rng.standard_normal((BLOCKS, 3))
    while (far := np.abs(normal) > settings.clip).any():
        normal[far] = rng.standard_normal(far.sum())
    spread = (settings.length_tolerance, settings.width_tolerance, settings.height_tolerance)
    return np.asarray(settings.block) + normal * spread


class Tower:
    """One tower and the robot's bodies beside it; `settle` it before use.

    seed: of the heights, also quoted in messages.  model, data: MuJoCo's.  sizes: (54, 3), m.  layer, place: (54,) int,
    present place of each block (layer 18 and up: put on top).  reference: (54, 7), poses from which falls are judged.
    iterations_needed: most solver iterations in a step so far.
    """

    def __init__(
        self,
        seed: int,
        settings: TowerSettings | None = None,
        robot: RobotSettings | None = None,
        *,
        sizes: np.ndarray | None = None,
        poses: np.ndarray | None = None,
        **kinds: frozenset[int],
    ):
        """Blocks at `poses` (default: stacked, not yet settled); `kinds` as in `tower_xml`.

        Raises:
            TowerError: MuJoCo refuses the model.
        """
        self.seed = seed
        self.settings = settings or TowerSettings()
        self.robot_settings = robot or RobotSettings()
        self.sizes = draw_sizes(self.settings, seed) if sizes is None else sizes
        start = stacked(self.sizes, self.settings) if poses is None else poses
        self.absent = kinds.get("absent", frozenset())
        xml = tower_xml(self.sizes, start, self.settings, self.robot_settings, **kinds)
        try:
            self.model = mujoco.MjModel.from_xml_string(xml)
        except ValueError as error:
            raise TowerError(f"tower {seed}: MuJoCo refuses the model ({error}); check the tower's settings.") from None
        self.data = mujoco.MjData(self.model)
        self.present = np.array([block for block in range(BLOCKS) if block not in self.absent], dtype=int)
        self.core = np.array([self.model.geom(f"core{block}").id for block in self.present], dtype=int)
        self.layer = np.arange(BLOCKS) // PER_LAYER
        self.place = np.arange(BLOCKS) % PER_LAYER
        self.iterations_needed = 0
        self._pose = np.full((BLOCKS, 7), np.nan)
        for name in ("tip", "hand"):
            for axis, value in zip("xyz", PARKED):
                self.set_joint(f"{name}_{axis}", value)
        mujoco.mj_forward(self.model, self.data)
        self.reference = self.poses()

    # -- MuJoCo -------------------------------------------------------------------------------------------------------

    def set_joint(self, name: str, value: float) -> None:
        """Set a joint of the robot (m or rad), at rest, and the target of its drive."""
        joint = self.model.joint(name)
        self.data.qpos[joint.qposadr[0]] = value
        self.data.qvel[joint.dofadr[0]] = 0.0
        self.data.ctrl[np.flatnonzero(self.model.actuator_trnid[:, 0] == joint.id)[0]] = value

    def step(self, n: int = 1) -> None:
        """Advance `n` time steps.

        Raises:
            TowerError: numbers are not finite, or the solver reached its cap, so that its forces are wrong.
        """
        data = self.data
        for _ in range(n):
            mujoco.mj_step(self.model, data)
            self.iterations_needed = max(self.iterations_needed, int(data.solver_niter.max()))
            if self.iterations_needed >= self.settings.iterations:
                self._check_numbers()
                raise TowerError(
                    f"tower {self.seed}: the contact solver reached its cap of {self.settings.iterations} iterations "
                    f"at t = {data.time:.3f} s, so forces are not to be trusted. Raise `iterations` of the tower's "
                    "settings."
                )
        self._check_numbers()

    def _check_numbers(self) -> None:
        warned = [name for name, count in _warnings(self.data).items() if count]
        if warned or not np.isfinite(self.data.qpos).all():
            raise TowerError(
                f"tower {self.seed}: the simulation broke down at t = {self.data.time:.3f} s "
                f"({', '.join(warned) or 'NaN'}). The tower exploded: use a shorter time step."
            )

    def simulate(self, seconds: float) -> None:
        """Advance by a time, s; errors as in `step`."""
        self.step(max(1, round(seconds / self.settings.timestep)))

    def settle(self) -> "Tower":
        """Let the tower come to rest and make its poses the `reference`.  Errors as in `step`."""
        model, undamped = self.model, self.model.dof_damping.copy()
        free = model.jnt_dofadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        for dof in range(6):
            # (23 mm)²: about a block's inertia over its mass
            model.dof_damping[free + dof] = self.settings.settling_damping * (1.0 if dof < 3 else 23e-3**2)
        self.simulate(self.settings.settling * 2.0 / 3.0)
        model.dof_damping[:] = undamped
        self.simulate(self.settings.settling / 3.0)
        self.reference = self.poses()
        return self

    def save(self) -> Snapshot:
        """The present state, from which `load` continues exactly."""
        state = np.empty(mujoco.mj_stateSize(self.model, STATE_KIND))
        mujoco.mj_getState(self.model, self.data, state, STATE_KIND)
        return Snapshot(state, self.layer.copy(), self.place.copy(), self.reference.copy())

    def load(self, snapshot: Snapshot) -> None:
        """Return to a snapshot of this tower."""
        mujoco.mj_setState(self.model, self.data, snapshot.state, STATE_KIND)
        mujoco.mj_forward(self.model, self.data)
        # mj_forward changes the solver's warm start: without a reset a continued run would differ in the last bits
        mujoco.mj_setState(self.model, self.data, snapshot.state, STATE_KIND)
        self.layer, self.place = snapshot.layer.copy(), snapshot.place.copy()
        self.reference = snapshot.reference.copy()

    # -- what can be seen ---------------------------------------------------------------------------------------------

    def poses(self) -> np.ndarray:
        """Poses of the blocks, (54, 7): m, unit quaternions; NaN where a block is absent."""
        self._pose[self.present, :3] = self.data.geom_xpos[self.core]
        quaternion = np.empty(4)
        for block, geom in zip(self.present, self.core):
            mujoco.mju_mat2Quat(quaternion, self.data.geom_xmat[geom])
            self._pose[block, 3:] = quaternion
        return self._pose.copy()

    def position(self, block: int) -> np.ndarray:
        """Centre of a block, (3,), m."""
        return self.data.geom_xpos[self.core_of(block)].copy()

    def matrix(self, block: int) -> np.ndarray:
        """Orientation of a block, (3, 3)."""
        return self.data.geom_xmat[self.core_of(block)].reshape(3, 3).copy()

    def core_of(self, block: int) -> int:
        """MuJoCo's geom id of a block's box."""
        return int(self.core[np.searchsorted(self.present, block)])

    def perturbation(self, block: int, since: np.ndarray | None = None) -> tuple[float, float]:
        """Largest displacement (m) and rotation (rad) of any other block since poses (54, 7), default `reference`."""
        others = self.present[self.present != block]
        before = (self.reference if since is None else since)[others]
        rows = self.core[self.present != block]
        distance = np.linalg.norm(self.data.geom_xpos[rows] - before[:, :3], axis=1).max()
        # trace of the product of rotations is 1 + 2 cos(angle)
        trace = (self.data.geom_xmat[rows].reshape(-1, 3, 3) * rotation(before[:, 3:])).sum((1, 2))
        return float(distance), float(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)).max())

    def fallen(self) -> np.ndarray:
        """Numbers of the blocks that lie half a block below `reference`, or are tilted."""
        z = self.data.geom_xpos[self.core, 2]
        upright = self.data.geom_xmat[self.core, 8]
        low = self.reference[self.present, 2] - z > self.settings.topple_drop
        return self.present[low | (upright < np.cos(np.radians(self.settings.topple_tilt)))]

    def dropped(self, block: int) -> bool:
        """Whether this block has fallen off the tower."""
        return block in self.fallen()

    def toppled(self, pushed: int | None = None) -> bool:
        """Whether any block other than `pushed` has fallen."""
        return bool(np.any(self.fallen() != (-1 if pushed is None else pushed)))

    @property
    def height(self) -> float:
        """Top of the highest block, m."""
        return float((self.data.geom_xpos[self.core, 2] + self.sizes[self.present, 2] / 2.0).max())

    def layers_above(self, block: int) -> int:
        """Layers above a block, incomplete ones included."""
        return int(self.layer.max() - self.layer[block])

    def is_side(self, block: int) -> bool:
        """Whether a block lies at the side of its layer."""
        return bool(self.place[block] != 1)

    def context(self, block: int) -> np.ndarray:
        """Layers above a block and whether it is a side block, (2,); see `samples.CONTEXT`."""
        return np.array([self.layers_above(block), float(self.is_side(block))])


def _warnings(data: mujoco.MjData) -> dict[str, int]:
    kinds = [kind for kind in mujoco.mjtWarning.__members__.values() if kind != mujoco.mjtWarning.mjNWARNING]
    return {kind.name: data.warning[int(kind)].number for kind in kinds}


__all__ = ["BLOCKS", "LAYERS", "PER_LAYER", "REACHABLE", "Snapshot", "Tower", "TowerError", "draw_sizes"]
