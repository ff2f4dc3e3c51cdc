"""Published measured datasets: their origins, their checksums, and the conversion of the two sets of Fazeli et al.

| name               | origin (repository at commit)                      | content                                   |
|--------------------|----------------------------------------------------|-------------------------------------------|
| `planar_impact`    | mcubelab/planar-impact-dataset, f24a7e3 (states:   | first impact of 1718 drops of an ellipse; |
|                    | 31b1787), Nima-Fazeli/contact_models_and_data,     | all 2000 drops with quality flags         |
|                    | fac1be5                                            |                                           |
| `planar_dice`      | Nima-Fazeli/residual-pybullet-public, 8f4f221      | 500 throws of a square at 250 Hz          |
| `contactnets_cube` | DAIRLab/contact-nets, c3dc21c (BSD-3-Clause)       | 570 tosses of a cube in space at 148 Hz   |

The first three repositories state no licence, so this project stores only the SHA-256 of each file, not the data; the
fourth is treated in the same way.  Values are converted as published: no sign is changed, no angle unwrapped, and no y
shifted to make the body touch the surface.  `thesis_lib/datasets/sources/published_tosses.py` converts the tosses.

The two publications of the impacts differ: vy_post in all_drops.csv (2017-02) is 3 g/250 s = 0.11772 m/s lower than in
impacts.csv (2017-11) for each of the 1718 drops in both; all other columns are equal to the last bit.  The stored
impulses (p_true, w_true) belong to impacts.csv.
"""

import hashlib
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import STATE
from thesis_lib.datasets.format.validate import first_of
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.datasets.sources import published_tosses
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_table
from thesis_lib.foundation.regular_file import is_file, read_bytes

Say = Callable[[str], None]

CHECKSUMS = Path(__file__).with_name("published_sha256.txt")
LAWS = ("drumwright_shell", "anitescu_potra_poisson", "anitescu_potra_newton", "mirtich", "wang_mason", "whittaker")
FLAGS = ("second_bounce", "energy", "coulomb", "max_compression", "dropped_early", "lost_data")
MAX_BYTES = 100_000_000  # limit for one published file; the largest has 2 MB
DICE_RATE = 250.0  # Hz, as documented by the authors
_STATES = "data_ellipse_2017-11-08_measured_y.mat"  # the later data_ellipse.mat holds a recomputed y
_PROCESSED = "mcubelab/planar-impact-dataset/f24a7e3b31ad0b53652d6b2a6b26a702cc4362da/processed_data"


@dataclass(frozen=True)
class PublishedSet:
    """Origin of a published set."""

    folders: tuple[str, ...]  # possible names of the folder of a local copy
    raw: dict[str, str]  # our file name -> owner/repository/commit/path, for files fetched one by one
    archive: tuple[str, str] | None = None  # owner/repository and commit of an archive to fetch instead
    inside: str = ""  # folder in the archive that holds the files
    needed: tuple[str, ...] = ()  # required files, the others being optional; (): all are required
    dimensions: int = 2  # of the motion of the body


SOURCES = {
    "planar_impact": PublishedSet(
        folders=("fazeli_planar_impact",),
        raw={
            _STATES: "mcubelab/planar-impact-dataset/31b1787625432b2ae4c1d409ea7c3334bb6e7fd9/processed_data/data.mat",
            **{
                f"{name}.mat": f"{_PROCESSED}/{name}.mat"
                for name in ("p_models", "v_models", "p_true_data", "w_true_data")
            },
            "ellipse_uniform_2000.mat": "Nima-Fazeli/contact_models_and_data/"
            "fac1be5dbfd34042ea0e47bdb24444013182f9e0/data/ellipse_uniform.mat",
        },
    ),
    "planar_dice": PublishedSet(
        folders=("fazeli_planar_dice/dice-data-processed", "dice-data-processed", "fazeli_planar_dice"),
        raw={},
        archive=("Nima-Fazeli/residual-pybullet-public", "8f4f2218d4c6d52ef30004592b14a988d624593f"),
        inside="dice-data-processed",
    ),
    "contactnets_cube": PublishedSet(
        folders=("contactnets_cube", "contact-nets/data"),
        raw={},
        archive=("DAIRLab/contact-nets", "c3dc21c94577ff4ed99123f0b00bfe57bb2d1d90"),
        inside="data",
        needed=(published_tosses.EXPERIMENT,),
        dimensions=3,
    ),
}


