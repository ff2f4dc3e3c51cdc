"""What figures and tables show, in sentences with this run's numbers."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.findings.catalogue import FINDINGS
from thesis_lib.findings.finding import write_findings

write_findings(FINDINGS, snakemake.output)
