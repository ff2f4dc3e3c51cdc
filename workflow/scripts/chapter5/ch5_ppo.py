"""PPO on pushes, with checkpoints at given numbers of samples."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.jenga.play.ppo import train_ppo, write_policy
from thesis_lib.jenga.play.settings import PpoSettings
from thesis_lib.jenga.tower.settings import Setup

params = snakemake.params
settings, setup = PpoSettings.model_validate(params.ppo), Setup.model_validate(params.setup)
policies = train_ppo(params.sizes, settings, params.seed, setup=setup, say=print)
for size, path in zip(params.sizes, snakemake.output):
    write_policy(policies[size], path)
