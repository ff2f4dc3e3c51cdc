"""Evaluate the claims ledger on the results of this run."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_table
from thesis_lib.thesis.ledger.evaluate import evaluate
from thesis_lib.thesis.ledger.format import read_ledger
from thesis_lib.thesis.ledger.reading import read_present
from thesis_lib.thesis.ledger.result import refuse_errors, summary_line, to_table, write_page

results = evaluate(
    read_ledger(Path(snakemake.input.ledger[0]).parent),
    "results",
    read_present(snakemake.input.present),
    snakemake.params.scale,
)
refuse_errors(results)
write_table(to_table(results), snakemake.output.table)
write_page(results, snakemake.output.page, snakemake.params.scale)
print(summary_line(results))
