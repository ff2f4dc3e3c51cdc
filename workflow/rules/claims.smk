# The claims ledger, what made the results, and one page of them.
CLAIM_TABLES = [*CH2_CLAIMED, *CH4_CLAIMED, *CH5_CLAIMED, *CRITIQUE_CLAIMED] + [
    f"results/chapter3/{dataset}/{table}.csv"
    for dataset in CH3_DATASETS
    for table in ("table_3_1", "table_3_2", "error_summary", "coverage", "statements")
]
if "planar_impact" in CH3_DATASETS:
    CLAIM_TABLES += rules.ch3_published.output

OTHER_FOUND = ["results/critique/proof/proof.txt", "results/claims.txt"]


rule claims:
    input:
        ledger=expand("config/claims/{name}.yaml", name=("chapter2", "chapter3", "chapter4", "chapter5", "cube")),
        present=rules.datasets_present.output[0],
        tables=CLAIM_TABLES,
    output:
        table="results/claims.csv",
        page=shown("claims", "results/claims.html"),
    params:
        scale=CONFIG.scale,
    message:
        "Comparing the results with what the thesis states"
    script:
        "../scripts/run/claims.py"


rule findings:
    input:
        tables_read(OTHER_FOUND),
    output:
        OTHER_FOUND,
    message:
        "What the proof of the critique and the claims ledger show"
    script:
        "../scripts/run/findings.py"


rule provenance:
    input:
        rules.chapter2.input,
        rules.chapter3.input,
        rules.chapter4.input,
        rules.chapter5.input,
        rules.critique.input,
        dictionary="thesis_lib/foundation/columns.yaml",
    output:
        made="results/provenance.json",
        columns="results/columns.csv",
    params:
        scale=CONFIG.scale,
        seed=CONFIG.seed,
        configuration=value_sha256(CONFIG.model_dump(mode="json", by_alias=True)),
        sources={
            name: dataset.source or dataset.folder
            for name, dataset in DATASETS.items()
            if dataset.origin in ("folder", "published")
        },
        columns={figure.name: dict(figure.columns) for figure in figures()},
    message:
        "Recording versions, seed, commit and checksums of the data"
    script:
        "../scripts/run/provenance.py"


rule run_report:
    input:
        rules.claims.output,
        rules.provenance.output,
        [chapter_page(chapter) for chapter in (2, 3, 4, 5)],  # to which it links
        findings=[*CH2_FOUND, *CH3_FOUND, *CH4_FOUND, *CH5_FOUND, *CRITIQUE_FOUND, *OTHER_FOUND],
    output:
        page="results/report.html",
        captions=directory("results/captions"),
    params:
        scale=CONFIG.scale,
        absent=ABSENT,
    message:
        "Gathering the main findings of all chapters on one page"
    script:
        "../scripts/run/run_report.py"


# A first look while the other chapters run.
rule chapter_report:
    input:
        made_by_chapter,
        findings=lambda wildcards: (CH2_FOUND, CH3_FOUND, CH4_FOUND, CH5_FOUND)[int(wildcards.chapter) - 2],
    output:
        chapter_page("{chapter}"),
    params:
        scale=CONFIG.scale,
        absent=ABSENT,
    message:
        "Chapter {wildcards.chapter} on one page: {output}"
    script:
        "../scripts/run/chapter_report.py"
