"""The configuration of the pipeline as typed, checked data, from which the JSON schema is generated.

    python -m thesis_lib.thesis.config          writes config/schema.json (a test reports an outdated file)

Numbers that we chose, because the thesis does not give them, are marked as own choices in their descriptions.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from thesis_lib.critique.drops.settings import CritiqueRun, Name
from thesis_lib.critique.mechanisms.settings import HiddenStudy
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.foundation import SEED
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.mistakes import LONGEST, Place, dotted, mistakes_in
from thesis_lib.foundation.regular_file import MissingFile
from thesis_lib.foundation.settings import Section, merged
from thesis_lib.foundation.yaml_file import Document, read_yaml
from thesis_lib.jenga.play.settings import Chapter5
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.simulate.mechanisms.scenes import SceneSettings
from thesis_lib.simulate.rig.settings import SimulatedDrops
from thesis_lib.thesis.identify.arm.settings import ArmStudy
from thesis_lib.thesis.identify.impacts.settings import ImpactForces, MeasuredRatio
from thesis_lib.thesis.identify.settings import Programs, Table21, WheelStudy
from thesis_lib.thesis.impact_study.settings import Chapter3
from thesis_lib.thesis.residual.dice.settings import DiceStudySettings
from thesis_lib.thesis.residual.settings import LearningStudySettings

SCHEMA = Path("config/schema.json")
SHOWN = 100  # mistakes listed in full
WIDEST = 500  # characters of one mistake


class Chapter2(Section):
    """Settings of chapter 2, contact-implicit identification."""

    bodies: Chapter2Bodies = Chapter2Bodies()
    scenes: SceneSettings = SceneSettings()
    programs: Programs = Programs()
    table_2_1: Table21 = Table21()
    wheel: WheelStudy = WheelStudy()
    arm: ArmStudy = ArmStudy()
    impact_forces: ImpactForces = ImpactForces()
    measured_ratio: MeasuredRatio = MeasuredRatio()
    hidden: HiddenStudy = HiddenStudy()


class Chapter4(Section):
    """Settings of chapter 4, learned contact models."""

    datasets: tuple[Name, ...] = Field(
        ("planar_impact", "planar_dice", "drops"),
        description="datasets to learn from; missing measured datasets are left out and reported",
    )
    dice_datasets: tuple[Name, ...] = Field(
        ("planar_dice",),
        description="throws of a square to follow to rest; datasets that are not also in `datasets` and criticised "
        "are left out",
    )
    learning: LearningStudySettings = LearningStudySettings()
    dice: DiceStudySettings = DiceStudySettings()


class Config(Section):
    """The whole configuration; `config/config.yaml` states the defaults, overlays change some of them."""

    scale: Literal["quick", "default"] = Field("default", description="selects the stored expectations")
    seed: Annotated[int, Field(ge=0)] = Field(
        SEED, description="the only seed; every rule derives its own stream from it"
    )
    measured: tuple[str, ...] = Field(
        ("data/measured",), description="folders that are searched for measured datasets, in order"
    )
    drops: SimulatedDrops = SimulatedDrops()
    arcs: ArcSettings = Field(ArcSettings(), description="detection of impacts and arc fits")
    first_trials: dict[Name, Annotated[int, Field(ge=10)]] = Field(
        {}, description="dataset -> number of first trials in which chapters 2 to 4 search impacts; default: all"
    )
    chapter2: Chapter2 = Chapter2()
    chapter3: Chapter3 = Chapter3()
    chapter4: Chapter4 = Chapter4()
    chapter5: Chapter5 = Chapter5()
    critique: CritiqueRun = CritiqueRun()


def parse_config(values: dict, files: Sequence[str | Path] = ()) -> Config:
    """Validate a configuration read from YAML.

    `files` are its sources; later files override earlier ones.  UserError lists every unknown key and wrong
    value with its file and line.
    """
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        schema, documents = Config.model_json_schema(), {str(path): read_yaml(path) for path in files}
        source = f" ({' + '.join(documents)})" if documents else ""
        lines = [f"The configuration{source} has {error.error_count()} mistake(s):"]
        for mistake in islice(mistakes_in(error, values, {}, schema), SHOWN):
            key = dotted(tuple(part[:LONGEST] if isinstance(part, str) else part for part in mistake.place))
            lines.append(f"  {_line(mistake.place, documents)}{mistake.of(key or '(top level)')}"[:WIDEST])
        if error.error_count() > SHOWN:
            lines.append(f"  ... and {error.error_count() - SHOWN} more")
        lines.append(f"{SCHEMA} lists every key with its meaning.")
        raise UserError("\n".join(lines)) from error


def _line(place: Place, documents: Mapping[str, Document]) -> str:
    """File and line of a place, in the last file that sets it; empty if none does (as with snakemake's `--config`)."""
    found = [
        (n, f"{path}, line {document.lines[place[:n]]}: ")
        for path, document in documents.items()
        for n in range(1, len(place) + 1)
        if place[:n] in document.lines
    ]
    return max(reversed(found), key=itemgetter(0), default=(0, ""))[1]


def read_config(*paths: str | Path) -> Config:
    """Read a configuration; later files override earlier ones, section by section.

    UserError if a file is missing or not plain YAML, or if the merged configuration is wrong.
    """
    content: dict = {}
    for path in paths:
        try:
            document = read_yaml(path)
        except MissingFile as error:
            raise UserError(f"There is no configuration file {path}.") from error
        document.refuse_repeated(path)
        values = {} if document.content is None else document.content
        if not isinstance(values, dict):
            raise UserError(f"{path} must contain keys and values, found a {type(values).__name__}.")
        content = merged(content, values)
    return parse_config(content, paths)


def schema_text() -> str:
    """Return the JSON schema of the configuration."""
    return json.dumps(Config.model_json_schema(), indent=1, sort_keys=True, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    from thesis_lib.foundation.files import write_text

    write_text(schema_text(), SCHEMA)
    print(f"wrote {SCHEMA}", file=sys.stderr)
