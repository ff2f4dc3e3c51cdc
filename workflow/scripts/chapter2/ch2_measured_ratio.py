"""m/I from one measured dataset, as published and with its possible measurement faults."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.figures.chapter2.impact import figure_measured_ratio
from thesis_lib.thesis.identify.impacts.measured_ratio import measured_ratio
from thesis_lib.thesis.identify.impacts.settings import MeasuredRatio

params, found = snakemake.params, snakemake.input
rng = generator(params.seed, "ch2_measured_ratio", snakemake.wildcards.dataset)
settings = MeasuredRatio.model_validate(params.settings)
left_out = len(read_table(found.left_out))
table = measured_ratio(read_dataset(Path(found.header).parent), rng, settings, left_out)
print(table.to_string())
write_result(table, snakemake.output.table)
save_figure(*figure_measured_ratio(table), snakemake.output[0])
