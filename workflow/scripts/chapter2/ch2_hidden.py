"""Forces that the models of arm and wheel lack: hidden, found, added; a page for each."""

from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.critique.mechanisms.settings import HiddenStudy
from thesis_lib.critique.mechanisms.study import hidden_effect_study
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.report.critique.folder import write_critique
from thesis_lib.report.critique.mechanisms import mechanism_contents, mechanism_findings
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.thesis.figures.chapter2.hidden import figure_hidden

params, out = snakemake.params, snakemake.output
settings = HiddenStudy.model_validate(params.settings)
bodies = Chapter2Bodies.model_validate(params.bodies)
tables, shown = hidden_effect_study(settings, generator(params.seed, "ch2_hidden"), bodies, say=print)
for path in out.tables:
    write_result(tables[Path(path).stem.removeprefix("hidden_")], path)
save_figure(*figure_hidden(tables["effects"], tables["forces"]), out[0])
for name, found in shown.items():
    name = name.replace("/", "_")
    written = mechanism_findings(found, name, generator(params.seed, "mechanism critique", name))
    write_critique(written, mechanism_contents(found, written), f"{out.pages}/{name}")
