"""Figures 2-1, 2-3 and 2-6 to 2-8: the mechanisms, drawn from their own geometry."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figures
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.simulate.mechanisms.scenes import schematic_poses
from thesis_lib.thesis.figures.chapter2 import schematics as figures

poses = schematic_poses(Chapter2Bodies.model_validate(snakemake.params.bodies))
drawn = {
    "figure_2_1": figures.figure_2_1(*poses["arm"]),
    "figure_2_3": figures.figure_2_3(*poses["polygon"]),
    "figure_2_6": figures.figure_2_6(*poses["block"]),
    "figure_2_7": figures.figure_2_7(*poses["ellipse"]),
    "figure_2_8": figures.figure_2_8(*poses["wheel"]),
}
save_figures(drawn, snakemake.output[0])
