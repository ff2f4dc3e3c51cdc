"""Whether a tower may be used: it has the height of its blocks, is at rest, and the solver converged.

A tower that exploded gives data that look ordinary (hardly any force, nearly every block movable), so every tower is
checked before and after use.  The top of a layer lies between its second-highest and highest block, so the height H of
the tower satisfies Σ h_(2) − s ≤ H ≤ Σ h_(3) + s, with s for the elastic sinking.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.jenga.tower.settings import HealthSettings, Setup
from thesis_lib.jenga.tower.tower import BLOCKS, LAYERS, PER_LAYER, Tower, TowerError


@dataclass(frozen=True)
class Health:
    """Results: height with its allowed range (m), median drift of blocks (m/s), most solver iterations of a step."""

    seed: int
    height: float
    lowest: float
    highest: float
    drift: float
    iterations: int


def settled_tower(seed: int, setup: Setup) -> Tower:
    """The tower of a seed, at rest and checked; TowerError if a check fails."""
    tower = Tower(seed, setup.tower, setup.robot).settle()
    check(tower, setup.health)
    return tower


def height_range(tower: Tower, settings: HealthSettings) -> tuple[float, float]:
    """Lowest and highest possible top of a standing tower of these blocks, m."""
    heights = np.sort(tower.sizes[:, 2].reshape(LAYERS, PER_LAYER), axis=1)
    return heights[:, -2].sum() - settings.sinking, heights[:, -1].sum() + settings.sinking


def check(tower: Tower, settings: HealthSettings | None = None) -> Health:
    """Check a freshly settled tower, whose state is restored afterwards.

    Raises:
        TowerError: with the seed, the defect and the remedy.
    """
    settings = settings or HealthSettings()
    check_standing(tower)
    lowest, highest = height_range(tower, settings)
    name = f"tower {tower.seed}"
    if not lowest <= tower.height <= highest:
        raise TowerError(
            f"{name} is {1e3 * tower.height:.1f} mm high after settling, not {1e3 * lowest:.1f} to "
            f"{1e3 * highest:.1f}: it exploded or collapsed. Use a time step of at most 2 ms and "
            "200 solver iterations, or leave this seed out."
        )
    before, start = tower.save(), tower.poses()
    tower.simulate(settings.drift_time)
    speeds = np.linalg.norm((tower.poses() - start)[:, :3], axis=1) / settings.drift_time
    iterations = tower.iterations_needed
    tower.load(before)
    drift = float(np.median(speeds))
    if not drift < settings.drift:
        raise TowerError(
            f"{name} does not rest: its blocks drift by {1e6 * drift:.1f} µm/s (median), allowed "
            f"{1e6 * settings.drift:.1f}. Settle it longer (`settling`)."
        )
    return Health(tower.seed, tower.height, lowest, highest, drift, iterations)


def check_standing(tower: Tower, handled: int | None = None) -> None:
    """Refuse a tower that lacks blocks, or from which one other than `handled` has fallen: TowerError as in `check`."""
    name = f"tower {tower.seed}"
    if len(tower.present) != BLOCKS:
        raise TowerError(
            f"{name} has {len(tower.present)} blocks, not {BLOCKS}: it is not whole. Build it anew from its seed."
        )
    if not np.isfinite(tower.data.qpos).all():
        raise TowerError(f"{name} exploded: a pose is not a number. Use a shorter time step.")
    if tower.toppled(handled):
        fallen = ", ".join(str(block) for block in tower.fallen()[:5])
        raise TowerError(f"{name} has toppled (fallen: block {fallen}): start again from a settled tower.")
    if tower.iterations_needed >= tower.settings.iterations:
        raise TowerError(f"{name}: the contact solver reached its cap; raise `iterations` of the tower's settings.")
