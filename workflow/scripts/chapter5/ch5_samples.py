"""Samples of the base exploration policy: a training set, or held-out pushes of other towers."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_result
from thesis_lib.jenga.play.settings import SampleChoice, TowerChoice
from thesis_lib.jenga.robot.samples import write_samples
from thesis_lib.jenga.study.collect import collect_named
from thesis_lib.jenga.tower.settings import Setup

params, out = snakemake.params, snakemake.output
samples, attempts = collect_named(
    snakemake.wildcards.name,
    params.most,
    Setup.model_validate(params.setup),
    TowerChoice.model_validate(params.towers),
    SampleChoice.model_validate(params.choice),
    params.seed,
)
write_samples(samples, out.samples)
write_result(attempts, out.attempts)
