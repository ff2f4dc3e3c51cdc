"""One page with every figure of the run, what it shows, and what was found."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from pathlib import Path

from thesis_lib.foundation.files import write_text
from thesis_lib.report.figure_list import listed_figures
from thesis_lib.report.run import run_report

findings = [Path(path) for path in snakemake.input.findings]
write_text(
    run_report(Path("results"), listed_figures(), findings, snakemake.params.scale), snakemake.output[0]
)
