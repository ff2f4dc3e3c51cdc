"""Contact forces and base parameters of arm and disk together, without and with noise (figure 2-12)."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.thesis.figures.chapter2.forces import figure_2_12
from thesis_lib.thesis.identify.arm.settings import ArmStudy
from thesis_lib.thesis.identify.arm.study import arm_force_study, arm_force_summary

params, out = snakemake.params, snakemake.output
settings = ArmStudy.model_validate(params.settings)
bodies = Chapter2Bodies.model_validate(params.bodies)
found = arm_force_study(generator(params.seed, "ch2_arm"), settings, bodies)
print(f"trajectories left out: {found.left_out}")
write_result(found.forces, out.forces)
write_result(found.parameters, out.parameters)
write_result(arm_force_summary(found.forces, found.parameters), out.summary)
save_figure(*figure_2_12(found.trajectories[0]), out[0])
