# The claims ledger, what made the results, and one page of them.
OTHER_FOUND = ["results/critique/proof/proof.txt", "results/claims.txt"]
FOUND = {
    "ch2_findings": (CH2_FOUND, "Chapter 2: what its figures and tables show"),
    "ch3_findings": (CH3_FOUND, "Chapter 3: what its figures and tables show"),
    "ch4_findings": (CH4_FOUND, "Chapter 4: what its figures and tables show"),
    "ch5_findings": (CH5_FOUND, "Chapter 5: what its figures and tables show"),
    "critique_findings": (CRITIQUE_FOUND, "Critique: what it found in each dataset"),
    "findings": (OTHER_FOUND, "What the proof of the critique and the claims ledger show"),
}


rule claims:
    input:
        ledger=sorted(map(str, Path("config/claims").glob("*.yaml"))),
        present=rules.datasets_present.output[0],
        tables=tables_of_claims,
    output:
        table="results/claims.csv",
        page=shown("claims", "results/claims.html"),
    params:
        scale=CONFIG.scale,
    message:
        "Comparing the results with what the thesis states"
    script:
        "../scripts/run/claims.py"


for made_by, (files, said) in FOUND.items():

    rule:
        name:
            made_by
        input:
            tables_read(files),
        output:
            files,
        message:
            said
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
        findings=[file for files, _ in FOUND.values() for file in files],
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
        findings=lambda wildcards: FOUND[f"ch{wildcards.chapter}_findings"][0],
    output:
        chapter_page("{chapter}"),
    params:
        scale=CONFIG.scale,
        absent=ABSENT,
    message:
        "Chapter {wildcards.chapter} on one page: {output}"
    script:
        "../scripts/run/chapter_report.py"
