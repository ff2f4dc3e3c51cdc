"""Figures 2-2, 2-4, 2-5, 2-9 and 2-14: motions from flight to contact, and what they show."""

from functools import partial

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.mechanisms import scenes
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.thesis.figures.chapter2 import motions as figures
from thesis_lib.thesis.identify.base_parameters.excitation_table import landings
from thesis_lib.thesis.identify.base_parameters.projection import project_motion

bodies = Chapter2Bodies.model_validate(snakemake.params.bodies)
chosen = scenes.SceneSettings.model_validate(snakemake.params.scenes)
stream = partial(generator, snakemake.params.seed, "ch2_motions")

disk = scenes.landing_disk(stream("disk"), bodies, chosen)
block = scenes.tipping_block(stream("block"), bodies, chosen)
drawn = {
    "figure_2_2": figures.figure_2_2(scenes.falling_rod(bodies, chosen)),
    "figure_2_4": figures.figure_2_4(disk),
    "figure_2_5": figures.figure_2_5(block, project_motion(block), landings(bodies)),
    "figure_2_9": figures.figure_2_9(scenes.traces(stream("traces"), bodies, chosen)),
    "figure_2_14": figures.figure_2_14(read_dataset(snakemake.params.drops)),
}
save_figures(drawn, snakemake.output[0])
