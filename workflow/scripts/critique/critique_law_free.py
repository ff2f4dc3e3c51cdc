"""What measured tosses of a cube show without any contact law, for the claims on what was published with them."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import write_result
from thesis_lib.thesis.identify.impacts.law_free_in_space import law_free

params = snakemake.params
table = law_free(read_dataset(params.folder).first_trials(params.trials))
print(table.to_string())
write_result(table, snakemake.output[0])
