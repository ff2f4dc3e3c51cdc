"""What figures and tables show, in sentences with this run's numbers."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.thesis.records.catalogue import write_findings

write_findings(snakemake.output)
