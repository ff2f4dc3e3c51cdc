"""Every reachable block of one tower is pushed a little: which are movable."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_result
from thesis_lib.jenga.study.tower_study import scan_tower
from thesis_lib.jenga.tower.settings import Setup

params = snakemake.params
setup = Setup.model_validate(params.setup)
seed = int(snakemake.wildcards.tower)
write_result(scan_tower(seed, params.scanned, setup, say=print), snakemake.output[0])
