# Checked configuration, and what every rule needs.
import sys
from pathlib import Path

sys.path.insert(0, workflow.basedir)  # makes thesis_lib importable in every script, on a cluster too

from thesis_lib.config import parse_config
from thesis_lib.datasets.published import find_measured
from thesis_lib.errors import UserError
from thesis_lib.provenance import lib_hash

try:
    CONFIG = parse_config(config)
except UserError as error:
    raise WorkflowError(str(error))


wildcard_constraints:
    dataset="[a-z][a-z0-9_]*",


def code_of(script):
    """Hash of the code that a script uses: an edit in thesis_lib reruns exactly the rules that use it."""
    return lib_hash(f"{workflow.basedir}/workflow/scripts/{script}.py")


def settings(section, *keys):
    """The named keys of a configuration section, so that a rule reruns only if one of them changes."""
    values = section.model_dump(mode="json", by_alias=True)
    return {key: values[key] for key in keys} if keys else values


MEASURED = {name: find_measured(name, CONFIG.measured) for name in ("planar_impact", "planar_dice")}
SIMULATED = ("drops",)


def is_present(dataset):
    return dataset in SIMULATED or MEASURED.get(dataset) is not None


def dataset_folder(dataset):
    """Folder of a dataset in our format: where the user has it, or where the pipeline makes it."""
    if dataset in SIMULATED:
        return f"data/simulated/{dataset}"
    folder = MEASURED[dataset]
    return str(folder) if (folder / "dataset.yaml").is_file() else f"results/datasets/{dataset}"


def dataset_file(wildcards):
    return f"{dataset_folder(wildcards.dataset)}/dataset.yaml"


def figure_files(folder, number, shows, subcategory="{dataset}"):
    """Picture, PDF and numbers of the thesis's figure `number` ("3-7"); the picture goes into the report."""
    name = f"figure_{number.replace('-', '_')}"
    picture = report(
        f"{folder}/{name}.png",
        caption=f"../report/{name}.rst",
        category=f"Chapter {number[0]}",
        subcategory=subcategory,
        labels={"item": f"Figure {number}", "shows": shows},
    )
    return [picture, f"{folder}/{name}.pdf", f"{folder}/{name}.csv"]
