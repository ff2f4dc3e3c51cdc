# Checked configuration, and what every rule needs.
import sys
from pathlib import Path

sys.path.insert(0, workflow.basedir)  # makes thesis_lib importable in every script, on a cluster too

from thesis_lib.config import parse_config
from thesis_lib.datasets.sources.locate import SIMULATED, locate
from thesis_lib.datasets.sources.published import SOURCES
from thesis_lib.foundation.errors import UserError
from thesis_lib.findings import chapter2, chapter3, chapter4, chapter5
from thesis_lib.findings.catalogue import FINDINGS
from thesis_lib.findings.finding import read_from
from thesis_lib.foundation.provenance import lib_hash, value_sha256
from thesis_lib.resources import read_measured, request

try:
    CONFIG = parse_config(config)
except UserError as error:
    raise WorkflowError(str(error))


wildcard_constraints:
    dataset="[a-z][a-z0-9_]*",
    mechanism="block|ellipse|wheel|arm_disk",
    shape="block|ellipse",


SCRIPTS = {path.stem: path for path in Path(workflow.basedir, "workflow/scripts").glob("*/*.py")}


def code_of(script):
    """Hash of the code that a script uses: an edit in thesis_lib reruns exactly the rules that use it."""
    return lib_hash(SCRIPTS[script])


def settings(section, *keys):
    """The named keys of a configuration section, so that a rule reruns only if one of them changes."""
    values = section.model_dump(mode="json", by_alias=True)
    return {key: values[key] for key in keys} if keys else values


try:
    MEASURED = read_measured(f"{workflow.basedir}/config/resources.yaml")
except UserError as error:
    raise WorkflowError(str(error))


def needs(rule):
    """Memory and time that a job asks of a cluster, from what it was measured to use; more after a failure."""
    return {
        "mem_mb": lambda wildcards, attempt: request(MEASURED, rule, attempt).mem_mb,
        "runtime": lambda wildcards, attempt: request(MEASURED, rule, attempt).runtime,
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


def figure_files(folder, number, shows, subcategory="{dataset}", name="figure"):
    """Picture, PDF and numbers of the thesis's figure `number` ("3-7"); the picture goes into the report."""
    name = f"{name}_{number.replace('-', '_')}"
    picture = report(
        f"{folder}/{name}.png",
        caption=f"../report/{name}.rst",
        category=f"Chapter {number[0]}",
        subcategory=subcategory,
        labels={
            "item": f"{name.rsplit('_', 2)[0].replace('_', ' ').capitalize()} {number}",
            "shows": shows,
        },
    )
    return [picture, f"{folder}/{name}.pdf", f"{folder}/{name}.csv"]
