"""What figures and tables show, in sentences with this run's numbers."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.thesis.records.catalogue import write_findings

write_findings(snakemake.output)
