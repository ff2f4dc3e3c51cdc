"""Named physics, then residual, in one figure."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.effects import EFFECTS
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import read_json, read_table
from thesis_lib.thesis.figures.chapter4.errors import figure_named_physics

columns = ["model", "n", "mean", "low", "high"]
rungs, summary = (read_table(snakemake.input[name], columns) for name in ("rungs", "summary"))
found = read_json(snakemake.input.diagnosis)
titles = [EFFECTS[effect["name"]].title for effect in found["effects"]]
drawn = figure_named_physics(rungs, summary, titles, found["error"]["noise_floor_single"])
save_figure(*drawn, snakemake.output[0])
