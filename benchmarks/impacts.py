"""The impacts that benchmarks use: the measured ones where they are, else simulated ones like them."""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.results import at_least
from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.contact import LAWS
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.errors import UserError

ROOT = Path(__file__).resolve().parent.parent
SEARCH = (ROOT / "data/measured",)

# the ellipse of the planar impact experiment
AXES = (0.035, 0.025)  # m
BODY = {"mass": 0.0364, "k_g": 0.0192}
PARAMETERS = {"mu": 0.15, "epsilon": 0.55}


def falling_ellipses(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (n,), velocities (n, 3), contact points (n, 2) like the experiment's: about 2.5 m/s down, all slips."""
    theta = rng.uniform(0.0, 2.0 * np.pi, n)
    r = Ellipse(semi_axes=AXES).contact_point(theta)
    v_pre = rng.normal([0.0, -2.5, 0.0], [0.6, 0.2, 12.0], (n, 3))
    approaching = v_pre[:, 1] + r[:, 0] * v_pre[:, 2] < 0.0
    v_pre[~approaching, 2] = 0.0
    return theta, v_pre, r


def simulated_impacts(rng: np.random.Generator, n: int) -> Impacts:
    """n impacts like the experiment's: Wang-Mason with scattered (μ, ε) and noise."""
    _, v_pre, r = falling_ellipses(rng, n)
    mu, epsilon = rng.uniform(0.0, 0.25, n), rng.uniform(0.3, 0.8, n)
    v_post = LAWS["wang_mason"](v_pre, r, **BODY, mu=mu, epsilon=epsilon).v_post
    v_post += 0.05 * rng.standard_normal((n, 3)) / [1.0, 1.0, BODY["k_g"]]
    rows, q = np.arange(n), np.zeros((n, 3))
    return Impacts(rows, np.zeros(n, int), q, v_pre, v_post, r, BODY["k_g"], BODY["mass"])


def measured_impacts(folders: tuple[Path, ...]) -> Impacts | None:
    """The measured planar impacts, or None where they are not present."""
    from thesis_lib.datasets.read import read_dataset
    from thesis_lib.datasets.sources.published import convert_published, find_source

    name = "planar_impact"
    for base in folders:
        if (base / name / "dataset.yaml").is_file():
            return read_dataset(base / name).stated_impacts()
        if (source := find_source(name, base)) is not None:
            with tempfile.TemporaryDirectory() as converted:
                return read_dataset(convert_published(name, source, Path(converted) / name)).stated_impacts()
    return None


def add_impact_options(parser: argparse.ArgumentParser, n: int) -> None:
    """Options that say which impacts are used."""
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder that holds the measured datasets")
    parser.add_argument("--simulated", action="store_true", help="even if measured impacts are here")
    parser.add_argument("-n", type=at_least(1), default=n, metavar="N", help=f"impacts, at most ({n})")


def chosen_impacts(
    parser: argparse.ArgumentParser, options: argparse.Namespace, rng: np.random.Generator
) -> tuple[Impacts, str]:
    """All measured impacts, or N simulated ones where there are none; and "measured" or "simulated"."""
    measured = None
    try:
        if not options.simulated:
            measured = measured_impacts((options.data,) if options.data else SEARCH)
    except UserError as error:
        parser.error(str(error))
    if measured is not None:
        return measured, "measured"
    if options.data and not options.simulated:
        parser.error(f"there are no planar impacts in {options.data}; --simulated does without")
    return simulated_impacts(rng, options.n), "simulated"
