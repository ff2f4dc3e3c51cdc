# The critique: which physical effect is missing from the contact models, for every dataset that is present.
CRITIQUE_DATASETS = [name for name in CONFIG.critique.datasets if DATASETS[name].present]


rule critique_dataset:
    input:
        dataset_files,
    output:
        diagnosis="results/critique/{dataset}/diagnosis.json",
        page=report(
            "results/critique/{dataset}/report.html",
            caption="../report/critique.rst",
            category="Critique",
            labels={"item": "{dataset}", "shows": "which effect is missing"},
        ),
    log:
        "results/logs/critique_dataset/{dataset}.log",
    conda:
        "../envs/thesis.yaml"
    params:
        folder=lambda wildcards: DATASETS[wildcards.dataset].folder,
        effects=lambda wildcards: CONFIG.critique.effects.get(wildcards.dataset),
        settings=settings(CONFIG.critique.settings),
        max_trials=CONFIG.critique.max_trials,
        arcs=settings(CONFIG.arcs),
        seed=CONFIG.seed,
        lib=code_of("critique"),
    message:
        "Criticising contact models against {wildcards.dataset}"
    script:
        "../scripts/critique.py"


rule critique:
    input:
        expand("results/critique/{dataset}/report.html", dataset=CRITIQUE_DATASETS),


rule critique_proof:
    input:
        sizes="config/proof_sizes.json",
    output:
        confusion="results/critique/proof/confusion.csv",
        agreement="results/critique/proof/agreement.csv",
    log:
        "results/logs/critique_proof.log",
    conda:
        "../envs/thesis.yaml"
    params:
        store=lambda wildcards: "config/proof",
        cases=list(CONFIG.critique.proof),
        lib=code_of("critique_proof"),
    message:
        "Proof of the critique: {params.cases}"
    script:
        "../scripts/critique_proof.py"
