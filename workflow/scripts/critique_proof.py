"""Confusion table of the stored proof, and a rerun of a few of its datasets: their verdicts must agree."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from pathlib import Path

from thesis_lib.columns import write_result
from thesis_lib.critique.proof_table import confusion, rerun

write_result(confusion(Path(snakemake.params.store)), snakemake.output.confusion)
write_result(rerun(snakemake.params.cases, Path(snakemake.params.store)), snakemake.output.agreement)
