"""One training of PPO whose checkpoints become files; an interrupted one goes on from the segments beside them.

The segments (`segments/ppo_<samples>.pt`) are no results: a pipeline that deletes the results of a job that failed
leaves them alone.
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
    """Train once through all `sizes` (samples) and put the policy at each into its path; errors as of `train_ppo`."""
    segments = Path(paths[0]).with_name("segments")
    train_ppo(sizes, settings, seed, setup=setup, folder=segments, say=say)
    for size, path in zip(sizes, paths):
        with atomic(path) as tmp:
            shutil.copyfile(segments / f"ppo_{size}.pt", tmp)
