"""PPO on pushes, with checkpoints at given numbers of samples."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

import shutil
from pathlib import Path

from thesis_lib.jenga.ppo import train_ppo
from thesis_lib.jenga.ppo_settings import PpoSettings
from thesis_lib.jenga.settings import Setup

params = snakemake.params
# not an output: an interrupted training goes on from the segments that it finds there
segments = Path(snakemake.output[0]).with_name("segments")
train_ppo(
    params.sizes,
    PpoSettings.model_validate(params.ppo),
    params.seed,
    setup=Setup.model_validate(params.setup),
    folder=segments,
    say=print,
)
for size, path in zip(params.sizes, snakemake.output):
    shutil.copyfile(segments / f"ppo_{size}.pt", path)
