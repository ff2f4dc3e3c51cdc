"""No reading of quaternions is preferred because a body falls about a far point with the stated one, if the tracked
point falls as well."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.checks.in_space import reading_of
from thesis_lib.datasets.space.falling_body import reading_that_falls
from thesis_lib.datasets.space.motion import Motion, conjugate
from thesis_lib.effects.as_written import RELABELLINGS

RATE, FRAMES, G = 148.0, 30, np.array([0.0, 0.0, -9.81])
FAR = [0.0, -0.04, 0.015]  # m: the point about which a body on the table rocks
SHAKEN, QUICKLY = 0.003, 20.0  # m and rad/s: about 1 m/s², far more than noise and far less than gravity


def falls_and_rocks(seed: int) -> Motion:
    """A cube tracked in its centre: in every other trial it falls, else a far point of it falls, shaken."""
    rng, t, parts = np.random.default_rng(seed), np.arange(FRAMES) / RATE, []
    for trial in range(24):
        turn = Rotation.from_rotvec(np.outer(t, rng.normal(0.0, 6.0, 3))) * Rotation.random(rng=rng)
        place = np.outer(t, rng.standard_normal(3)) + 0.5 * np.outer(t**2, G)
        if trial % 2:
            place = place - turn.apply(FAR) + SHAKEN * np.sin(QUICKLY * t[:, None] + rng.uniform(0.0, 6.0, 3))
        seen = Rotation.from_rotvec(2e-3 * rng.standard_normal((FRAMES, 3))) * turn
        parts.append((trial + t, place + 1e-4 * rng.standard_normal(place.shape), seen.as_quat()))
    stamps, places, q = (np.concatenate(part) for part in zip(*parts))
    readings = {"first": lambda: q[:, [3, 0, 1, 2]], "left": lambda: conjugate(q)}
    return Motion("cube", "log.csv", stamps, places, q, readings=readings)


@pytest.mark.parametrize("seed", range(6))
def test_a_tracked_point_that_falls_decides_nothing(seed):
    assert reading_that_falls(falls_and_rocks(seed), 9.81) == ""


def test_few_tosses_of_the_measured_cube_are_read_as_they_are_written(contactnets_cube_dir):
    table = read_dataset(contactnets_cube_dir).trajectories
    trials = table["trial"].unique()
    for first in range(0, len(trials), 30):
        some = table[table["trial"].isin(trials[first : first + 30])]
        assert reading_of(some, RELABELLINGS, 9.81) == "", f"tosses {trials[first]} to {some['trial'].max()}"
