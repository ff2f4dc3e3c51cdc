# Chapter 2: contact-implicit identification, simulated, identified and bounded.
CH2 = "results/chapter2"
CH2_SHAPES = ("block", "ellipse")
CH2_HIDDEN_TABLES = ("effects", "parameters", "summary", "forces")
CH2_SETS = [name for name, source in SOURCES.items() if source.dimensions == 2]
CH2_MEASURED = [name for name in CH2_SETS if DATASETS[name].present]
CH2_FOUND = findings_of(2, ch2_measured_ratio=CH2_MEASURED)


rule ch2_schematics:
    output:
        drawn_by("ch2_schematics"),
    params:
        bodies=settings(CONFIG.chapter2.bodies),
    message:
        "Chapter 2: drawing the mechanisms"
    script:
        "../scripts/chapter2/ch2_schematics.py"


rule ch2_motions:
    input:
        DATASETS["drops"].files,
    output:
        drawn_by("ch2_motions"),
    params:
        drops=lambda wildcards: DATASETS["drops"].folder,
        bodies=settings(CONFIG.chapter2.bodies),
        scenes=settings(CONFIG.chapter2.scenes),
        seed=CONFIG.seed,
    message:
        "Chapter 2: drawing simulated motions"
    script:
        "../scripts/chapter2/ch2_motions.py"


rule ch2_identifiability:
    output:
        table=f"{CH2}/identifiability.csv",
        homogeneous=f"{CH2}/homogeneous.csv",
    params:
        bodies=settings(CONFIG.chapter2.bodies),
    message:
        "Chapter 2: what contact identifies"
    script:
        "../scripts/chapter2/ch2_identifiability.py"


rule ch2_programs:
    output:
        f"{CH2}/{{mechanism}}/programs.csv",
    params:
        settings=settings(CONFIG.chapter2.programs),
        bodies=settings(CONFIG.chapter2.bodies),
        seed=CONFIG.seed,
    message:
        "Chapter 2: equations 2.12 to 2.14 from random starts, {wildcards.mechanism}"
    script:
        "../scripts/chapter2/ch2_programs.py"


rule ch2_gather:
    input:
        expand(f"{CH2}/{{mechanism}}/programs.csv", mechanism=CONFIG.chapter2.programs.mechanisms),
    output:
        shown("programs"),
    message:
        "Chapter 2: gathering the programs' success"
    script:
        "../scripts/chapter2/ch2_gather.py"


rule ch2_noise:
    output:
        drops=f"{CH2}/{{shape}}/table_2_1_drops.csv",
        left_out=f"{CH2}/{{shape}}/left_out_drops.csv",
        table=f"{CH2}/{{shape}}/table_2_1.csv",
    params:
        settings=settings(CONFIG.chapter2.table_2_1),
        bodies=settings(CONFIG.chapter2.bodies),
        seed=CONFIG.seed,
    message:
        "Chapter 2: identifying m/I from noisy drops of the {wildcards.shape}"
    script:
        "../scripts/chapter2/ch2_noise.py"


rule ch2_table_2_1:
    input:
        expand(f"{CH2}/{{shape}}/table_2_1.csv", shape=CH2_SHAPES),
    output:
        drawn_by("ch2_table_2_1"),
        table=shown("table_2_1"),
    message:
        "Chapter 2: Table 2.1"
    script:
        "../scripts/chapter2/ch2_table_2_1.py"


rule ch2_wheel:
    output:
        drawn_by("ch2_wheel"),
        rows=f"{CH2}/wheel_forces_rows.csv",
        table=shown("wheel_forces"),
        mass=f"{CH2}/wheel_mass.csv",
    params:
        settings=settings(CONFIG.chapter2.wheel),
        bodies=settings(CONFIG.chapter2.bodies),
        seed=CONFIG.seed,
    message:
        "Chapter 2: forces of the rimless wheel's spokes"
    script:
        "../scripts/chapter2/ch2_wheel.py"


rule ch2_arm:
    output:
        drawn_by("ch2_arm"),
        forces=f"{CH2}/arm_forces.csv",
        parameters=f"{CH2}/arm_parameters.csv",
        summary=shown("arm_summary"),
    params:
        settings=settings(CONFIG.chapter2.arm),
        bodies=settings(CONFIG.chapter2.bodies),
        seed=CONFIG.seed,
    message:
        "Chapter 2: forces and base parameters of arm and disk"
    script:
        "../scripts/chapter2/ch2_arm.py"


rule ch2_impact_forces:
    output:
        drawn_by("ch2_impact_forces"),
        impacts=f"{CH2}/impact_forces.csv",
        summary=shown("impact_force_summary"),
    params:
        settings=settings(CONFIG.chapter2.impact_forces),
        seed=CONFIG.seed,
    message:
        "Chapter 2: forces at impact against those of Drake's compliant contact"
    script:
        "../scripts/chapter2/ch2_impact_forces.py"


rule ch2_measured_ratio:
    input:
        header="results/impacts/{dataset}/dataset.yaml",
        impacts="results/impacts/{dataset}/impacts.csv",
        left_out="results/impacts/{dataset}/left_out.csv",
    output:
        drawn_by("ch2_measured_ratio"),
        table=f"{CH2}/{{dataset}}/measured_ratio.csv",
    params:
        settings=settings(CONFIG.chapter2.measured_ratio),
        seed=CONFIG.seed,
    message:
        "Chapter 2: identifying m/I from {wildcards.dataset}"
    script:
        "../scripts/chapter2/ch2_measured_ratio.py"


rule ch2_measured_ratios:
    input:
        expand(f"{CH2}/{{dataset}}/measured_ratio.csv", dataset=CH2_MEASURED),
    output:
        shown("measured_ratio"),
    params:
        absent=[name for name in CH2_SETS if name not in CH2_MEASURED],
    message:
        "Chapter 2: m/I from measured data against the authors' value"
    script:
        "../scripts/chapter2/ch2_measured_ratios.py"


rule ch2_hidden:
    output:
        drawn_by("ch2_hidden"),
        tables=[f"{CH2}/hidden_{name}.csv" for name in CH2_HIDDEN_TABLES],
        pages=directory(f"{CH2}/hidden"),
    params:
        settings=settings(CONFIG.chapter2.hidden),
        bodies=settings(CONFIG.chapter2.bodies),
        seed=CONFIG.seed,
    message:
        "Chapter 2: finding what the models of arm and wheel lack"
    script:
        "../scripts/chapter2/ch2_hidden.py"


rule chapter2:
    input:
        rules.ch2_hidden.output,
        rules.ch2_wheel.output,
        rules.ch2_arm.output,
        rules.ch2_impact_forces.output,
        expand(rules.ch2_measured_ratio.output, dataset=CH2_MEASURED),
        rules.ch2_measured_ratios.output,
        rules.ch2_schematics.output,
        rules.ch2_motions.output,
        rules.ch2_identifiability.output,
        rules.ch2_gather.output,
        rules.ch2_table_2_1.output,
        CH2_FOUND,
        chapter_page(2),
