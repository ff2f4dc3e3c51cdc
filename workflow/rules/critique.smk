# The critique: which physical effect is missing from the contact models, for every dataset that is present.
CRITIQUE_DATASETS = [name for name in CONFIG.critique.datasets if DATASETS[name].present]
CRITIQUE_FOUND = [f"results/critique/{name}/verdict.txt" for name in CRITIQUE_DATASETS]


rule critique_dataset:
    input:
        dataset_files,
    output:
        diagnosis="results/critique/{dataset}/diagnosis.json",
        page=shown("verdict", "results/critique/{dataset}/report.html"),
    threads: lambda wildcards: CONFIG.critique.jobs.get(wildcards.dataset, 1)
    params:
        folder=lambda wildcards: DATASETS[wildcards.dataset].folder,
        effects=lambda wildcards: CONFIG.critique.effects.get(wildcards.dataset),
        settings=settings(CONFIG.critique.settings),
        max_trials=lambda wildcards: CONFIG.critique.max_trials.get(wildcards.dataset),
        arcs=settings(CONFIG.arcs),
        seed=CONFIG.seed,
    message:
        "Criticising contact models against {wildcards.dataset}"
    script:
        "../scripts/critique/critique.py"


rule critique_law_free:
    input:
        dataset_files,
    output:
        "results/critique/{dataset}/law_free.csv",
    params:
        folder=lambda wildcards: DATASETS[wildcards.dataset].folder,
        trials=300,  # those that are published beside the project: the same numbers for whoever has all 570
    message:
        "What {wildcards.dataset} shows without any contact law"
    script:
        "../scripts/critique/critique_law_free.py"


rule critique:
    input:
        expand("results/critique/{dataset}/report.html", dataset=CRITIQUE_DATASETS),
        CRITIQUE_FOUND,


PROOF = "results/critique/proof"
PROOF_PICTURES = (
    "matrix_law",
    "matrix_mechanism",
    "matrix_drake",
    "detection",
    "sizes",
    "misfits",
    "recovery",
    "real_contacts",
)
PROOF_SOURCES = ("law", "mechanism", "drake", "mujoco", "drake_point", "drake_hydroelastic")


rule critique_proof:
    input:
        expand("config/proof/{source}.csv", source=PROOF_SOURCES),
        sizes="config/proof_sizes.json",
    output:
        [shown("proof", f"{PROOF}/{name}.png") for name in PROOF_PICTURES],
        expand(f"{PROOF}/{{name}}.{{kind}}", name=PROOF_PICTURES, kind=("pdf", "csv")),
        confusion=f"{PROOF}/confusion.csv",
        summary=shown("proof", f"{PROOF}/summary.csv"),
        misses=f"{PROOF}/misses.csv",
        rerun=f"{PROOF}/rerun.csv",
    params:
        store=lambda wildcards: "config/proof",
        cases=list(CONFIG.critique.proof),
    message:
        "Proof of the critique: {params.cases}"
    script:
        "../scripts/critique/critique_proof.py"
