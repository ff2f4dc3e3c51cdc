"""Thrown dice: where each contact model says that they come to rest (figures 4-3, 4-4 and 4-7 to 4-10)."""

from functools import partial
from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.datasets.read import read_dataset
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.figures.chapter4 import dice
from thesis_lib.thesis.residual.dice import results
from thesis_lib.thesis.residual.dice.models import critique_model
from thesis_lib.thesis.residual.dice.settings import DiceStudySettings
from thesis_lib.thesis.residual.dice.study import dice_study, side_of

params, source, name = snakemake.params, snakemake.input, snakemake.wildcards.dataset
settings = DiceStudySettings.model_validate(params.settings)
stream = partial(generator, params.seed, "ch4_dice", name)

dataset = read_dataset(params.folder)
impacts = read_dataset(Path(source.header).parent).stated_impacts()
hits = read_table(source.arcs, ["trial", "t"])
model = load_model(Path(source.diagnosis).with_name("model.json"))
try:
    critique_model(model, side_of(dataset))
except UserError as error:
    print(f"{error} Thrown without it.")
    model = None
studies = dice_study(dataset, hits, impacts, model, settings, stream("study"))
side, poses, shape = side_of(dataset), dataset.trajectories, dataset.shape
tables = results.dice_tables(studies, settings, stream("tables"))
of_first = results.tables_of_part(studies[0], side, settings, stream("widths"))
for stem, table in (*tables.items(), *of_first.items()):
    write_result(table, Path(snakemake.output.dice).with_name(f"{stem}.csv"))

calibrated = tables["dice_throws"], tables["dice_calibration"]
shown = results.examples(studies[0], side, settings, stream("examples"))
compliant = studies[0].outcomes[results.COMPLIANT].thrower.model
drawn = {
    "figure_4_3": dice.figure_4_3(poses, shown.samples, shape),
    "figure_4_4": dice.figure_4_4(shown.samples, shown.rest, side),
    "figure_4_7": dice.figure_4_7(poses, shape, shown.hard),
    "figure_4_8": dice.figure_4_8(tables["dice_throws"]),
    "figure_4_9": dice.figure_4_9(poses, hits, shape, shown.easy, shown.hard),
    "figure_4_10": dice.figure_4_10(shown.beliefs, shown.marks),
    "figure_restitution": dice.figure_restitution(results.restitution(compliant, studies[0].contacts, settings.throw)),
    "figure_budget": dice.figure_budget(tables["dice_budget"]),
    "figure_calibration": dice.figure_calibration(*results.calibration(*calibrated)),
}
save_figures(drawn, snakemake.output.dice)
