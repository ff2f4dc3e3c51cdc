"""A ball in space whose orientation nobody measured: its hits, restitution from a few, and a verdict."""

import numpy as np
import pytest
from tosses import simulate_tosses

from thesis_lib.critique import criticise
from thesis_lib.critique.likelihood.hits_in_space import beside, observe_in_space
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.datasets.format.space_header import SpaceHeader
from thesis_lib.foundation.errors import UserError

TRUTH = {"mu": 0.2, "epsilon": 0.6}
BALL = {"shape": {"kind": "sphere", "radius": 0.03}, "mass": 0.1, "homogeneous": True}


def content(**changes) -> dict:
    return {"schema": 2, "body": BALL, "rate": 240.0, "noise": {"position": 2e-4}} | changes


def tossed(trials: int, seed: int = 1, **changes):
    header = SpaceHeader.model_validate(content())
    (frame,) = surface_frames(header)
    made = simulate_tosses(header, frame, trials, np.random.default_rng(seed), **TRUTH)
    return dataset_of(content(**changes), trajectories=made.trajectories.drop(columns=["qw", "qx", "qy", "qz"]))


def test_its_hits_have_an_unknown_spin():
    o = observe_in_space(tossed(8))
    assert len(o) > 15 and 15.0 < o.spin < 60.0 and not o.rig.has_angle and o.arcs
    assert np.all(o.cov[:, 0, [7, 9, 11], [7, 9, 11]] == 0.0)  # of the spin before, which is a nuisance
    assert observe_in_space(tossed(2, spin=8.0)).spin == 8.0
    assert np.abs(o.rig.gap(beside(o, 0))).max() < 3e-3


def test_few_hits_say_restitution():
    found = criticise(tossed(6)).to_dict()
    assert found["verdict"] is None
    assert abs(found["restitution"]["value"] - TRUTH["epsilon"]) < 4.0 * found["restitution"]["std"] < 0.1


@pytest.mark.slow
def test_a_verdict_names_nothing_that_is_not_hidden(tmp_path):
    critique = criticise(tossed(40, seed=2))
    found = critique.to_dict()
    assert found["verdict"] == "adequate" and not found["effects"]
    assert abs(found["base_model"]["parameters"]["epsilon"]["value"] - TRUTH["epsilon"]) < 0.01
    critique.save(tmp_path / "out")
    assert load_model(tmp_path / "out" / "model.json").law == found["base_model"]["name"]


def test_what_needs_an_orientation_is_refused():
    with pytest.raises(UserError, match="as it is not the tracked point"):
        observe_in_space(dataset_of(content(tracked={"position": [0.0, 0.0, 0.03]}), trajectories=_bare()))


def _bare():
    return tossed(2).trajectories.drop(columns=["qw", "qx", "qy", "qz"])
