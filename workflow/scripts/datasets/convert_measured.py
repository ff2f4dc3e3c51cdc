"""Convert a published measured dataset, after its checksums are verified, into our format."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from pathlib import Path

from thesis_lib.datasets.sources.published import convert_published

convert_published(snakemake.wildcards.dataset, snakemake.params.source, Path(snakemake.output[0]).parent, note=print)
