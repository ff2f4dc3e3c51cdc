"""Errors of learned contact models against the number of training impacts (figures 4-5 and 4-6)."""

from functools import partial
from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.impact_study.study import select_impacts
from thesis_lib.thesis.residual import learning_study as study
from thesis_lib.thesis.residual.settings import LearningStudySettings

params, out, dataset = snakemake.params, snakemake.output, snakemake.wildcards.dataset
settings = LearningStudySettings.model_validate(params.settings)
stream = partial(generator, params.seed, "ch4_learn", dataset)

impacts = read_dataset(Path(snakemake.input.header).parent).stated_impacts()
impacts = select_impacts(impacts, params.filter, settings.max_impacts, stream("select"))
curves, errors = study.learning_curves(impacts, settings, stream("splits"))
write_result(curves, out.curves)
write_result(errors, out.errors)
write_result(study.curve_summary(curves), out.summary)
write_result(study.convergence(curves, settings.within, stream("convergence")), out.convergence)
write_result(study.claim_ratios(curves, settings.base_law, settings.density_size), out.ratios)
