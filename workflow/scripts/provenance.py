"""Record what made these results: versions, platform, seed, commit, and checksums of the measured data."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from thesis_lib.files import write_json
from thesis_lib.provenance import environment, folder_sha256

params = snakemake.params
write_json(
    {
        "scale": params.scale,
        "seed": params.seed,
        "data": {name: folder_sha256(folder) for name, folder in params.sources.items()},
        **environment("environment.txt"),
    },
    snakemake.output[0],
)
