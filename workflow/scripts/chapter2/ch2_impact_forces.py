"""Impulses and peak forces from poses against those of Drake's compliant contact (figure 2-15)."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.figures.chapter2.impact import figure_2_15
from thesis_lib.thesis.identify.impacts import forces as study
from thesis_lib.thesis.identify.impacts.settings import ImpactForces

settings = ImpactForces.model_validate(snakemake.params.settings)
drops = study.drop_ellipses(settings, generator(snakemake.params.seed, "ch2_impact_forces"))
rows, left_out = study.study_impact_forces(drops, settings)
print(f"{len(rows)} rows; left out: {left_out}")
write_result(rows, snakemake.output.impacts)
write_result(study.force_summary(rows), snakemake.output.summary)
shown, history = study.shown_impact(rows, drops, settings)
samples = drops.trajectories
save_figure(*figure_2_15(shown, history, samples, rows, settings), snakemake.output[0])
