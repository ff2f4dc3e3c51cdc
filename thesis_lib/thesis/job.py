"""What Snakemake hands to a script of the pipeline; all that the script says goes into its log from here on.

Scripts import this before anything heavy, so that an import that fails is in the log, too.
"""

import sys
from typing import Any

import __main__

snakemake: Any = __main__.snakemake  # Snakemake puts it at the head of the script that it runs
sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123
