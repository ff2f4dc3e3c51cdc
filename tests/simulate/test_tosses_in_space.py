"""Tosses in MuJoCo: what is written is a dataset whose flights, hits and hidden cause are those of the simulation."""

import numpy as np
import pytest

from thesis_lib.commands.datasets import main
from thesis_lib.critique.likelihood.hits_in_space import beside, jump, observe_in_space
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.checks.in_space import motion_facts
from thesis_lib.datasets.format.frames import body_states, tracked_states
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.inertia import in_world
from thesis_lib.simulate.mujoco.tosses import SHAPES, simulate_tosses


@pytest.mark.parametrize("shape", SHAPES)
def test_an_example_in_space_reads_back_without_a_doubt(tmp_path, shape, capsys):
    out = tmp_path / shape
    assert main(["example", "-o", str(out), "--space", "--shape", shape, "--drops", "6"]) == 0
    made = read_dataset(out)
    assert made.warnings == () and len(made.trials) == 6 and made.header.body.shape.kind == shape
    assert "critique    by single hits" in capsys.readouterr().out
    facts = motion_facts(made.trajectories, made.in_space)
    assert facts.flights >= 6 and facts.reading == ""
    np.testing.assert_allclose(facts.fall, [0.0, 0.0, -9.81], atol=0.3)


def test_hits_of_a_box_take_energy_and_happen_at_the_surface():
    made = simulate_tosses("box", drops=15, seed=2)
    found = observe_in_space(made)
    assert len(found) > 15
    before, after = beside(found, 0), beside(found, 1)
    energy = []
    for state in (before, after):
        G = in_world(found.rig.tensor, state.attitude)
        energy.append((state.velocity**2).sum(axis=0) + np.einsum("in,ijn,jn->n", state.spin, G, state.spin))
    assert np.mean(energy[1] < energy[0]) > 0.95
    assert np.median(np.abs(found.rig.gap(before))) < 1.5e-3
    assert np.median(jump(found)) > 0.4


def test_what_is_hidden_is_in_the_motion_and_not_in_the_file():
    fine, heavy = (simulate_tosses("box", hidden=hidden, drops=8, seed=1) for hidden in ("nothing", "wrong_gravity"))
    assert heavy.header == fine.header
    falls = [motion_facts(made.trajectories, made.in_space).fall[2] for made in (fine, heavy)]
    assert falls[0] == pytest.approx(-9.81, abs=0.1) and falls[1] == pytest.approx(-9.51, abs=0.1)
    for hidden in ("com_offset", "wrong_inertia", "wrong_size"):
        other = simulate_tosses("box", hidden=hidden, drops=2, seed=1)
        assert other.header == fine.header
        assert not np.allclose(other.trajectories["z"], fine.trajectories["z"][: len(other.trajectories)])


def test_a_body_comes_to_rest_on_a_face():
    made = simulate_tosses("box", drops=3, seed=0)
    states = body_states(tracked_states(made.trajectories), made.in_space)
    last = np.flatnonzero(np.r_[states.trial[1:] != states.trial[:-1], True])
    heights = states.height[last]
    assert np.all(np.min(np.abs(heights[:, None] - [0.05, 0.04, 0.03]), axis=1) < 2e-3)


def test_what_cannot_be_tossed_is_said(tmp_path, capsys):
    with pytest.raises(UserError, match="--hidden tilt: with --space it is nothing, com_offset"):
        simulate_tosses("box", hidden="tilt")
    assert main(["example", "-o", str(tmp_path / "a"), "--space", "--engine", "drake"]) == 2
    assert "is tossed in MuJoCo" in capsys.readouterr().err
    assert main(["example", "-o", str(tmp_path / "b"), "--shape", "box"]) == 2
    assert "bodies in space need --space" in capsys.readouterr().err
    assert main(["example", "-o", str(tmp_path / "c"), "--space", "--filter", "butterworth"]) == 2
