"""Tables and pictures of the stored proof, and a rerun of a few of its datasets: the answers must agree."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.files import write_result
from thesis_lib.studies.figures.pictures import pictures
from thesis_lib.studies.proof.check import rerun
from thesis_lib.studies.proof.results import outcomes, recovered
from thesis_lib.studies.proof.summary import report

store, written = Path(snakemake.params.store), Path(snakemake.output.summary)
print(report(store, written.parent))
save_figures(pictures(outcomes(store), recovered(store)), written)
write_result(rerun(snakemake.params.cases, store), snakemake.output.rerun)
