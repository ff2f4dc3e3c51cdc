# Chapter 4: learned contact models, for every dataset that is present.
CH4 = "results/chapter4/{dataset}"
CH4_DATASETS = [name for name in CONFIG.chapter4.datasets if DATASETS[name].present]
CH4_CRITICISED = [name for name in CH4_DATASETS if name in CRITIQUE_DATASETS]
CH4_DICE = [name for name in CONFIG.chapter4.dice_datasets if name in CH4_CRITICISED]
CH4_DICE_TABLES = (
    *("parts", "throws", "limit", "difficulty", "parameters", "laws", "calibration", "counts"),
    *("budget", "widths", "readings"),
)
CH4_LEARNED = ("curves", "errors", "summary", "convergence", "ratios")

CH4_FOUND = findings_of(4, CH4_DATASETS, ch4_named_figure=CH4_CRITICISED, ch4_dice=CH4_DICE)


rule ch4_schematics:
    output:
        drawn_by("ch4_schematics"),
    params:
        body=settings(CONFIG.drops, "body")["body"],
    message:
        "Chapter 4: drawing the space of wrenches"
    script:
        "../scripts/chapter4/ch4_schematics.py"


rule ch4_learn:
    input:
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
    output:
        **{name: f"{CH4}/learning_{name}.csv" for name in CH4_LEARNED},
    params:
        settings=settings(CONFIG.chapter4.learning),
        filter=CONFIG.chapter3.filter,
        seed=CONFIG.seed,
    message:
        "Chapter 4: learning contact models from {wildcards.dataset}"
    script:
        "../scripts/chapter4/ch4_learn.py"


rule ch4_named_physics:
    input:
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
        diagnosis="results/critique/{dataset}/diagnosis.json",
    output:
        curves=f"{CH4}/named_curves.csv",
        summary=f"{CH4}/named_summary.csv",
        rungs=f"{CH4}/named_rungs.csv",
    params:
        settings=settings(CONFIG.chapter4.learning),
        filter=CONFIG.chapter3.filter,
        seed=CONFIG.seed,
    message:
        "Chapter 4: what is left to learn of {wildcards.dataset} once the missing effects are in"
    script:
        "../scripts/chapter4/ch4_named_physics.py"


rule ch4_figures:
    input:
        errors=f"{CH4}/learning_errors.csv",
        summary=f"{CH4}/learning_summary.csv",
    output:
        drawn_by("ch4_figures"),
    params:
        law=CONFIG.chapter4.learning.base_law,
    message:
        "Chapter 4: drawing errors of learned models on {wildcards.dataset}"
    script:
        "../scripts/chapter4/ch4_figures.py"


rule ch4_named_figure:
    input:
        rungs=f"{CH4}/named_rungs.csv",
        summary=f"{CH4}/named_summary.csv",
        diagnosis="results/critique/{dataset}/diagnosis.json",
    output:
        drawn_by("ch4_named_figure"),
    message:
        "Chapter 4: drawing named physics, then residual, on {wildcards.dataset}"
    script:
        "../scripts/chapter4/ch4_named_figure.py"


rule ch4_dice:
    input:
        dataset_files,
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
        arcs="results/impacts/{dataset}/arcs.csv",
        diagnosis="results/critique/{dataset}/diagnosis.json",
    output:
        [f"{CH4}/dice_{name}.csv" for name in CH4_DICE_TABLES],
        drawn_by("ch4_dice"),
        dice=shown("dice"),
    params:
        folder=lambda wildcards: DATASETS[wildcards.dataset].folder,
        settings=settings(CONFIG.chapter4.dice),
        seed=CONFIG.seed,
    message:
        "Chapter 4: throwing {wildcards.dataset} to rest by each contact model"
    script:
        "../scripts/chapter4/ch4_dice.py"


rule chapter4:
    input:
        rules.ch4_schematics.output,
        expand(rules.ch4_figures.output, dataset=CH4_DATASETS),
        expand(rules.ch4_named_figure.output, dataset=CH4_CRITICISED),
        expand(f"{CH4}/dice.csv", dataset=CH4_DICE),
        CH4_FOUND,
        chapter_page(4),
