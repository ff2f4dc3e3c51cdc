"""Figures 3-7 to 3-11 of one dataset, in the kinetic weighting of equation 3.7."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.files import read_table
from thesis_lib.thesis.figures.chapter3.contact_space import figure_3_11
from thesis_lib.thesis.figures.chapter3.errors import figure_3_8, figure_3_9
from thesis_lib.thesis.figures.chapter3.identification import figure_3_7, figure_3_10
from thesis_lib.thesis.impact_study.statements import MAPPED, STUDIED
from thesis_lib.thesis.impact_study.study import pick

source = snakemake.input
dataset = read_dataset(Path(source.header).parent)
impacts, split = dataset.stated_impacts(), read_table(source.split)
errors = read_table(source.errors)
ensemble, individual = (
    table[table["weighting"] == "kinetic"] for table in (read_table(source.ensemble), read_table(source.individual))
)
topography, convergence = read_table(source.topography), read_table(source.convergence)
# two laws, as far as the eye can tell lines apart: the one of the topography and the one of figure 3-10
followed = convergence[convergence["law"].isin([topography["law"].iloc[0], STUDIED])]
known = {"mass_known": dataset.mass is not None}
drawn = {
    "figure_3_7": figure_3_7(topography, followed, **known),
    "figure_3_8": figure_3_8(errors),
    "figure_3_9": figure_3_9(pick(impacts, split, train=0), errors, MAPPED, **known),
    "figure_3_10": figure_3_10(individual, ensemble, STUDIED, **known),
    "figure_3_11": figure_3_11(pick(impacts, split), individual, ensemble, STUDIED, **known),
}
save_figures(drawn, snakemake.output[0])
