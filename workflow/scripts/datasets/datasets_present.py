"""Write which datasets this run has; the claims ledger reads it."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_json

write_json(snakemake.params.present, snakemake.output[0])
