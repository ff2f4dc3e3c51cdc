"""Share of movable blocks, its sensitivity, and the agreement of simulators and criteria."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import read_table, write_result
from thesis_lib.jenga.study import tower_study as study
from thesis_lib.jenga.tower.settings import Setup
from thesis_lib.jenga.tower.tower import settled_tower
from thesis_lib.thesis.figures.chapter5.showcase import figure_5_5a
from thesis_lib.thesis.figures.chapter5.study import figure_movable

setup, source, out = Setup.model_validate(snakemake.params.setup), snakemake.input, snakemake.output
scans = {kind: [read_table(path, study.SCAN) for path in source[kind]] for kind in ("development", "test")}
shares = study.movable_shares(scans, setup.movable)
write_result(shares, out.movable)
summary = study.movable_summary(shares, scans)
write_result(summary, out.summary)
write_result(study.fidelity(scans["development"], setup, snakemake.params.compared, say=print), out.fidelity)
folder = Path(out.movable).parent
save_figure(*figure_movable(shares, summary, setup.movable.threshold_mm), folder / "figure_movable")
tower = settled_tower(0, setup)
save_figure(*figure_5_5a(tower.poses(), tower.sizes), folder / "figure_5_5a")
