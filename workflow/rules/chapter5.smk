# Chapter 5: abstractions of a Jenga tower, and a robot that plays.  Simulated throughout: no dataset is needed.
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


wildcard_constraints:
    policy="[a-z][a-z_]*",
    size="[0-9]+",
    tower="[0-9]+",


rule ch5_diagrams:
    output:
        drawn_by("ch5_diagrams"),
    message:
        "Chapter 5: drawing the diagrams"
    script:
        "../scripts/chapter5/ch5_diagrams.py"


rule ch5_scan:
    output:
        f"{CH5}/scans/tower_{{tower}}.csv",
    params:
        setup=settings(CONFIG.chapter5.setup),
        scanned=CONFIG.chapter5.towers.scanned,
    message:
        "Chapter 5: pushing every block of tower {wildcards.tower} a little"
    script:
        "../scripts/chapter5/ch5_scan.py"


rule ch5_towers:
    input:
        development=ch5_scans(0, CONFIG.chapter5.towers.development),
        test=ch5_scans(CONFIG.chapter5.towers.first_test, CONFIG.chapter5.towers.test),
    output:
        drawn_by("ch5_towers"),
        movable=f"{CH5}/movable.csv",
        summary=f"{CH5}/movable_summary.csv",
        fidelity=f"{CH5}/fidelity.csv",
    params:
        setup=settings(CONFIG.chapter5.setup),
        compared=CONFIG.chapter5.towers.compared,
    message:
        "Chapter 5: how many blocks can be moved"
    script:
        "../scripts/chapter5/ch5_towers.py"


rule ch5_samples:
    output:
        samples=f"{CH5}/samples/{{name}}.csv",
        attempts=f"{CH5}/samples/{{name}}_attempts.csv",
    wildcard_constraints:
        name=r"set_\d+|held_out",
    params:
        setup=settings(CONFIG.chapter5.setup),
        towers=settings(CONFIG.chapter5.towers),
        choice=settings(CONFIG.chapter5.samples),
        most=max(*CONFIG.chapter5.games.sizes, CONFIG.chapter5.showcase.samples),
        seed=CONFIG.seed,
    message:
        "Chapter 5: exploring towers for samples ({wildcards.name})"
    script:
        "../scripts/chapter5/ch5_samples.py"


rule ch5_ppo:
    output:
        [f"{CH5}/ppo/policy_{size}.pt" for size in CONFIG.chapter5.games.ppo_sizes],
    params:
        setup=settings(CONFIG.chapter5.setup),
        ppo=settings(CONFIG.chapter5.ppo),
        sizes=CONFIG.chapter5.games.ppo_sizes,
        seed=CONFIG.seed,
    message:
        "Chapter 5: training PPO"
    script:
        "../scripts/chapter5/ch5_ppo.py"


rule ch5_game:
    input:
        ch5_learned_from,
    output:
        f"{CH5}/games/{{policy}}_{{size}}_{{tower}}.json",
    params:
        settings=settings(CONFIG.chapter5, "setup", "learner", "play", "ppo"),
        blocks=CONFIG.chapter5.games.blocks,
        seed=CONFIG.seed,
    message:
        "Chapter 5: {wildcards.policy} ({wildcards.size} samples) plays tower {wildcards.tower}"
    script:
        "../scripts/chapter5/ch5_game.py"


rule ch5_study:
    input:
        games=CH5_GAME_FILES,
        movable=f"{CH5}/movable_summary.csv",
    output:
        [f"{CH5}/study_{name}.csv" for name in CH5_STUDY_TABLES],
        drawn_by("ch5_study"),
    params:
        shown=CONFIG.chapter5.games.shown,
        threshold_mm=CONFIG.chapter5.setup.movable.threshold_mm,
    message:
        "Chapter 5: what the games say"
    script:
        "../scripts/chapter5/ch5_study.py"


rule ch5_model:
    input:
        sets=CH5_SETS,
        held_out=f"{CH5}/samples/held_out.csv",
    output:
        [f"{CH5}/model_{name}.csv" for name in CH5_MODEL_TABLES],
        drawn_by("ch5_model"),
    params:
        settings=settings(CONFIG.chapter5, "setup", "learner", "games", "experts"),
        seed=CONFIG.seed,
    message:
        "Chapter 5: what the abstractions know"
    script:
        "../scripts/chapter5/ch5_model.py"


rule ch5_showcase:
    input:
        samples=CH5_SETS[0],
    output:
        drawn_by("ch5_showcase"),
        runs=f"{CH5}/showcase_runs.csv",
        ends=f"{CH5}/showcase_steering.csv",
        summary=f"{CH5}/showcase_steering_summary.csv",
    params:
        settings=settings(CONFIG.chapter5, "setup", "learner", "play", "showcase", "towers"),
        blocks=CONFIG.chapter5.games.blocks,
        seed=CONFIG.seed,
    message:
        "Chapter 5: belief along pushes, by filter and by NUTS"
    script:
        "../scripts/chapter5/ch5_showcase.py"


rule ch5_hidden:
    input:
        samples=CH5_SETS[0],
        held_out=f"{CH5}/samples/held_out.csv",
    output:
        [f"{CH5}/unseen_{name}.csv" for name in CH5_HIDDEN_TABLES],
        drawn_by("ch5_hidden"),
    params:
        settings=settings(CONFIG.chapter5, "setup", "learner", "hidden", "towers"),
        seed=CONFIG.seed,
    message:
        "Chapter 5: effects that the learner has never seen"
    script:
        "../scripts/chapter5/ch5_hidden.py"


rule chapter5:
    input:
        rules.ch5_diagrams.output,
        rules.ch5_towers.output,
        rules.ch5_study.output,
        rules.ch5_model.output,
        rules.ch5_showcase.output,
        rules.ch5_hidden.output,
        CH5_FOUND,
        chapter_page(5),
