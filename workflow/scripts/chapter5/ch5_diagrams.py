"""Figures 5-2, 5-3, 5-4B and 5-5C: diagrams."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figures
from thesis_lib.thesis.figures.chapter5 import schematics

names = ("figure_5_2", "figure_5_3", "figure_5_4", "figure_5_5c")
save_figures({name: getattr(schematics, name)() for name in names}, snakemake.output[0])