def published_name(name: str) -> str:
    """Our spelling of the name of a set: 'planar-impact' -> 'planar_impact'; UserError if there is no such set."""
    plain = name.replace("-", "_")
    if plain not in SOURCES:
        known = ", ".join(known.replace("_", "-") for known in SOURCES)
        raise UserError(f"There is no published dataset '{name}'; available: {known}.")
    return plain


def checksums(name: str) -> dict[str, str]:
    """SHA-256 (hex) of every source file of a published set, by file name, a path relative to the folder of the set."""
    lines = (line.split() for line in CHECKSUMS.read_text(encoding="ascii").splitlines())
    return {path.partition("/")[2]: digest for digest, path in lines if path.startswith(f"{name}/")}


def find_source(name: str, base: str | Path) -> Path | None:
    """The folder with the published files: `base` itself or a known subfolder; None if neither has them."""
    base, first = Path(base), next(iter((*SOURCES[name].needed, *checksums(name))))
    candidates = [base, *(base / folder for folder in SOURCES[name].folders)]
    return next((folder for folder in candidates if is_file(local_file(folder, first))), None)


def local_file(folder: str | Path, file: str) -> Path:
    """Path of a published file in a local copy: in its published subfolder or, if not there, directly in `folder`."""
    as_published = Path(folder, file)
    return as_published if is_file(as_published) else Path(folder, as_published.name)


def source_files(name: str, folder: str | Path) -> list[Path]:
    """The files of a local copy that a conversion reads; required files are included even if they are missing."""
    needed = SOURCES[name].needed
    files = {file: local_file(folder, file) for file in checksums(name)}
    return [path for file, path in files.items() if not needed or file in needed or is_file(path)]


def convert_published(name: str, source_dir: str | Path, out_dir: str | Path, note: Say = lambda text: None) -> Path:
    """Convert the files in `source_dir` (or a known subfolder) into `out_dir`; UserError unless they are as published.

    `note` receives a line about optional files that the copy lacks.
    """
    name = published_name(name)
    folder = find_source(name, source_dir)
    if folder is None:
        first = (*SOURCES[name].needed, *checksums(name))[0]
        raise UserError(
            f"{source_dir} does not contain the published set {name}: {first} is missing. "
            "Give the folder with the files as published."
        )
    return convert_files(name, {path: local_file(folder, path) for path in checksums(name)}, out_dir, note)


def convert_files(name: str, files: dict[str, Path], out_dir: str | Path, note: Say = lambda text: None) -> Path:
    """Check the SHA-256 of every file, then convert; `files` maps the names in the list of checksums to paths."""
    content, missing, wrong, needed = {}, [], [], SOURCES[name].needed
    for file, digest in checksums(name).items():
        if not is_file(files[file]):
            missing.append(file)
            continue
        content[file] = read_bytes(files[file], MAX_BYTES)
        if hashlib.sha256(content[file]).hexdigest() != digest:
            wrong.append(file)
    optional = [file for file in missing if needed and file not in needed]
    lacking = [file for file in missing if file not in optional]
    if not lacking and not wrong and not set(content) - set(needed):
        lacking = optional
    for bad, what in ((lacking, "missing"), (wrong, "not the published ones (SHA-256 differs)")):
        if bad:
            raise UserError(
                f"Files of {name} are {what}: {first_of(bad)}. Nothing was written. "
                f"Get them again: thesis-lib datasets fetch {name.replace('_', '-')}"
            )
    if optional:
        note(published_tosses.absent_tosses(len(files) - len(needed), optional))
    convert = {
        "planar_impact": _convert_impact,
        "planar_dice": _convert_dice,
        "contactnets_cube": published_tosses.convert_tosses,
    }
    return convert[name](content, Path(out_dir))


