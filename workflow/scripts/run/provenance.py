"""Record what made these results (versions, machine, seed, commit, checksums) and what their columns mean."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import column_dictionary, write_json, write_table
from thesis_lib.foundation.provenance import environment, file_sha256, folder_sha256

params = snakemake.params
write_json(
    {
        "scale": params.scale,
        "seed": params.seed,
        "configuration": {
            "used": params.configuration,
            "files": {path.as_posix(): file_sha256(path) for path in Path("config").glob("*.*")},
        },
        "data": {name: folder_sha256(folder) for name, folder in params.sources.items()},
        **environment("environment.txt"),
    },
    snakemake.output.made,
)
tables = Path("results").glob("chapter*/**/*.csv")
write_table(column_dictionary(tables, params.columns), snakemake.output.columns)
