"""Find the impacts of a dataset, with covariances, flags, and the reason for each one left out."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.datasets.impacts.detect import find_impacts
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import write_json, write_table

params = snakemake.params
dataset = read_dataset(params.folder).first_trials(params.first_trials)
found = find_impacts(dataset, ArcSettings(**params.arcs))
for warning in found.warnings:
    print(warning)
write_table(found.left_out, snakemake.output.left_out)
write_table(found.arcs, snakemake.output.arcs)
write_json(found.summary(), snakemake.output.summary)
write_dataset(
    Dataset(dataset.name, dataset.header, None, found.impacts.to_table()), Path(snakemake.output.header).parent
)
