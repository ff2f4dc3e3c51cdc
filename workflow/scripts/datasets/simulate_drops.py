"""Simulate drops and write them as a dataset."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.foundation.files import write_table
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.settings import SimulatedDrops
from thesis_lib.simulate.stepping.drops import simulate_drops

settings = SimulatedDrops.model_validate(snakemake.params.drops)
drops = simulate_drops(
    settings.body,
    settings.release,
    settings.n,
    mu=settings.mu,
    epsilon=settings.epsilon,
    gravity=settings.gravity,
    dt=settings.dt,
    duration=settings.duration,
    rate=settings.rate,
    noise=settings.noise,
    rng=generator(snakemake.params.seed, "simulate_drops"),
)
print(drops.trials["status"].value_counts().to_string())
write_dataset(Dataset("drops", drops.header, drops.trajectories, None), Path(snakemake.output.header).parent)
# the truth lies outside the dataset: whoever reads drops must not see what made them
write_table(drops.impacts, snakemake.output.truth)
write_table(drops.trials, snakemake.output.trials)
