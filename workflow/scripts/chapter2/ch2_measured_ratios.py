"""m/I from all measured datasets, in one table and one figure; those that are not there say so."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from pathlib import Path

from thesis_lib.figures.chapter2.impact import figure_measured_ratio
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.identify.impacts.measured_ratio import gather

table = gather([read_table(path, ["dataset", "ratio"]) for path in snakemake.input], snakemake.params.absent)
write_result(table, snakemake.output.table)
save_figure(*figure_measured_ratio(table), Path(snakemake.output[0]).with_suffix(""))
