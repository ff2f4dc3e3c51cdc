"""Recount the best and worst columns of table 3.1 from the stored predictions, and compare our laws with them."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.impact_study import stored_predictions as stored
from thesis_lib.thesis.impact_study.stored_predictions import first_drops, first_kept

impacts = read_dataset(Path(snakemake.input.header).parent).stated_impacts()
rng = generator(snakemake.params.seed, "ch3_published", "select")
chosen = impacts.sample(snakemake.params.max_impacts, rng)
folder, out = Path(snakemake.params.folder), snakemake.output
predictions = read_table(folder / "published_predictions.csv")
write_result(stored.best_worst(predictions), out.best_worst)
write_result(stored.agreement(impacts, predictions), out.agreement)
write_result(stored.cost_at_published(chosen), out.cost)
write_result(stored.parameters(chosen, snakemake.params.seed), out.parameters)
all_drops = read_table(folder / "all_drops.csv")
write_result(stored.drops_kept(all_drops), out.kept)
rng = generator(snakemake.params.seed, "ch3_published", "subsets")
write_result(first_drops(impacts, first_kept(all_drops), snakemake.params.subsets, rng), out.first_drops)
