"""One page with the figures of one chapter, what they show, and what was found."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_text
from thesis_lib.thesis.report.run import chapter_report

findings, chapter = [Path(path) for path in snakemake.input.findings], int(snakemake.wildcards.chapter)
params = snakemake.params
write_text(chapter_report(Path("results"), findings, params.scale, params.absent, chapter=chapter), snakemake.output[0])
