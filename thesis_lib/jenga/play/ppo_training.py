"""One training of PPO, with a file per checkpoint; an interrupted training continues from the segments beside them.

The segments (`segments/ppo_<samples>.pt`) are not declared results, so a pipeline that deletes the results of a failed
job keeps them.
"""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from thesis_lib.foundation.files import atomic
from thesis_lib.jenga.play.ppo import train_ppo
from thesis_lib.jenga.play.ppo_settings import PpoSettings
from thesis_lib.jenga.tower.settings import Setup


def train_to_files(
    sizes: Sequence[int],
    paths: Sequence[str | Path],
    settings: PpoSettings,
    setup: Setup,
    seed: int,
    say: Callable[[str], None] | None = None,
) -> None:
    """Train once through all `sizes` (samples) and write the policy at each to its path.  Errors as in `train_ppo`."""
    segments = Path(paths[0]).with_name("segments")
    train_ppo(sizes, settings, seed, setup=setup, folder=segments, say=say)
    for size, path in zip(sizes, paths):
        with atomic(path) as tmp:
            shutil.copyfile(segments / f"ppo_{size}.pt", tmp)
