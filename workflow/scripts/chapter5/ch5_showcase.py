"""Belief along two pushes by filter and sampler, a steered push, frames of a game (figures 5-8, 5-9)."""

from functools import partial
from pathlib import Path

from thesis_lib.thesis.job import snakemake
from thesis_lib.figures.style import save_figure
from thesis_lib.foundation.files import write_result
from thesis_lib.foundation.randomness import generator
from thesis_lib.jenga.play.game import play
from thesis_lib.jenga.play.players import policy_of
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.robot.samples import read_samples
from thesis_lib.jenga.study import showcase
from thesis_lib.jenga.study.steering import steering_pushes, steering_summary, strayed_most
from thesis_lib.thesis.figures.chapter5 import showcase as figures

params, out = snakemake.params, snakemake.output
settings, shown = Chapter5.model_validate(params.settings), params.settings["showcase"]
stream = partial(generator, params.seed, "ch5_showcase")

samples = read_samples(snakemake.input.samples).first(shown["samples"])
policy = policy_of("hma", samples, len(samples), settings, stream("fit"))
choice = settings.showcase
pushes = showcase.straight_pushes(settings.towers.first_held_out, settings.setup, choice.steps, stream("pushes"))
beliefs, runs = showcase.showcase_table(policy.learner, pushes, choice.every, choice.nuts, stream("nuts"), say=print)
write_result(runs, out.runs)
game = play(showcase.SHOWN, policy, settings.setup, params.seed, blocks=params.blocks, frames=True)
folder = Path(out.runs).parent
save_figure(*figures.figure_5_8(beliefs), folder / "figure_5_8")
steps, ends = steering_pushes(policy.learner, showcase.STEERED, settings.setup, choice, stream("steering"))
write_result(ends, out.ends)
write_result(steering_summary(steps, ends), out.summary)
save_figure(*figures.figure_5_9(strayed_most(steps, ends)), folder / "figure_5_9")
save_figure(*figures.figure_game(*showcase.frames(game)), folder / "figure_game")
