# Checked configuration, and what every rule needs.
import shlex
import sys
from pathlib import Path

sys.path.insert(0, workflow.basedir)  # makes thesis_lib importable in every script, on a cluster too

from thesis_lib.thesis.config import parse_config
from thesis_lib.datasets.sources.locate import SIMULATED, locate
from thesis_lib.datasets.sources.published import SOURCES
from thesis_lib.foundation.byte_code import keep_byte_code
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.provenance import Sources, value_sha256
from thesis_lib.foundation.yaml_file import read_yaml
from thesis_lib.thesis.records.catalogue import figures, records, tables_read

if Path(sys.executable).is_file():  # Snakemake puts it into commands without quotes (its issue 2645)
    sys.executable = shlex.quote(sys.executable)
keep_byte_code()  # jobs inherit it, as they do the kernels that `import thesis_lib` asks for

try:
    CONFIG = parse_config(config, workflow.configfiles)
except UserError as error:
    raise WorkflowError(str(error))


wildcard_constraints:
    dataset="[a-z][a-z0-9_]*",
    mechanism="block|ellipse|wheel|arm_disk",
    shape="block|ellipse",
    chapter="[2-5]",


SCRIPTS = {path.stem: path for path in Path(workflow.basedir, "workflow/scripts").glob("*/*.py")}
SOURCES_OF_SCRIPTS = Sources(workflow.basedir)


def code_of(script):
    """Hash of the code that a script uses: an edit in thesis_lib reruns exactly the rules that use it."""
    return SOURCES_OF_SCRIPTS.lib_hash(SCRIPTS[script])


def settings(section, *keys):
    """The named keys of a configuration section, so that a rule reruns only if one of them changes."""
    values = section.model_dump(mode="json", by_alias=True)
    return {key: values[key] for key in keys} if keys else values


REQUESTS = read_yaml(f"{workflow.basedir}/config/resources.yaml").content


def needs(rule):
    """Memory and time that a job asks of a cluster, from what it was measured to use; more after a failure."""
    return {
        "mem_mb": lambda wildcards, attempt: attempt * REQUESTS[rule]["mem_mb"],
        "runtime": lambda wildcards, attempt: attempt * REQUESTS[rule]["runtime"],
    }


try:
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
