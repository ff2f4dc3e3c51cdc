"""Effects that the learner has never seen: noticed, relearned, error before and after."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.robot.samples import read_samples
from thesis_lib.jenga.study.hidden import hidden_tables
from thesis_lib.thesis.figures.chapter5.model import figure_hidden

params, source = snakemake.params, snakemake.input
settings = Chapter5.model_validate(params.settings)
tables = hidden_tables(
    read_samples(source.samples),
    read_samples(source.held_out),
    settings,
    params.seed,
    generator(params.seed, "ch5_hidden"),
    say=print,
)
folder = Path(snakemake.output[0]).parent
for name, table in tables.items():
    write_result(table, folder / f"unseen_{name}.csv")
save_figure(*figure_hidden(tables["errors"], tables["pushes"]), folder / "figure_unseen")
