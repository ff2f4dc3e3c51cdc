"""Contact forces of the rimless wheel's spokes, and its motion against its mass (figures 2-10 and 2-11)."""

from functools import partial

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.thesis.figures.chapter2.forces import figure_2_10, figure_2_11
from thesis_lib.thesis.identify.settings import WheelStudy
from thesis_lib.thesis.identify.wheel import study

settings = WheelStudy.model_validate(snakemake.params.settings)
bodies = Chapter2Bodies.model_validate(snakemake.params.bodies)
stream = partial(generator, snakemake.params.seed, "ch2_wheel")

rows = study.wheel_force_study(settings.n, stream("study"), settings, bodies)
write_result(rows, snakemake.output.rows)
write_result(study.wheel_force_table(rows), snakemake.output.table)
write_result(study.mass_summary(settings, bodies), snakemake.output.mass)
drawn = {
    "figure_2_10": figure_2_10(study.motion_by_mass(settings, bodies)),
    "figure_2_11": figure_2_11(study.example_forces(stream("figure"), settings, bodies)),
}
save_figures(drawn, snakemake.output[0])
