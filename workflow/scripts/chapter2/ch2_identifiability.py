"""What sliding and sticking contact identifies, with and without external force (thesis 2.3.3)."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.files import write_result
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.thesis.identify.base_parameters.excitation_table import excitation_table
from thesis_lib.thesis.identify.programs.homogeneous import ratios_table

bodies = Chapter2Bodies.model_validate(snakemake.params.bodies)
table = excitation_table(bodies)
print(table.to_string())
write_result(table, snakemake.output.table)
write_result(ratios_table(bodies), snakemake.output.homogeneous)
