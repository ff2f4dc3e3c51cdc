"""m/I from all measured datasets in one table; a row for each that is absent says how to get it."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.thesis.identify.impacts.measured_ratio import gather

table = gather([read_table(path, ["dataset", "ratio"]) for path in snakemake.input], snakemake.params.absent)
write_result(table, snakemake.output[0])
