# Checked configuration, and what every rule needs.
import re
import shlex
import sys
from pathlib import Path

from snakemake.resources import Resources

sys.path.insert(0, workflow.basedir)  # makes thesis_lib importable in every script, on a cluster too

from thesis_lib.thesis.config import parse_config
from thesis_lib.datasets.sources.locate import SIMULATED, locate
from thesis_lib.datasets.sources.published import SOURCES
from thesis_lib.foundation.byte_code import keep_byte_code
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.provenance import Sources, value_sha256
from thesis_lib.foundation.yaml_file import read_yaml
from thesis_lib.thesis.ledger.format import read_ledger
from thesis_lib.thesis.records.catalogue import figures, records, tables_read

if Path(sys.executable).is_file():  # Snakemake puts it into commands without quotes (its issue 2645)
    sys.executable = shlex.quote(sys.executable)
keep_byte_code()  # jobs inherit it, as they do the kernels that `import thesis_lib` asks for

try:
    CONFIG = parse_config(config, workflow.configfiles)
    DATASETS = {
        name: locate(name, CONFIG.measured)
        for name in dict.fromkeys(
            (
                *CONFIG.chapter3.datasets,
                *CONFIG.chapter4.datasets,
                *CONFIG.critique.datasets,
                *SOURCES,
                *SIMULATED,
            )
        )
    }
except UserError as error:
    raise WorkflowError(str(error))


wildcard_constraints:
    dataset="[a-z][a-z0-9_]*",
    mechanism="block|ellipse|wheel|arm_disk",
    shape="block|ellipse",
    chapter="[2-5]",


SOURCES_OF_SCRIPTS = Sources(workflow.basedir)


def settings(section, *keys):
    """The named keys of a configuration section, so that a rule reruns only if one of them changes."""
    values = section.model_dump(mode="json", by_alias=True)
    return {key: values[key] for key in keys} if keys else values


REQUESTS = read_yaml(f"{workflow.basedir}/config/resources.yaml").content


def complete(made_by):
    """Add log, benchmark, environment, resources and the hash of its code, which all have that run a script.

    The memory and time that a job asks of a cluster follow from what it was measured to use; more after a failure.
    """
    first = made_by.output[0] if made_by.output else ""  # none where no set is criticised
    wildcards = "_".join(f"{{{name}}}" for name in dict.fromkeys(re.findall(r"{(\w+)", first)))
    name = f"{made_by.name}/{wildcards}" if wildcards else made_by.name
    made_by.log_modifier = made_by.benchmark_modifier = made_by.output_modifier
    made_by.set_log(f"results/logs/{name}.log")
    made_by.benchmark = f"results/logs/benchmarks/{name}.tsv"
    made_by.conda_env = "../envs/thesis.yaml"
    asked = REQUESTS[made_by.name]
    made_by.resources.update(
        Resources.from_mapping(
            {
                "mem_mb": lambda wildcards, attempt: attempt * asked["mem_mb"],
                "runtime": lambda wildcards, attempt: attempt * asked["runtime"],
            }
        )
    )
    made_by.resources.update(workflow.resource_settings.overwrite_resources.get(made_by.name, {}))  # --set-resources
    script = Path(workflow.basedir, "workflow/rules", made_by.script)
    made_by.set_params(lib=SOURCES_OF_SCRIPTS.lib_hash(script))  # an edit reruns exactly the rules that use it


def dataset_files(wildcards):
    """All files of a dataset, so that what reads it reruns when any of them changes."""
    return DATASETS[wildcards.dataset].files


def shown(name, file=None):
    """The file of a record, or another one with its caption, in Snakemake's report."""
    record = records()[name]
    return report(
        file or f"results/{record.file}",
        caption=f"../../results/captions/{name}.rst",
        category=f"Chapter {record.chapter}" if record.chapter else "Critique and claims",
        subcategory=record.job.group or ("{dataset}" if "{dataset}" in record.file else None),
        labels={"item": record.label, "shows": record.title},
    )


def drawn_by(rule):
    """Picture, PDF and numbers of each figure that a rule draws."""
    return [
        [shown(figure.name), *(f"results/{Path(figure.file).with_suffix(kind)}" for kind in (".pdf", ".csv"))]
        for figure in figures()
        if figure.job.rule == rule
    ]


def chapter_page(chapter):
    """The page of one chapter, beside that of the whole run."""
    return f"results/report_chapter{chapter}.html"


def made_by_chapter(wildcards):
    """All that a chapter asks for, except the page of it."""
    files = getattr(rules, f"chapter{wildcards.chapter}").input
    return [file for file in files if file != chapter_page(wildcards.chapter)]


def findings_of(chapter, datasets=(), **of_rules):
    """What is said of a chapter's figures and tables, for these datasets or for those of the rule that makes them."""
    return [
        f"results/{record.job.folder}/{record.name}.txt".replace("{dataset}", dataset)
        for record in records().values()
        if record.chapter == chapter and record.finding
        for dataset in (of_rules.get(record.job.rule, datasets) if "{dataset}" in record.file else [""])
    ]


def tables_of_claims(wildcards):
    """The tables that the ledger reads: those of the claims whose data this run has."""
    present = {name for name, dataset in PRESENT.items() if dataset["present"]}
    claims = read_ledger("config/claims").claims
    return sorted({f"results/{claim.source.file}" for claim in claims if present.issuperset(claim.needs)})


def ch5_learned_from(wildcards):
    """What a policy learns from: a set of samples, weights of PPO, or nothing."""
    if wildcards.policy == "ppo":
        return [f"{CH5}/ppo/policy_{wildcards.size}.pt"]
    if wildcards.policy in CONFIG.chapter5.games.fixed:
        return []
    return [CH5_SETS[CONFIG.chapter5.samples.of_game(int(wildcards.tower))]]


def ch5_scans(first, count):
    """Scans of towers first, first + 1, ..."""
    return [f"{CH5}/scans/tower_{seed}.csv" for seed in range(first, first + count)]
