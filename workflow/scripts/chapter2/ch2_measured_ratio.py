"""m/I from one measured dataset, as published and with its possible measurement faults."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.identify.impacts.measured_ratio import measured_ratio
from thesis_lib.identify.impacts.settings import MeasuredRatio

params = snakemake.params
rng = generator(params.seed, "ch2_measured_ratio", snakemake.wildcards.dataset)
settings = MeasuredRatio.model_validate(params.settings)
table = measured_ratio(read_dataset(params.folder), rng, settings)
print(table.to_string())
write_result(table, snakemake.output[0])
