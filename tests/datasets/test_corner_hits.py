"""Two corners of a polygon that touch at once make one hit in the samples: it is left out, and nothing else is."""

from functools import cache

import numpy as np
import pytest

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.detect import FoundImpacts, find_impacts
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import PROOF_RELEASE, RIG_NOISE, SQUARE, CompliantContact
from thesis_lib.simulate.rig.record import DropsWithTruth

APART = 4e-3  # s, one frame: contacts nearer than this are one hit in the samples
REASON = "next corner"


@cache
def drops() -> DropsWithTruth:
    contact, rng = CompliantContact(contact_time=2e-5), np.random.default_rng(5)
    return simulate_compliant_drops(SQUARE, PROOF_RELEASE, 120, contact=contact, noise=RIG_NOISE, rng=rng)


def found(limit: float, shape: Polygon | None = None) -> FoundImpacts:
    header = drops().header
    if shape is not None:
        header = header.model_copy(update={"body": header.body.model_copy(update={"shape": shape})})
    return find_impacts(Dataset("square", header, drops().trajectories), ArcSettings(double_hit=limit))


def doubles(impacts: FoundImpacts) -> np.ndarray:
    """Mask of the used impacts that are two true contacts within a frame."""
    truth = drops().impacts
    mask = []
    for trial, t in zip(impacts.impacts.trial, impacts.impacts.t):
        apart = np.abs(truth.loc[truth["trial"] == trial, "t"] - t)
        mask.append(np.sum(apart < APART) > 1)
    return np.array(mask)


def test_hits_of_two_corners_are_left_out_and_no_others():
    without, with_test = found(0.0), found(5e-3)
    assert doubles(without).sum() >= 5  # else there is nothing to find
    assert doubles(with_test).sum() == 0
    lost = len(without.impacts) - len(with_test.impacts)
    assert lost <= doubles(without).sum() + 1
    reasons = with_test.left_out
    assert reasons["detail"].str.contains(REASON).sum() == lost
    assert set(reasons.loc[reasons["detail"].str.contains(REASON), "reason"]) == {"second_hit"}


def test_vertices_side_by_side_are_one_corner():
    corners = np.array(SQUARE.shape.vertices)
    nearly = corners * (1.0 - 1e-3)
    doubled = tuple(map(tuple, np.stack([corners, nearly], axis=1).reshape(-1, 2)))
    one, two = found(5e-3), found(5e-3, Polygon(vertices=doubled))
    assert len(one.impacts) == pytest.approx(len(two.impacts), abs=2)
