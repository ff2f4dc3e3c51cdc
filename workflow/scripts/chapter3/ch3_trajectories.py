"""Figures 3-5 and 3-6: configurations and energies of one trial."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.files import read_table
from thesis_lib.thesis.figures.chapter3 import trajectories as figures

dataset = read_dataset(snakemake.params.folder)
impacts, arcs = read_table(snakemake.input.impacts), read_table(snakemake.input.arcs)
drawn = {"figure_3_5": figures.figure_3_5(dataset, impacts, arcs), "figure_3_6": figures.figure_3_6(dataset, arcs)}
save_figures(drawn, snakemake.output[0])
