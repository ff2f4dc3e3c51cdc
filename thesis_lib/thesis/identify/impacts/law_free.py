"""Measured throws of a body with faces without any contact law: how it lies at rest, and its inertia.

    python -m thesis_lib.studies.proof law-free data/measured/planar_dice

*At rest* a face lies on the surface.  The angle that is measured then, less that of the face, is the camera's; the
height of the tracked point over that face says where the point is, and how flat the surface.

*Inertia.*  One impulse at the contact point r turns a body by Δω = (m/I) (r_x Δv_y − r_y Δv_x), under any law
(`thesis_lib/thesis/identify/impacts/measured_ratio.py`).  A second corner that touches at the same time, which this
neglects, can do so near flat only: m/I by ranges of the angle from flat tells the two apart.
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

LAST = 10  # samples of a throw that lies still
STILL = np.array([1e-3, 1e-3, 0.02])  # m, m, rad: their range
PLACES = 8  # along the surface, with as many throws each
RANGES = (5.0, 12.0, 20.0, 30.0, 45.0)  # ° from flat
VARIANTS = (("angle_offset",), ("angle_offset", "rounded_corners"))
DRAWS = 100
SEED = 0


def at_rest(dataset: Dataset) -> pd.DataFrame:
    """Throws at the end of which the body lies still: angle of the face in °, angle from it in rad, x, height y in m.

    UserError without trajectories, and for a body without faces.
    """
    if not isinstance(dataset.shape, Polygon):
        raise UserError(f"A body of shape {dataset.shape.kind} has no faces.")
    if dataset.trajectories is None:
        raise UserError(f"{dataset.name} has no trajectories: no body is seen at rest.")
    ends = dataset.trajectories.groupby("trial")[list(POSE)].apply(lambda poses: poses.tail(LAST))
    by_trial = ends.groupby("trial")
    still = ((by_trial.max() - by_trial.min()) < STILL).all(axis=1)
    pose = by_trial.mean()[still]
    theta = pose["theta"].to_numpy()
    flat = dataset.shape.lying(theta)
    face = np.round(np.degrees(flat)).astype(int) % 360
    return pd.DataFrame({"face": face, "angle": theta - flat, "x": pose["x"], "y": pose["y"] - dataset.height})


def inertia(dataset: Dataset, camera: float) -> pd.DataFrame:
    """m/I over that of the stated radius of gyration, by range of the angle from flat and by variant.

    `camera` is the angle in rad that is measured where a face lies flat.  Columns: low, high (°), hits, variant, ratio
    (1), std (1, bootstrap over trials).  A contact of 1 ms, in which the body turns, adds up to 4 %.
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
    """Share of the variance of the heights of `at_rest` along x that a line explains, and a parabola (curved surface).

    Heights are those above the median of their face; what lies beyond four of their median deviations is left out.
    """
    y = lying["y"] - lying.groupby("face")["y"].transform("median")
    near = np.abs(y) <= 4.0 * np.median(np.abs(y))
    x, y = lying["x"][near].to_numpy(), y[near].to_numpy()
    left = [np.mean((y - np.polynomial.Polynomial.fit(x, y, degree)(x)) ** 2) for degree in (0, 1, 2)]
    return 1.0 - left[1] / left[0], 1.0 - left[2] / left[0]


def as_text(dataset: Dataset) -> str:
    """How the body lies at rest, by face and by place, and its inertia."""
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
