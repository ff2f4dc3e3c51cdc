"""Impulses and peak forces from poses against those of Drake's compliant contact (figure 2-15)."""

import sys

sys.stdout = sys.stderr = open(snakemake.log[0], "w", buffering=1)  # noqa: SIM115, PTH123

from pathlib import Path

from thesis_lib.columns import write_result
from thesis_lib.critique import impact_forces as study
from thesis_lib.critique.impact_settings import ImpactForces
from thesis_lib.figures.chapter2_impact import figure_2_15
from thesis_lib.figures.style import save_figure
from thesis_lib.randomness import generator

settings = ImpactForces.model_validate(snakemake.params.settings)
drops = study.drop_ellipses(settings, generator(snakemake.params.seed, "ch2_impact_forces"))
rows, left_out = study.study_impact_forces(drops, settings)
print(f"{len(rows)} rows; left out: {left_out}")
write_result(rows, snakemake.output.impacts)
write_result(study.force_summary(rows), snakemake.output.summary)
shown, history = study.shown_impact(rows, drops, settings)
samples = drops.trajectories
save_figure(*figure_2_15(shown, history, samples, rows, settings), Path(snakemake.output[0]).with_suffix(""))
