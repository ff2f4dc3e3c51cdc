"""Access to Snakemake's job object from a script of the pipeline; redirects all output of the script to its log.

Scripts import this first, so that failing imports are logged as well.
"""

import sys
from typing import Any

import __main__

snakemake: Any = __main__.snakemake  # Snakemake inserts it at the beginning of the script that it runs
sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123
