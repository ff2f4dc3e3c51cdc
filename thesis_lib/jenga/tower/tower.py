"""Simulation in MuJoCo of a tower of 54 blocks of unequal height, with checks that the tower can be used.

Heights are h_b = h + δ_b, δ_b ~ N(0, σ_h²) cut off at 2.5 σ_h, drawn from the tower's seed: the only cause of loose and
stuck blocks.  Blocks are numbered 3 layer + place, from the bottom; 0 to 44 are reachable (thesis: the last three
layers are not).  Blocks of even layers lie along x, of odd layers along y; place 1 is the middle.

A tower that exploded gives data that look normal (hardly any force, nearly every block movable), so every tower is
checked before and after use.  The top of a layer lies between its second-highest and highest block, so the height H of
the tower satisfies Σ h_(2) − s ≤ H ≤ Σ h_(3) + s, with s for the elastic sinking.

The reduced tower is a fast variant for a push in layer l: layers below l − 1 are fixed, layers l − 1 to l + 1 are free,
and all above form one rigid body of the same mass on its own feet.  Forces agree with the full tower; displacements of
the tower agree less well, because the upper layers cannot shear, so it must not be used to count extractions.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import mujoco
import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.tower.settings import HealthSettings, RobotSettings, Setup, TowerSettings
from thesis_lib.jenga.tower.tower_model import BLOCKS, HAND, LAYERS, PARKED, PER_LAYER, TIP, stacked, tower_xml
from thesis_lib.mechanics.space import rotation_matrix

REACHABLE = np.arange(BLOCKS - 3 * PER_LAYER)
STATE_KIND = mujoco.mjtState.mjSTATE_INTEGRATION
SHAKEN = 25  # time steps until the contact forces of a reduced tower are re-established


class TowerError(UserError):
    """A tower that cannot be used: it exploded, toppled, never came to rest, or the solver gave up."""


@dataclass(frozen=True)
class Snapshot:
    """State from which a run can continue: MuJoCo's integration state; layer, place and reference of each block."""

    state: np.ndarray
    layer: np.ndarray
    place: np.ndarray
    reference: np.ndarray


