"""The same table of several mechanisms, one below the other."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.foundation.files import read_tables, write_result

write_result(read_tables(snakemake.input), snakemake.output[0])
