"""Criticise one dataset: the same as `thesis-lib critique`."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.run import criticise
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.read import read_dataset
from thesis_lib.datasets.sources.along_throws import along_throws, hidden_drift

params = snakemake.params
dataset = read_dataset(params.folder)
if not dataset.space.is_plane and (drift := hidden_drift(dataset)):
    print(f"{dataset.name}: {drift}; turned along the throws (datasets turn)")
    dataset = along_throws(dataset)
found = criticise(
    dataset.first_trials(params.max_trials),
    effects=params.effects,
    settings=CritiqueSettings.model_validate(params.settings),
    arcs=ArcSettings.model_validate(params.arcs),
    jobs=snakemake.threads,
    seed=params.seed,
    say=print,
)
found.save(Path(snakemake.output.page).parent)
