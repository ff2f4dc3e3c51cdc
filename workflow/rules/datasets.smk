# Datasets: measured ones converted from their published files, simulated drops, and the impacts found in each.
PRESENT = {
    name: {"present": dataset.present, "simulated": dataset.origin == "simulated"} for name, dataset in DATASETS.items()
}
# figures 3-5 and 3-6 of the thesis show ellipse trajectories, which nobody has published
PRESENT["planar_impact_trajectories"] = {"present": False, "simulated": False}
# the default scale plays two towers: too few to compare anything with the thesis (config/chapter5_study.yaml has more)
PRESENT["jenga_study"] = {"present": CONFIG.chapter5.games.towers >= 6, "simulated": True}

ABSENT = [name for name, dataset in DATASETS.items() if not dataset.present]
for name in ABSENT:
    logger.warning(
        f"The measured dataset {name} is not present (looked in {', '.join(CONFIG.measured)}): "
        f"its tables and figures are left out and its claims say 'data not present'. "
        f"To get it: thesis-lib datasets fetch {name.replace('_', '-')}"
    )


rule datasets_present:
    output:
        "results/datasets/present.json",
    params:
        present=PRESENT,
    message:
        "Noting which datasets are present"
    script:
        "../scripts/datasets/datasets_present.py"


rule convert_measured:
    input:
        lambda wildcards: DATASETS[wildcards.dataset].source_files,
    output:
        "results/datasets/{dataset}/dataset.yaml",
    params:
        source=lambda wildcards: DATASETS[wildcards.dataset].source,
    message:
        "Checking and converting the published files of {wildcards.dataset}"
    script:
        "../scripts/datasets/convert_measured.py"


rule simulate_drops:
    output:
        header="data/simulated/drops/dataset.yaml",
        trajectories="data/simulated/drops/trajectories.csv",
        truth="results/datasets/drops_truth.csv",
        trials="results/datasets/drops_trials.csv",
    params:
        drops=settings(CONFIG.drops),
        seed=CONFIG.seed,
    message:
        "Simulating {params.drops[n]} drops"
    script:
        "../scripts/datasets/simulate_drops.py"


rule find_impacts:
    input:
        dataset_files,
    output:
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
        arcs="results/impacts/{dataset}/arcs.csv",
        left_out="results/impacts/{dataset}/left_out.csv",
        summary="results/impacts/{dataset}/summary.json",
    params:
        folder=lambda wildcards: DATASETS[wildcards.dataset].folder,
        first_trials=lambda wildcards: CONFIG.first_trials.get(wildcards.dataset),
        arcs=settings(CONFIG.arcs),
    message:
        "Finding impacts in {wildcards.dataset}"
    script:
        "../scripts/datasets/find_impacts.py"
