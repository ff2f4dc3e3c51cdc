"""Abstractions against hidden truth; forces against the friction cone and the height (figure 5-7)."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.jenga.play.players import fitted
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.robot.samples import read_samples
from thesis_lib.jenga.study import model_study as study
from thesis_lib.jenga.study.belief_study import belief_table
from thesis_lib.jenga.study.expert_study import expert_tables
from thesis_lib.thesis.figures.chapter5 import model as figures

params, source = snakemake.params, snakemake.input
settings = Chapter5.model_validate(params.settings)
sets, held_out = [read_samples(path) for path in source.sets], read_samples(source.held_out)
learners = fitted(sets, settings, generator(params.seed, "ch5_model", "fit"))
shown, largest = learners[max(learners)], max(learners)[0]
tables = {
    "agreement": study.agreements(learners, held_out, settings.setup, generator(params.seed, "ch5_model", "agreement")),
    "abstractions": study.looks(learners, held_out),
    "cone": study.cone_table(shown, held_out, settings.setup),
    "height": study.height_table(shown, held_out, settings.setup),
    "belief": belief_table([learner for (size, _), learner in learners.items() if size == largest], held_out),
    **expert_tables(
        sets,
        held_out,
        settings.games.sizes,
        settings.experts,
        settings.learner,
        generator(params.seed, "ch5_model", "experts"),
    ),
}
tables["summary"] = study.summary(tables["cone"], tables["height"], generator(params.seed, "ch5_model", "summary"))
folder = Path(snakemake.output[0]).parent
for name, table in tables.items():
    write_result(table, folder / f"model_{name}.csv")
save_figure(*figures.figure_5_7(tables["cone"], tables["height"]), folder / "figure_5_7")
save_figure(*figures.figure_abstractions(study.of_one(tables["abstractions"])), folder / "figure_abstractions")