def _convert_impact(content: dict[str, bytes], out_dir: Path) -> Path:
    from scipy.io import loadmat

    def load(file: str, variable: str) -> np.ndarray:
        return loadmat(io.BytesIO(content[file]))[variable]

    data = load(_STATES, "data")[0, 0]
    rows = len(data["states_i"])
    table = _states(data["states_i"], data["states_f"], data["n"], data["d"])
    table.insert(0, "trial", np.arange(rows))
    table.insert(1, "impact", 0)

    impulse, velocity = load("p_models.mat", "p_models"), load("v_models.mat", "v_models")
    predictions = {"trial": np.arange(rows)}
    for i, law in enumerate(LAWS):
        parts = [*impulse[:, 2 * i : 2 * i + 2].T, *velocity[:, 3 * i : 3 * i + 3].T]
        predictions |= {f"{law}_{name}": part for name, part in zip(("p_t", "p_n", "vx", "vy", "omega"), parts)}
    p_true, w_true = load("p_true_data.mat", "p_data"), load("w_true_data.mat", "W")
    predictions |= {f"p_true_{part}": p_true[:, j] for j, part in enumerate("tn")}
    predictions |= {f"w_true_{part}": w_true[:, j] for j, part in enumerate(("x", "y", "tau"))}

    bounces = load("ellipse_uniform_2000.mat", "bounce_array").ravel()
    states = np.stack([np.ravel(bounce["states"]) for bounce in bounces])
    n, d = (np.stack([np.ravel(bounce[name]) for bounce in bounces]) for name in "nd")
    drops = _states(states[:, :6], states[:, 6:], n, d)
    drops.insert(0, "trial", np.arange(len(drops)))
    drops[["x_post", "y_post", "theta_post"]] = states[:, 6:9]
    flags = np.stack([np.ravel(bounce["flags"]) for bounce in bounces]).astype(int)
    drops[[f"flag_{name}" for name in FLAGS]] = flags[:, : len(FLAGS)]

    out_dir.mkdir(parents=True, exist_ok=True)
    write_table(pd.DataFrame(predictions), out_dir / "published_predictions.csv", float_format=None)
    write_table(drops, out_dir / "all_drops.csv", float_format=None)
    return write_dataset(Dataset("planar_impact", _IMPACT_HEADER, impacts=table), out_dir, float_format=None)


def _states(before: np.ndarray, after: np.ndarray, n: np.ndarray, d: np.ndarray) -> pd.DataFrame:
    """Pose and velocity before, velocity after; contact point, from J_n = (0, 1, r_x) and J_t = (1, 0, −r_y)."""
    values = np.column_stack([before, after[:, 3:], n[:, 2], -d[:, 2]])
    return pd.DataFrame(values, columns=[*STATE, "r_x", "r_y"])


def _convert_dice(content: dict[str, bytes], out_dir: Path) -> Path:
    throws = sorted((int(file.removeprefix("traj_").removesuffix(".csv")), file) for file in content)
    tables = []
    for number, file in throws:
        # the velocity columns vx, vz, vth are smoothed across impacts and therefore left out
        log = pd.read_csv(io.BytesIO(content[file]))
        t = np.arange(len(log)) / DICE_RATE
        tables.append(pd.DataFrame({"trial": number, "t": t, "x": log["x"], "y": log["z"], "theta": log["th"]}))
    poses = pd.concat(tables, ignore_index=True)
    return write_dataset(Dataset("planar_dice", _DICE_HEADER, poses), out_dir, float_format=None)


_IMPACT_HEADER = Header.model_validate(
    {
        "schema": 1,
        "description": "Planar impacts of an ellipse (PLA on aluminium), Fazeli et al.: the first impact of each of "
        "the 1718 drops kept by the authors, values as published (github.com/mcubelab/planar-impact-dataset, states "
        "of 2017-11-08 with the measured y). y is measured and need not touch the surface; r_x and r_y are the "
        "published contact points; the radius of gyration is that of the authors' code (k² = 3.7e-4 m², not a "
        "uniform plate); noise is not published. published_predictions.csv: the authors' stored predictions and "
        "impulses (N s). all_drops.csv: all 2000 drops with the authors' quality flags, from an earlier "
        "publication whose vy_post is 3 g/250 s = 0.11772 m/s lower.",
        "body": {
            "shape": {"kind": "ellipse", "semi_axes": [0.035, 0.025]},
            "mass": 0.0364,
            "radius_of_gyration": float(np.sqrt(3.7e-4)),
        },
        "surface": {"height": 0.0},
        "gravity": 9.81,
    }
)
_DICE_HEADER = Header.model_validate(
    {
        "schema": 1,
        "description": "Planar throws of a square die, Fazeli et al.: 500 throws, poses as published "
        "(github.com/Nima-Fazeli/residual-pybullet-public; z is y here; the stored velocities are smeared across "
        "impacts and left out; the sense of theta is not documented, but only counter-clockwise fits the "
        "measured impacts). The surface is at 0 in the published frame, "
        "but at rest the centre is at 0.030 to 0.033 m, so the frame is up to 3 mm off. The mass is not published.",
        "body": {
            "shape": {"kind": "polygon", "vertices": [[0.03, 0.03], [-0.03, 0.03], [-0.03, -0.03], [0.03, -0.03]]},
            "radius_of_gyration": float(0.06 / np.sqrt(6.0)),
        },
        "surface": {"height": 0.0},
        "gravity": 9.81,
        "rate": DICE_RATE,
    }
)
