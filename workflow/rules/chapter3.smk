# Chapter 3: the impact study, for every dataset that is present.
CH3 = "results/chapter3/{dataset}"
CH3_DATASETS = [name for name in CONFIG.chapter3.datasets if DATASETS[name].present]
CH3_TABLES = {
    "ensemble": f"{CH3}/ensemble.csv",
    "convergence": f"{CH3}/convergence.csv",
    "topography": f"{CH3}/topography.csv",
    "individual": f"{CH3}/individual.csv",
    "split": f"{CH3}/split.csv",
}
CH3_WITH_TRAJECTORIES = [name for name in CH3_DATASETS if DATASETS[name].has_trajectories]

CH3_FOUND = findings_of(3, CH3_DATASETS, ch3_trajectories=CH3_WITH_TRAJECTORIES)


rule ch3_identify:
    input:
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
    output:
        **CH3_TABLES,
    params:
        settings=settings(CONFIG.chapter3),
        seed=CONFIG.seed,
    message:
        "Chapter 3: identifying (μ, ε) of every law on {wildcards.dataset}"
    script:
        "../scripts/chapter3/ch3_identify.py"


rule ch3_evaluate:
    input:
        **CH3_TABLES,
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
        left_out="results/impacts/{dataset}/left_out.csv",
    output:
        errors=f"{CH3}/errors.csv",
        summary=f"{CH3}/error_summary.csv",
        table_3_1=shown("table_3_1"),
        table_3_2=shown("table_3_2"),
        coverage=f"{CH3}/coverage.csv",
        statements=f"{CH3}/statements.csv",
    params:
        settings=settings(CONFIG.chapter3, "range_tolerances"),
        seed=CONFIG.seed,
    message:
        "Chapter 3: judging every law on held-out impacts of {wildcards.dataset}"
    script:
        "../scripts/chapter3/ch3_evaluate.py"


rule ch3_published:
    input:
        header="results/impacts/planar_impact/dataset.yaml",
        predictions=DATASETS["planar_impact"].files,
    output:
        best_worst="results/chapter3/planar_impact/published_best_worst.csv",
        agreement="results/chapter3/planar_impact/published_agreement.csv",
        cost="results/chapter3/planar_impact/published_cost.csv",
        kept="results/chapter3/planar_impact/published_kept.csv",
        parameters="results/chapter3/planar_impact/published_parameters.csv",
        first_drops="results/chapter3/planar_impact/published_first_drops.csv",
    params:
        folder=lambda wildcards: DATASETS["planar_impact"].folder,
        seed=CONFIG.seed,
        max_impacts=CONFIG.chapter3.max_impacts,
        subsets=CONFIG.chapter3.bootstrap // 2,  # each is fitted by itself
    message:
        "Chapter 3: comparing our laws with the predictions that the authors stored"
    script:
        "../scripts/chapter3/ch3_published.py"


rule ch3_schematics:
    input:
        coverage="results/chapter3/drops/coverage.csv",
    output:
        drawn_by("ch3_schematics"),
    params:
        body=settings(CONFIG.drops, "body")["body"],
    message:
        "Chapter 3: drawing the contact space"
    script:
        "../scripts/chapter3/ch3_schematics.py"


rule ch3_trajectories:
    input:
        dataset_files,
        impacts="results/impacts/{dataset}/impacts.csv",
        arcs="results/impacts/{dataset}/arcs.csv",
    output:
        drawn_by("ch3_trajectories"),
    params:
        folder=lambda wildcards: DATASETS[wildcards.dataset].folder,
    message:
        "Chapter 3: drawing one trial of {wildcards.dataset}"
    script:
        "../scripts/chapter3/ch3_trajectories.py"


rule ch3_figures:
    input:
        **CH3_TABLES,
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
        errors=f"{CH3}/errors.csv",
    output:
        drawn_by("ch3_figures"),
    message:
        "Chapter 3: drawing the figures of {wildcards.dataset}"
    script:
        "../scripts/chapter3/ch3_figures.py"


rule chapter3:
    input:
        rules.ch3_published.output if "planar_impact" in CH3_DATASETS else [],
        expand(f"{CH3}/table_3_1.csv", dataset=CH3_DATASETS),
        rules.ch3_schematics.output,
        expand(rules.ch3_trajectories.output, dataset=CH3_WITH_TRAJECTORIES),
        expand(rules.ch3_figures.output, dataset=CH3_DATASETS),
        CH3_FOUND,
        chapter_page(3),
