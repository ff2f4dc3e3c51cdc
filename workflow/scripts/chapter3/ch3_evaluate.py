"""Held-out errors of every law and bound, tables 3.1 and 3.2, and the checks of the chapter's statements."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.thesis.impact_study import study, tables
from thesis_lib.thesis.impact_study.energy import energy_statements
from thesis_lib.thesis.impact_study.statements import statements

source, out = snakemake.input, snakemake.output
dataset = read_dataset(Path(source.header).parent)
impacts = dataset.stated_impacts()
ensemble, individual = read_table(source.ensemble), read_table(source.individual)
split, topography = read_table(source.split), read_table(source.topography)
convergence = read_table(source.convergence)

errors = {w: study.held_out_errors(impacts, split, ensemble, w) for w in ("kinetic", "unweighted")}
write_result(errors["kinetic"], out.errors)
write_result(tables.error_summary(errors["kinetic"]), out.summary)
write_result(tables.table_3_1(ensemble, errors), out.table_3_1)
tolerances = snakemake.params.settings["range_tolerances"]
write_result(tables.table_3_2(individual, tolerances, impacts.mass), out.table_3_2)
write_result(study.coverage_table(study.pick(impacts, split), study.ALL_LAWS), out.coverage)
energy = energy_statements(dataset, impacts)
judged = impacts, split, ensemble, individual, errors["kinetic"], topography, convergence, min(tolerances)
left_out = read_table(source.left_out) if dataset.rate is not None else None  # None: published as impacts
said = statements(*judged, energy, left_out)
write_result(said, out.statements)
