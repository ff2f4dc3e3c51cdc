# Chapter 3: the impact study, for every dataset that is present.
CH3 = "results/chapter3/{dataset}"
CH3_DATASETS = [name for name in CONFIG.chapter3.datasets if is_present(name)]
CH3_TABLES = {
    "ensemble": f"{CH3}/ensemble.csv",
    "convergence": f"{CH3}/convergence.csv",
    "topography": f"{CH3}/topography.csv",
    "individual": f"{CH3}/individual.csv",
    "split": f"{CH3}/split.csv",
}


rule ch3_identify:
    input:
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
    output:
        **CH3_TABLES,
    log:
        "results/logs/ch3_identify/{dataset}.log",
    conda:
        "../envs/thesis.yaml"
    params:
        settings=settings(CONFIG.chapter3),
        seed=CONFIG.seed,
        lib=code_of("ch3_identify"),
    message:
        "Chapter 3: identifying (μ, ε) of every law on {wildcards.dataset}"
    script:
        "../scripts/ch3_identify.py"


rule ch3_evaluate:
    input:
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
        ensemble=CH3_TABLES["ensemble"],
        individual=CH3_TABLES["individual"],
        split=CH3_TABLES["split"],
        topography=CH3_TABLES["topography"],
        convergence=CH3_TABLES["convergence"],
    output:
        errors=f"{CH3}/errors.csv",
        summary=f"{CH3}/error_summary.csv",
        table_3_1=report(
            f"{CH3}/table_3_1.csv",
            caption="../report/table_3_1.rst",
            category="Chapter 3",
            subcategory="{dataset}",
            labels={
                "item": "Table 3.1",
                "shows": "ensemble parameters, best and worst",
            },
        ),
        table_3_2=report(
            f"{CH3}/table_3_2.csv",
            caption="../report/table_3_2.rst",
            category="Chapter 3",
            subcategory="{dataset}",
            labels={"item": "Table 3.2", "shows": "outcomes within predictive range"},
        ),
        coverage=f"{CH3}/coverage.csv",
        statements=f"{CH3}/statements.csv",
    log:
        "results/logs/ch3_evaluate/{dataset}.log",
    conda:
        "../envs/thesis.yaml"
    params:
        settings=settings(CONFIG.chapter3, "range_tolerances", "metric"),
        seed=CONFIG.seed,
        lib=code_of("ch3_evaluate"),
    message:
        "Chapter 3: judging every law on held-out impacts of {wildcards.dataset}"
    script:
        "../scripts/ch3_evaluate.py"


rule ch3_published:
    input:
        header="results/impacts/planar_impact/dataset.yaml",
        predictions=lambda wildcards: f"{dataset_folder('planar_impact')}/dataset.yaml",
    output:
        best_worst="results/chapter3/planar_impact/published_best_worst.csv",
        agreement="results/chapter3/planar_impact/published_agreement.csv",
        cost="results/chapter3/planar_impact/published_cost.csv",
        kept="results/chapter3/planar_impact/published_kept.csv",
    log:
        "results/logs/ch3_published.log",
    conda:
        "../envs/thesis.yaml"
    params:
        lib=code_of("ch3_published"),
    message:
        "Chapter 3: comparing our laws with the predictions that the authors stored"
    script:
        "../scripts/ch3_published.py"


rule chapter3:
    input:
        expand(f"{CH3}/table_3_1.csv", dataset=CH3_DATASETS),
