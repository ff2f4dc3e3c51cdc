"""One game: a policy plays one tower."""

from thesis_lib.thesis.job import snakemake
from thesis_lib.foundation.randomness import generator
from thesis_lib.jenga.play.game import play, write_game
from thesis_lib.jenga.play.players import LEARNS_AS, policy_of
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.jenga.robot.samples import read_samples

params, wildcards, source = snakemake.params, snakemake.wildcards, list(snakemake.input)
settings = Chapter5.model_validate(params.settings)
size, tower = int(wildcards.size), int(wildcards.tower)
if wildcards.policy == "ppo":
    from thesis_lib.jenga.play.ppo import read_policy

    policy = read_policy(source[0])
else:
    # keyed by what is learned from: all games of a set have the very same learner
    learns = LEARNS_AS.get(wildcards.policy, wildcards.policy)
    rng = generator(params.seed, "ch5_game", learns, wildcards.size, *source)
    policy = policy_of(wildcards.policy, read_samples(source[0]) if source else None, size, settings, rng)
game = play(tower, policy, settings.setup, params.seed, blocks=params.blocks)
write_game(game, snakemake.output[0])
print(f"{wildcards.policy} on tower {tower}: {game.end}, {len(game.attempts)} blocks tried")
