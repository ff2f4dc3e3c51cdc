"""Samples of the base exploration policy: a training set, or held-out pushes of other towers."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.columns import write_result
from thesis_lib.jenga.collect import collect_named
from thesis_lib.jenga.samples import write_samples
from thesis_lib.jenga.settings import Setup
from thesis_lib.jenga.study_settings import SampleChoice, TowerChoice

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
