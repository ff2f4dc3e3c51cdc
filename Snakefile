# Contact models in robotic manipulation: the whole reproduction.  snakemake --cores 2 [TARGET]
from snakemake.utils import min_version

min_version("9.27")


configfile: "config/config.yaml"


report: "workflow/report/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/datasets.smk"
include: "workflow/rules/chapter2.smk"
include: "workflow/rules/chapter3.smk"
include: "workflow/rules/critique.smk"
include: "workflow/rules/chapter4.smk"
include: "workflow/rules/chapter5.smk"
include: "workflow/rules/claims.smk"


# With a limit of submissions (100 jobs a second by default) Snakemake 9.27 wakes its scheduler once a second for every
# job that has ended (its pull request 3744), and is soon as busy as a job.  Cores limit local jobs, `jobs:` the others.
onstart:
    workflow.scheduler.job_rate_limiter = None


# What costs little is done first, so that whole chapters can be read while the others run.
PRIORITY = {"ch3": 3, "ch2": 2, "ch4": 1, "critique": 1, "ch5": 0, "claims": 0}  # others, which chapters need: 4
for made_by in workflow.rules:
    made_by.priority = PRIORITY.get(made_by.name.partition("_")[0], 4)
    if made_by.script:
        complete(made_by)


localrules:
    all,
    chapter2,
    chapter3,
    chapter4,
    chapter5,
    critique,


rule all:
    default_target: True
    input:
        rules.chapter2.input,
        rules.chapter3.input,
        rules.chapter4.input,
        rules.chapter5.input,
        rules.critique.input,
        rules.critique_proof.output,
        rules.claims.output,
        rules.findings.output,
        rules.provenance.output,
        rules.run_report.output,
