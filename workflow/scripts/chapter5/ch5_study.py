"""What the games say: extractions against samples, paired comparisons, successes (figures 5-5B, 5-6)."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figures
from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.jenga.play.game import read_game
from thesis_lib.jenga.study import study
from thesis_lib.thesis.figures.chapter5 import study as figures

shown, threshold_mm = snakemake.params.shown, snakemake.params.threshold_mm
games = [(int(Path(path).stem.split("_")[-2]), read_game(path)) for path in snakemake.input.games]
folder = Path(snakemake.output[0]).parent
tables = study.study_tables(games, shown)
movable = read_table(snakemake.input.movable).query("set == 'test' and threshold_mm == @threshold_mm")
tables["statements"] = study.statements_table(tables["games"], tables["success"], movable.iloc[0], shown)
for name, table in tables.items():
    write_result(table, folder / f"study_{name}.csv")
drawn = {
    "figure_5_5b": figures.figure_5_5b(tables["curve"]),
    "figure_5_6": figures.figure_5_6(tables["success"]),
    "figure_paired": figures.figure_paired(tables["paired"].query("policy == 'hma'")),
}
save_figures(drawn, snakemake.output[0])