def draw_sizes(settings: TowerSettings, seed: int) -> np.ndarray:
    """Random length, width and height of the blocks of tower `seed`; (54, 3), m."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(5,)))
    normal = rng.standard_normal((BLOCKS, 3))
    while (far := np.abs(normal) > settings.clip).any():
        normal[far] = rng.standard_normal(far.sum())
    spread = (settings.length_tolerance, settings.width_tolerance, settings.height_tolerance)
    return np.asarray(settings.block) + normal * spread


class Tower:
    """One tower with the robot's bodies beside it; call `settle` before use.

    seed: of the heights, also quoted in messages.  model, data: MuJoCo's.  core: (54,) int, MuJoCo's ids of the blocks'
    boxes.  sizes: (54, 3), m.  layer, place: (54,) int, present place of each block (layer 18 and up: put on top).
    reference: (54, 7), poses relative to which falls are judged, set by `settle` to the settled ones.
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
        """Place blocks at `poses` (default: stacked), `kinds` as in `tower_xml`; TowerError if the model is invalid."""
        self.seed = seed
        self.settings = settings or TowerSettings()
        self.robot_settings = robot or RobotSettings()
        self.sizes = draw_sizes(self.settings, seed) if sizes is None else sizes
        start = stacked(self.sizes, self.settings) if poses is None else poses
        xml = tower_xml(self.sizes, start, self.settings, self.robot_settings, **kinds)
        try:
            self.model = mujoco.MjModel.from_xml_string(xml)
        except ValueError as error:
            raise TowerError(f"tower {seed}: MuJoCo refuses the model ({error}); check the tower's settings.") from None
        self.data = mujoco.MjData(self.model)
        self.core = np.array([self.model.geom(f"core{block}").id for block in range(BLOCKS)])
        self.layer = np.arange(BLOCKS) // PER_LAYER
        self.place = np.arange(BLOCKS) % PER_LAYER
        self.iterations_needed = 0
        self.set_joints(TIP + HAND[:3], (*PARKED, *PARKED))
        mujoco.mj_forward(self.model, self.data)
        self.reference = self.poses()

    def set_joints(self, names: Iterable[str], values: Iterable[float]) -> None:
        """Set positions of robot joints (m or rad), at rest, and the targets of their drives."""
        for name, value in zip(names, values):
            self.data.joint(name).qpos[0] = self.data.actuator(name).ctrl[0] = value
            self.data.joint(name).qvel[0] = 0.0

    def drives(self, names: Iterable[str]) -> list[int]:
        """Return the indices of the drives of robot joints."""
        return [self.model.actuator(name).id for name in names]

    def step(self, n: int = 1) -> None:
        """Advance `n` time steps; TowerError if the state is not finite or the solver reached its iteration limit."""
        data = self.data
        for _ in range(n):
            mujoco.mj_step(self.model, data)
            self.iterations_needed = max(self.iterations_needed, int(data.solver_niter.max()))
            if self.iterations_needed >= self.settings.iterations:
                self._check_numbers()
                raise TowerError(
                    f"tower {self.seed}: the contact solver reached its limit of {self.settings.iterations} iterations "
                    f"at {data.time:.3f} s, so its forces are wrong. Raise `iterations` in the tower's settings."
                )
        self._check_numbers()

    def _check_numbers(self) -> None:
        warned = self.data.warning.number
        if warned.any() or not np.isfinite(self.data.qpos).all():
            names = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(warned)]
            raise TowerError(
                f"tower {self.seed}: the simulation broke down at t = {self.data.time:.3f} s "
                f"({', '.join(names) or 'NaN'}). The tower exploded: use a shorter time step."
            )

    def simulate(self, seconds: float) -> None:
        """Advance by a time in s.  Errors as in `step`."""
        self.step(max(1, round(seconds / self.settings.timestep)))

    def settle(self) -> "Tower":
        """Let the tower come to rest and make its poses the `reference`.  Errors as in `step`."""
        model, undamped = self.model, self.model.dof_damping.copy()
        free = model.jnt_dofadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        for dof in range(6):
            # (23 mm)² is roughly a block's inertia over its mass
            model.dof_damping[free + dof] = self.settings.settling_damping * (1.0 if dof < 3 else 23e-3**2)
        self.simulate(self.settings.settling * 2.0 / 3.0)
        model.dof_damping[:] = undamped
        self.simulate(self.settings.settling / 3.0)
        self.reference = self.poses()
        return self

    def save(self) -> Snapshot:
        """Return the present state, from which `load` continues exactly."""
        state = np.empty(mujoco.mj_stateSize(self.model, STATE_KIND))
        mujoco.mj_getState(self.model, self.data, state, STATE_KIND)
        return Snapshot(state, self.layer.copy(), self.place.copy(), self.reference.copy())

    def load(self, snapshot: Snapshot) -> None:
        """Return to a snapshot of this tower."""
        mujoco.mj_setState(self.model, self.data, snapshot.state, STATE_KIND)
        mujoco.mj_forward(self.model, self.data)
        # mj_forward changes the solver's warm start; without this reset a continued run would differ in the last bits
        mujoco.mj_setState(self.model, self.data, snapshot.state, STATE_KIND)
        self.layer, self.place = snapshot.layer.copy(), snapshot.place.copy()
        self.reference = snapshot.reference.copy()

    def poses(self) -> np.ndarray:
        """Return the poses of the blocks, (54, 7): m, unit quaternions."""
        poses, quaternion = np.empty((BLOCKS, 7)), np.empty(4)
        poses[:, :3] = self.data.geom_xpos[self.core]
        for block, geom in enumerate(self.core):
            mujoco.mju_mat2Quat(quaternion, self.data.geom_xmat[geom])
            poses[block, 3:] = quaternion
        return poses

    def position(self, block: int) -> np.ndarray:
        """Return the centre of a block, (3,), m."""
        return self.data.geom_xpos[self.core[block]].copy()

    def matrix(self, block: int) -> np.ndarray:
        """Return the rotation matrix of a block, (3, 3)."""
        return self.data.geom_xmat[self.core[block]].reshape(3, 3).copy()

    def perturbation(self, block: int, since: np.ndarray | None = None) -> tuple[float, float]:
        """Largest displacement (m) and rotation (rad) of other blocks from poses (54, 7), by default `reference`."""
        others = np.arange(BLOCKS) != block
        before, rows = (self.reference if since is None else since)[others], self.core[others]
        distance = np.linalg.norm(self.data.geom_xpos[rows] - before[:, :3], axis=1).max()
        # trace of the product of rotations is 1 + 2 cos(angle)
        trace = np.einsum("nij,ijn->n", self.data.geom_xmat[rows].reshape(-1, 3, 3), rotation_matrix(before[:, 3:].T))
        return float(distance), float(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)).max())

    def fallen(self) -> np.ndarray:
        """Numbers of the fallen blocks, which lie more than `topple_drop` below `reference` or are tilted."""
        z = self.data.geom_xpos[self.core, 2]
        upright = self.data.geom_xmat[self.core, 8]
        low = self.reference[:, 2] - z > self.settings.topple_drop
        return np.flatnonzero(low | (upright < np.cos(np.radians(self.settings.topple_tilt))))

    def toppled(self, pushed: int | None = None) -> bool:
        """Whether any block other than `pushed` has fallen."""
        return bool(np.any(self.fallen() != (-1 if pushed is None else pushed)))

    def collapsed(self) -> bool:
        """Whether the simulation broke down during a collapse, which may be too violent for the solver."""
        return bool(np.isfinite(self.data.qpos).all() and self.fallen().size)

    @property
    def height(self) -> float:
        """Top of the highest block, m."""
        return float((self.data.geom_xpos[self.core, 2] + self.sizes[:, 2] / 2.0).max())

    def is_side(self, block: int) -> bool:
        """Whether a block lies at the side of its layer."""
        return bool(self.place[block] != 1)

    def context(self, block: int) -> np.ndarray:
        """Layers above a block, incomplete ones included, and whether it is a side block (1) or not (0), (2,)."""
        return np.array([float(self.layer.max() - self.layer[block]), float(self.is_side(block))])


