"""What is left to learn once the effects that the critique named are in."""

from functools import partial
from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.files import read_json, read_table, write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.impact_study.study import select_impacts
from thesis_lib.thesis.residual import learning_study as study
from thesis_lib.thesis.residual.settings import LearningStudySettings

params, out, dataset = snakemake.params, snakemake.output, snakemake.wildcards.dataset
settings = LearningStudySettings.model_validate(params.settings)
critique = Path(snakemake.input.diagnosis).parent
stream = partial(generator, params.seed, "ch4_named_physics", dataset)

impacts = read_dataset(Path(snakemake.input.header).parent).stated_impacts()
impacts = select_impacts(impacts, params.filter, settings.max_impacts, stream("select"))
held_out = study.held_out_by(read_table(critique / "impacts.csv", ["trial", "held_out"]), impacts)
law = read_json(snakemake.input.diagnosis)["base_model"]["name"]
model = load_model(critique / "model.json")
curves, rungs = study.named_physics(impacts, held_out, law, model, settings, stream("draws"))
write_result(curves, out.curves)
write_result(study.curve_summary(curves), out.summary)
write_result(rungs, out.rungs)
