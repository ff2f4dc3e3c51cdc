"""Ensemble and individual parameters of every law, convergence and cost topography."""

from functools import partial
from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.impact_study import study
from thesis_lib.thesis.impact_study.settings import Chapter3

settings = Chapter3.model_validate(snakemake.params.settings)
dataset, out = snakemake.wildcards.dataset, snakemake.output
stream = partial(generator, snakemake.params.seed, "ch3_identify", dataset)

impacts = read_dataset(Path(snakemake.input.header).parent).stated_impacts()
impacts = study.select_impacts(impacts, settings.filter, settings.max_impacts, stream("select"))
train = study.split_trials(impacts.trial, settings.train_share, stream("split"))
training = impacts.select(train)
print(f"{len(impacts)} impacts, {train.sum()} for training")
write_result(study.split_table(impacts, train), out.split)

both = ("kinetic", "unweighted")
ensemble = study.ensemble_table(training, study.ALL_LAWS, both, settings.bootstrap, stream("bootstrap"))
write_result(ensemble, out.ensemble)
c = settings.convergence
convergence = study.convergence_table(training, c.laws, c.sizes, c.subsets, stream("convergence"))
write_result(convergence, out.convergence)
g = settings.topography
topography = study.topography_table(training, g.law, g.n, *g.axes(), stream("topography"))
write_result(topography, out.topography)
write_result(study.individual_table(impacts, study.ALL_LAWS, both), out.individual)
