# Chapter 5: which files there are, and what each policy learns from.
CH5 = "results/chapter5"
CH5_GAME_FILES = [
    f"{CH5}/games/{policy}_{size}_{CONFIG.chapter5.towers.first_test + i}.json"
    for (policy, size), towers in CONFIG.chapter5.games.played().items()
    for i in range(towers)
]
CH5_SETS = [f"{CH5}/samples/set_{i}.csv" for i in range(CONFIG.chapter5.samples.sets)]
CH5_STUDY_TABLES = ("games", "attempts", "curve", "paired", "success", "course", "needed", "statements")
CH5_MODEL_TABLES = ("agreement", "abstractions", "cone", "height", "summary", "belief", "experts", "experts_summary")
CH5_HIDDEN_TABLES = ("summary", "pushes", "errors")
CH5_FOUND = findings_of(5)


def ch5_learned_from(wildcards):
    """What a policy learns from: a set of samples, weights of PPO, or nothing."""
    if wildcards.policy == "ppo":
        return [f"{CH5}/ppo/policy_{wildcards.size}.pt"]
    if wildcards.policy in CONFIG.chapter5.games.fixed:
        return []
    return [CH5_SETS[CONFIG.chapter5.samples.of_game(int(wildcards.tower))]]


def ch5_scans(first, count):
    """Scans of towers first, first + 1, ..."""
    return [f"{CH5}/scans/tower_{seed}.csv" for seed in range(first, first + count)]
