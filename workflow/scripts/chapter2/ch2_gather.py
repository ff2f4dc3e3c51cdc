"""The same table of several mechanisms, one below the other."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import read_tables, write_result

write_result(read_tables(snakemake.input), snakemake.output[0])
