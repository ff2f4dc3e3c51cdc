"""The configuration of the pipeline as typed, checked data; the JSON schema is generated from it.

    python -m thesis_lib.config          writes config/schema.json (a test says when it is out of step)

Every number that is a choice of ours, because the thesis does not give it, says so in its description.
"""

import json
import sys
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.datasets.arcs import ArcSettings
from thesis_lib.datasets.header import Body, Noise
from thesis_lib.errors import UserError
from thesis_lib.simulate.drops import Release

SCHEMA = Path("config/schema.json")
Share = Annotated[float, Field(gt=0, lt=1)]
Count = Annotated[int, Field(ge=1)]
DatasetName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
# spelled out, because importing the laws would make every rule with a configuration rerun when one is edited
LawName = Literal[
    "drumwright_shell",
    "anitescu_potra_poisson",
    "anitescu_potra_newton",
    "mirtich",
    "wang_mason",
    "whittaker",
    "drumwright_shell_as_published",
    "anitescu_potra_poisson_as_published",
    "mirtich_as_published",
    "whittaker_as_published",
]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SimulatedDrops(_Section):
    """Simulated drops of the chapter's ellipse, `data/simulated/drops`."""

    n: Count = Field(2000, description="drops, as many as the thesis measured")
    body: Body = Field(
        Body(shape=Ellipse(semi_axes=(0.035, 0.025)), mass=0.0364, radius_of_gyration=0.019235384061671346),
        description="ellipse of chapter 3; k² = 3.7e-4 m² as in the authors' code",
    )
    mu: float = Field(0.1, ge=0, description="own choice, near table 3.1")
    epsilon: float = Field(0.55, ge=0, le=1, description="own choice, near table 3.1")
    release: Release = Field(Release(), description="states like those of the experiment")
    gravity: float = Field(9.81, gt=0, description="m/s²")
    rate: float = Field(250.0, gt=0, description="Hz, as the motion capture of the thesis")
    dt: float = Field(1e-3, gt=0, description="s, time step; own choice")
    duration: float = Field(0.8, gt=0, description="s a drop; own choice: two to three bounces")
    noise: Noise = Field(
        Noise(position=3e-4, angle=3e-3), description="one sigma of the motion capture; own choice"
    )


class Convergence(_Section):
    """Ensemble parameters against the number of impacts (figure 3-7 b)."""

    laws: tuple[LawName, ...] = Field(
        ("anitescu_potra_newton", "whittaker_as_published"), description="laws to follow"
    )
    subsets: Count = Field(3, description="random subsets, as in the thesis")
    sizes: tuple[Count, ...] = Field(
        (5, 10, 15, 20, 30, 40, 50, 60, 80, 100, 125, 150, 200, 250, 300, 400, 500, 600, 800),
        description="numbers of impacts k; larger than the training set: all of it",
    )


class Topography(_Section):
    """Cost over (μ, ε) (figure 3-7 a)."""

    law: LawName = Field("whittaker_as_published", description="the thesis shows the Whittaker model")
    n: Count = Field(150, description="impacts in the sum, as in the thesis")
    points: Annotated[int, Field(ge=5)] = Field(41, description="a side of the grid")
    mu: tuple[float, float] = Field((0.0, 0.4), description="range of μ; own choice")
    epsilon: tuple[float, float] = Field((0.2, 0.9), description="range of ε; own choice")

    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Grid lines in μ and ε."""
        return np.linspace(*self.mu, self.points), np.linspace(*self.epsilon, self.points)


class Chapter3(_Section):
    """The impact study."""

    datasets: tuple[DatasetName, ...] = Field(
        ("planar_impact", "planar_dice", "drops"),
        description="datasets to study; measured ones that are not present are left out, and said so",
    )
    filter: Literal["keep", "thesis"] = Field(
        "keep",
        description="keep impacts that fail the energy, cone or compression test, or drop them as the thesis did",
    )
    max_impacts: Count | None = Field(
        2000, description="impacts used a dataset, drawn at random: as many as the thesis measured; null: all"
    )
    train_share: Share = Field(
        0.5, description="share of trials for identification; own choice: the thesis gives no number"
    )
    metric: Literal["impulse", "velocity"] = Field("impulse", description="cost of eq. 3.8")
    bootstrap: Annotated[int, Field(ge=2)] = Field(200, description="replicates for standard errors")
    convergence: Convergence = Convergence()
    topography: Topography = Topography()
    range_tolerances: tuple[float, ...] = Field(
        (1e-4, 3e-4, 1e-3),
        description="N s; an outcome is in range if a law comes as near as this. The thesis gives none; "
        "its numbers fit 1e-4",
    )


class Config(_Section):
    """The whole configuration; `config/config.yaml` spells out the defaults, overlays change some of them."""

    scale: Literal["quick", "default", "full"] = Field("default", description="names the stored expectations")
    seed: Annotated[int, Field(ge=0)] = Field(
        20190906, description="the one seed; every rule derives its own stream from it"
    )
    measured: tuple[str, ...] = Field(
        ("data/measured", "../shared/data"),
        description="folders searched for the measured datasets, in order",
    )
    drops: SimulatedDrops = SimulatedDrops()
    arcs: ArcSettings = Field(ArcSettings(), description="detection of impacts and arc fits")
    chapter3: Chapter3 = Chapter3()


def parse_config(values: dict, source: str = "configuration") -> Config:
    """Check a configuration that was read from YAML.

    Raises:
        UserError: lists every unknown key and wrong value, with its place.
    """
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        lines = [f"The {source} has {error.error_count()} mistake(s):"]
        for item in error.errors():
            place = ".".join(str(part) for part in item["loc"]) or "(top level)"
            lines.append(f"  {place}: {item['msg']} (got {item['input']!r})"[:300])
        lines.append("docs/configuration and config/schema.json list every key with its meaning.")
        raise UserError("\n".join(lines)) from error


def read_config(*paths: str | Path) -> Config:
    """Read a configuration; later files overlay earlier ones, section by section.

    Raises:
        UserError: a file is missing, is not YAML, or the merged configuration is wrong.
    """
    merged: dict = {}
    for path in paths:
        try:
            values = yaml.safe_load(Path(path).read_text(encoding="utf-8")) or {}
        except FileNotFoundError as error:
            raise UserError(f"There is no configuration file {path}.") from error
        except yaml.YAMLError as error:
            raise UserError(f"{path} is not valid YAML: {error}") from error
        if not isinstance(values, dict):
            raise UserError(f"{path} must hold keys and values, found a {type(values).__name__}.")
        _overlay(merged, values)
    return parse_config(merged, " + ".join(map(str, paths)))


def _overlay(base: dict, values: dict) -> None:
    for key, value in values.items():
        if isinstance(value, dict) and isinstance(base.get(key), dict):
            _overlay(base[key], value)
        else:
            base[key] = value


def schema_text() -> str:
    """The JSON schema of the configuration."""
    return json.dumps(Config.model_json_schema(), indent=1, sort_keys=True, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    from thesis_lib.files import write_text

    write_text(schema_text(), SCHEMA)
    print(f"wrote {SCHEMA}", file=sys.stderr)
