"""Success of the thesis's programs on noise-free windows from random starts."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.thesis.identify.programs.study import programs_table
from thesis_lib.thesis.identify.settings import Programs

params = snakemake.params
kind = snakemake.wildcards.mechanism
settings = Programs.model_validate({**params.settings, "mechanisms": [kind]})
bodies = Chapter2Bodies.model_validate(params.bodies)
table = programs_table(settings, generator(params.seed, "ch2_programs", kind), bodies)
write_result(table, snakemake.output[0])
