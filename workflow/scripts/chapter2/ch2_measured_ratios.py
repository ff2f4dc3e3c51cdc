"""m/I from all measured datasets in one table; a row for each that is absent says how to get it."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.thesis.identify.impacts.measured_ratio import gather

table = gather([read_table(path, ["dataset", "ratio"]) for path in snakemake.input], snakemake.params.absent)
write_result(table, snakemake.output[0])
