"""Analysis of measured throws of a body with faces, without any contact law: rest poses, and inertia.

    python -m thesis_lib.studies.proof law-free data/measured/planar_dice

*At rest*, a face lies on the surface.  The measured angle minus the angle of the face is then the camera's error; the
height of the tracked point over that face shows where the point lies, and how flat the surface is.

*Inertia.*  One impulse at the contact point r turns a body by Δω = (m/I) (r_x Δv_y − r_y Δv_x), under any law
(`thesis_lib/thesis/identify/impacts/measured_ratio.py`).  This neglects a second corner that touches at the same time,
which is possible near flat only: m/I by ranges of the angle from flat shows whether this occurs.
"""

from itertools import pairwise

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE
from thesis_lib.datasets.impacts.detect import find_impacts
from thesis_lib.datasets.impacts.quality import has_flag
from thesis_lib.effects.effect import Rig
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.thesis.identify.impacts.measured_ratio import BENT, ImpactLink, bootstrap, fit_ratio

LAST = 10  # samples at the end of a throw by which rest is judged
STILL = np.array([1e-3, 1e-3, 0.02])  # m, m, rad: largest range of these samples at rest
PLACES = 8  # sections along the surface, with equal numbers of throws
RANGES = (5.0, 12.0, 20.0, 30.0, 45.0)  # ° from flat
VARIANTS = (("angle_offset",), ("angle_offset", "rounded_corners"))
DRAWS = 100
SEED = 0


def at_rest(dataset: Dataset) -> pd.DataFrame:
    """Throws that end at rest: angle of the face in °, angle from the face in rad, x and height y in m.

    UserError if there are no trajectories, or the body has no faces.
    """
    if not isinstance(dataset.shape, Polygon):
        raise UserError(f"A body of shape {dataset.shape.kind} has no faces; this analysis needs a polygon.")
    if dataset.trajectories is None:
        raise UserError(f"{dataset.name} has no trajectories, so rest poses cannot be determined.")
    ends = dataset.trajectories.groupby("trial")[list(POSE)].apply(lambda poses: poses.tail(LAST))
    by_trial = ends.groupby("trial")
    still = ((by_trial.max() - by_trial.min()) < STILL).all(axis=1)
    pose = by_trial.mean()[still]
    theta = pose["theta"].to_numpy()
    flat = dataset.shape.lying(theta)
    face = np.round(np.degrees(flat)).astype(int) % 360
    return pd.DataFrame({"face": face, "angle": theta - flat, "x": pose["x"], "y": pose["y"] - dataset.height})


def inertia(dataset: Dataset, camera: float) -> pd.DataFrame:
    """Measured m/I relative to its value from the stated radius of gyration, by range of angle from flat and variant.

    `camera` is the angle in rad that is measured where a face lies flat.  Columns: low, high (°), hits, variant, ratio
    (1), std (1, bootstrap over trials).  The rotation of the body during a contact of 1 ms adds up to 4 %.
    """
    impacts = find_impacts(dataset).impacts
    impacts = impacts.select(~has_flag(impacts, BENT))
    rig = Rig(dataset.shape, dataset.k_g, dataset.gravity, dataset.height)
    theta = impacts.q[:, 2] - camera
    angle = np.degrees(np.abs(theta - rig.shape.lying(theta)))
    rows = []
    for low, high in [*pairwise(RANGES), (0.0, RANGES[-1])]:
        inside = impacts.select((angle >= low) & (angle <= high))
        for variant in VARIANTS:
            link = ImpactLink(inside, rig, variant)
            fitted = fit_ratio(link)
            draws = bootstrap(link, fitted, DRAWS, generator(SEED, *variant))[:, 0]
            ratio, std = rig.k_g**2 * fitted.p[0], rig.k_g**2 * draws.std(ddof=1)
            rows.append((low, high, len(inside), "+".join(variant), ratio, std))
    return pd.DataFrame(rows, columns=["low", "high", "hits", "variant", "ratio", "std"])


def evenness(lying: pd.DataFrame) -> tuple[float, float]:
    """Shares of the variance of the heights of `at_rest` that a line and a parabola in x explain (curved surface).

    Heights are relative to the median of their face; heights beyond four median deviations are left out.
    """
    y = lying["y"] - lying.groupby("face")["y"].transform("median")
    near = np.abs(y) <= 4.0 * np.median(np.abs(y))
    x, y = lying["x"][near].to_numpy(), y[near].to_numpy()
    left = [np.mean((y - np.polynomial.Polynomial.fit(x, y, degree)(x)) ** 2) for degree in (0, 1, 2)]
    return 1.0 - left[1] / left[0], 1.0 - left[2] / left[0]


def as_text(dataset: Dataset) -> str:
    """Text with the heights at rest, by face and by place, and the inertia."""
    lying = at_rest(dataset)
    camera = float(lying["angle"].median())
    places = lying.groupby(pd.qcut(lying["x"], PLACES), observed=True)["y"]
    return "\n".join(
        [
            f"{len(lying)} throws lie still, {camera:.4f} rad from flat (median)",
            lying.groupby("face")["y"].agg(["count", "median"]).round(5).to_string(),
            places.agg(["count", "median", "std"]).round(5).to_string(),
            "of the variance of these heights a line explains {:.2f}, a parabola {:.2f}".format(*evenness(lying)),
            inertia(dataset, camera).round(3).to_string(index=False),
        ]
    )
