"""One page with the main findings of the run."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_text
from thesis_lib.thesis.records.catalogue import records
from thesis_lib.thesis.report.run import run_report

findings, out = [Path(path) for path in snakemake.input.findings], snakemake.output
write_text(run_report(Path("results"), findings, snakemake.params.scale, snakemake.params.absent), out.page)
for record in records().values():
    write_text(record.report_caption(), Path(out.captions, f"{record.name}.rst"))
