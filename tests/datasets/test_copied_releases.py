"""Releases that are copies of others are found, however they were changed; independent ones never are."""

import numpy as np
import pandas as pd
import pytest
from folders_in_space import header
from scipy.spatial.transform import Rotation

from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.checks.copied_releases import copied_releases

RATE, NOISE = 240.0, 2e-4


def releases(trials: int, rng: np.random.Generator, alike: bool = False, irregular: float = 0.0) -> pd.DataFrame:
    """Points that fall from some 0.3 m and bounce: trial, t, x, y, z; `alike`: all from the same height; `irregular`
    is the standard deviation of the frames' instants, in frames."""
    parts = []
    for trial in range(trials):
        t = (np.arange(140) + irregular * rng.standard_normal(140)) / RATE
        height = 0.3 if alike else rng.uniform(0.2, 0.4)
        hit = np.sqrt(2.0 * height / 9.81)
        up = 9.81 * hit * (0.6 if alike else rng.uniform(0.4, 0.7))
        z = np.where(t < hit, height - 4.905 * t**2, up * (t - hit) - 4.905 * (t - hit) ** 2)
        place = np.stack([0.3 * t, 0.1 * trial + 0.0 * t, np.maximum(z, 0.0)]) + NOISE * rng.standard_normal((3, 140))
        parts.append(pd.DataFrame({"trial": trial, "t": t, **dict(zip("xyz", place))}))
    return pd.concat(parts, ignore_index=True)


def found(table: pd.DataFrame) -> list:
    return copied_releases(*(table[name].to_numpy() for name in ("trial", "t", "z")))


def moved(one: pd.DataFrame) -> pd.DataFrame:
    turn = Rotation.from_rotvec([0.0, 0.0, 1.0])
    place = turn.apply(one[["x", "y", "z"]].to_numpy(copy=True)) + [0.4, -0.2, 0.0]
    return one.assign(**dict(zip("xyz", place.T)))


def resampled(one: pd.DataFrame) -> pd.DataFrame:
    t = np.arange(130) / RATE + 0.37 / RATE
    return pd.DataFrame({"t": t, **{axis: np.interp(t, one["t"], one[axis]) for axis in "xyz"}})


CHANGES = {
    "equal": lambda one: one,
    "cut": lambda one: one.iloc[11:].assign(t=one["t"].iloc[11:] - one["t"].iloc[11]),
    "mirrored": lambda one: one.assign(y=-one["y"]),
    "moved": moved,
    "resampled": resampled,
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_copy_is_found(change, rng):
    table = releases(30, rng)
    copy = CHANGES[change](table[table["trial"] == 7]).assign(trial=30)
    assert found(pd.concat([table, copy], ignore_index=True)) == [(7, 30)]


@pytest.mark.parametrize("alike, irregular", [(False, 0.0), (True, 0.0), (True, 0.15)])
def test_independent_releases_are_no_copies(alike, irregular, rng):
    assert found(releases(60, rng, alike, irregular)) == []
    assert found(releases(1, rng)) == [] and found(releases(0 + 2, rng).groupby("trial").head(20)) == []


def test_bodies_that_rest_for_long_are_no_copies(rng):
    """A camera sees a body at rest with less noise than one that moves."""
    table = releases(12, rng, alike=True)
    end = table[table["t"] == table["t"].max()].assign(z=0.0)
    rests = [end.assign(t=end["t"] + k / RATE, z=0.1 * NOISE * rng.standard_normal(12)) for k in range(1, 301)]
    table = pd.concat([table, *rests]).sort_values(["trial", "t"], ignore_index=True)
    assert found(table) == []
    assert found(pd.concat([table, moved(table[table["trial"] == 7]).assign(trial=12)], ignore_index=True)) == [(7, 12)]


def test_reading_a_dataset_says_so(rng):
    table = releases(12, rng)
    table = pd.concat([table, moved(table[table["trial"] == 3]).assign(trial=12)], ignore_index=True)
    ball = {"shape": {"kind": "sphere", "radius": 0.03}, "mass": 0.1, "homogeneous": True}
    warnings = dataset_of(header(body=ball, surface=None), trajectories=table).warnings
    said = "1 release is a copy of another, cut, resampled, mirrored or moved: trial 12 of 3"
    assert any(said in warning.what for warning in warnings)
