"""Figures 4-5 and 4-6: error densities of learned models, and errors against training impacts."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.files import read_table
from thesis_lib.thesis.figures.chapter4.errors import figure_4_5, figure_4_6

law = snakemake.params.law
errors = read_table(snakemake.input.errors, ["model", "error", "n"])
summary = read_table(snakemake.input.summary, ["model", "n", "mean", "low", "high"])
drawn = {"figure_4_5": figure_4_5(errors, law), "figure_4_6": figure_4_6(summary, law)}
save_figures(drawn, snakemake.output[0])
