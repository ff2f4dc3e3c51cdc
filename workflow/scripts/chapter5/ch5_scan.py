"""Every reachable block of one tower is pushed a little: which are movable."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.foundation.files import write_result
from thesis_lib.jenga.study.tower_study import scan_tower
from thesis_lib.jenga.tower.settings import Setup

params = snakemake.params
setup = Setup.model_validate(params.setup)
seed = int(snakemake.wildcards.tower)
write_result(scan_tower(seed, params.scanned, setup, say=print), snakemake.output[0])
