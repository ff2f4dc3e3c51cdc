"""Write which datasets this run has; the claims ledger reads it."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.foundation.files import write_json

write_json(snakemake.params.present, snakemake.output[0])
