"""Convert a published measured dataset, after its checksums are verified, into our format."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.sources.published import convert_published

convert_published(snakemake.wildcards.dataset, snakemake.params.source, Path(snakemake.output[0]).parent, note=print)
