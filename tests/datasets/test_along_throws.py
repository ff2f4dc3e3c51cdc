"""Tosses that were turned about the vertical one by one: said by `datasets check`, turned back by `datasets turn`."""

import json

import numpy as np
import pandas as pd
import pytest

from tests.datasets.folders_in_space import header
from thesis_lib.__main__ import main
from thesis_lib.datasets import dataset_of, read_dataset
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.datasets.sources.along_throws import ADDED, along_throws, hidden_drift, throws_of
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import multiplied, of_rotation_vector, rotated

TOSSES, RATE, DRIFT = 40, 240.0, np.array([-0.07, 0.14])  # m/s² along the throw and to the left


def thrown(rng, headings, speed=1.0, noise=3e-5, drift=DRIFT) -> pd.DataFrame:
    """Flights with a constant attitude that drift, each turned about the vertical through the origin."""
    parts, t = [], np.arange(48) / RATE
    for trial, heading in enumerate(headings):
        x, y = np.outer(t, [speed, 0.0]).T + 0.5 * drift[:, None] * t**2
        place = np.stack([x, y, 1.0 + t - 0.5 * 9.81 * t**2])
        turn = of_rotation_vector(np.array([[0.0], [0.0], [heading]]))
        own = of_rotation_vector(np.array([[0.5], [0.1], [-0.3]]))
        pose = np.concatenate([rotated(turn, place), np.repeat(multiplied(turn, own), len(t), axis=1)])
        pose[:3] += noise * rng.standard_normal(pose[:3].shape)
        parts.append(pd.DataFrame({"trial": trial, "t": t} | dict(zip(POSE_IN_SPACE, pose))))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture
def turned(rng):
    return dataset_of(header(), trajectories=thrown(rng, rng.uniform(-np.pi, np.pi, TOSSES)))


def test_all_are_thrown_along_one_axis_and_drift_alike(turned):
    assert np.hypot(*throws_of(turned.trajectories, turned.in_space).level.mean(axis=0)) < 0.06
    back = along_throws(turned)
    throws = throws_of(back.trajectories, back.in_space)
    assert np.abs(throws.heading).max() < 1e-9
    np.testing.assert_allclose(throws.level.mean(axis=0), DRIFT, atol=0.02)
    np.testing.assert_allclose(throws_of(turned.trajectories, turned.in_space).along, throws.along, atol=1e-9)
    q = back.trajectories[list(POSE_IN_SPACE)[3:]].to_numpy()
    assert np.abs(np.abs(q @ q[0]) - 1.0).max() < 1e-4  # attitudes went with the places
    assert ADDED in back.in_space.description


def test_check_says_so_and_turn_mends_it(turned, tmp_path, capsys):
    write_dataset(turned, tmp_path / "set")
    assert "to the left of it, whichever way they are thrown" in hidden_drift(turned)
    assert main(["datasets", "check", str(tmp_path / "set"), "--json"]) == 0
    assert "datasets turn" in json.dumps(json.loads(capsys.readouterr().out))
    command = ["datasets", "turn", str(tmp_path / "set"), "-o", str(tmp_path / "out")]
    assert main(command) == 0 and f"{TOSSES} of {TOSSES} tosses" in capsys.readouterr().out
    assert not hidden_drift(read_dataset(tmp_path / "out"))
    assert main(command) == 2 and "--force" in capsys.readouterr().err


def test_nothing_is_said_where_throws_go_one_way_or_nothing_drifts(rng):
    for headings, drift in ((rng.normal(0.3, 0.2, TOSSES), True), (rng.uniform(-3.0, 3.0, TOSSES), False)):
        table = thrown(rng, headings, noise=3e-5 if drift else 3e-3)
        assert not hidden_drift(dataset_of(header(), trajectories=table))
    slowed = thrown(rng, rng.uniform(-3.0, 3.0, TOSSES), drift=np.array([-0.2, 0.0]))  # as by air
    assert not hidden_drift(dataset_of(header(), trajectories=slowed))


def test_what_is_dropped_has_no_direction(rng):
    with pytest.raises(UserError, match=r"40 of the 40 tosses .* have no direction of throw"):
        along_throws(dataset_of(header(), trajectories=thrown(rng, np.zeros(TOSSES), speed=0.0)))
