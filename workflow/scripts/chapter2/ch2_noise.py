"""m/I from noisy drops of one shape, every method on every drop (Table 2.1)."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.thesis.identify.mass_ratio.table_2_1 import left_out_table, make_drops, study, table_2_1
from thesis_lib.thesis.identify.settings import Table21

params, shape, out = snakemake.params, snakemake.wildcards.shape, snakemake.output
settings = Table21.model_validate(params.settings)
bodies = Chapter2Bodies.model_validate(params.bodies)
drops = make_drops(shape, settings.drops, generator(params.seed, "ch2_drops", shape), settings, bodies)
print(f"{settings.drops} drops; left out: {drops.left_out}")
rows = study(shape, drops, generator(params.seed, "ch2_noise", shape), settings, bodies)
write_result(rows, out.drops)
write_result(left_out_table(shape, drops), out.left_out)
write_result(table_2_1(rows), out.table)