def settled_tower(seed: int, setup: Setup) -> Tower:
    """Return the tower of a seed, at rest and checked; TowerError if a check fails."""
    tower = Tower(seed, setup.tower, setup.robot).settle()
    check(tower, setup.health)
    return tower


def check(tower: Tower, settings: HealthSettings) -> None:
    """Check a freshly settled tower, restoring its state; TowerError if it must not be used."""
    check_standing(tower)
    heights = np.sort(tower.sizes[:, 2].reshape(LAYERS, PER_LAYER), axis=1)
    lowest, highest = heights[:, -2].sum() - settings.sinking, heights[:, -1].sum() + settings.sinking
    if not lowest <= tower.height <= highest:
        raise TowerError(
            f"tower {tower.seed} is {1e3 * tower.height:.1f} mm high after settling, not {1e3 * lowest:.1f} to "
            f"{1e3 * highest:.1f}: it exploded or collapsed. Use a time step of at most 2 ms and "
            "200 solver iterations, or omit this seed."
        )
    before, start = tower.save(), tower.poses()
    tower.simulate(settings.drift_time)
    drift = np.median(np.linalg.norm((tower.poses() - start)[:, :3], axis=1) / settings.drift_time)
    tower.load(before)
    if not drift < settings.drift:
        raise TowerError(
            f"tower {tower.seed} is not at rest: its blocks drift by {1e6 * drift:.1f} µm/s (median), allowed "
            f"{1e6 * settings.drift:.1f}. Settle it longer (`settling`)."
        )


def check_standing(tower: Tower) -> None:
    """Raise TowerError if a block of the tower has fallen."""
    if tower.toppled():
        fallen = ", ".join(str(block) for block in tower.fallen()[:5])
        raise TowerError(f"tower {tower.seed} has toppled (fallen: block {fallen}): start again from a settled tower.")


def reduce(tower: Tower, block: int) -> Tower:
    """Return the reduced tower for a push of `block`, from the present full tower and with its reference for falls.

    The full tower is left unchanged.  Errors as in `Tower.step`.
    """
    blocks, layer = np.arange(BLOCKS), tower.layer
    below = frozenset(blocks[layer < layer[block] - 1].tolist())
    above = frozenset(blocks[layer > layer[block] + 1].tolist())
    start = {"sizes": tower.sizes, "poses": tower.poses(), "static": below, "lump": above}
    reduced = Tower(tower.seed, tower.settings, tower.robot_settings, **start)
    reduced.layer, reduced.place = tower.layer.copy(), tower.place.copy()
    reduced.step(SHAKEN)
    reduced.reference = tower.reference.copy()
    return reduced
