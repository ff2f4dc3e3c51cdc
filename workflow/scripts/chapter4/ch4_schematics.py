"""Figures 4-1 and 4-2: a body on the surface with its energy ellipse, and the ellipsoid of wrenches."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.bodies.body import Body
from thesis_lib.figures.style import save_figures
from thesis_lib.thesis.figures.chapter4.ellipsoid import figure_4_1, figure_4_2

body = Body.model_validate(snakemake.params.body)
save_figures({"figure_4_1": figure_4_1(body), "figure_4_2": figure_4_2(body)}, snakemake.output[0])
