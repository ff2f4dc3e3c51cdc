"""Figures 3-1 to 3-3: the body on the surface, the energy ellipse, the regions of the laws."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.bodies.body import Body
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.files import read_table
from thesis_lib.thesis.figures.chapter3 import contact_space as figures

body = Body.model_validate(snakemake.params.body)
coverage = read_table(snakemake.input.coverage, ["law", "share"])
drawn = {
    "figure_3_1": figures.figure_3_1(body),
    "figure_3_2": figures.figure_3_2(body),
    "figure_3_3": figures.figure_3_3(body, coverage),
}
save_figures(drawn, snakemake.output[0])
