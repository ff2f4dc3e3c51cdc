"""Tosses in MuJoCo: what is written is a dataset whose flights, hits and hidden cause are those of the simulation."""

from functools import partial

import numpy as np
import pytest

from thesis_lib.commands.datasets import main
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.checks.in_space import motion_facts
from thesis_lib.datasets.format.frames import body_states, tracked_states
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector, rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.mujoco.tosses import MujocoTosses
from thesis_lib.simulate.rig.causes_in_space import filmed
from thesis_lib.simulate.tosses.example import SHAPES
from thesis_lib.simulate.tosses.example import simulate_tosses as toss_in
from thesis_lib.simulate.tosses.own import OwnTosses
from thesis_lib.simulate.tosses.world import TossedWorld

simulate_tosses = partial(toss_in, engine=MujocoTosses())


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_an_example_in_space_reads_back_without_a_doubt(tmp_path, shape, capsys):
    out = tmp_path / shape
    assert main(["example", "-o", str(out), "--space", "--shape", shape, "--drops", "4"]) == 0
    made = read_dataset(out)
    assert made.warnings == () and len(made.trials) == 4 and made.header.body.shape.kind == shape
    assert "can be used in" in capsys.readouterr().out
    facts = motion_facts(made.trajectories, made.in_space)
    assert facts.flights >= 4 and facts.reading == ""
    np.testing.assert_allclose(facts.fall, [0.0, 0.0, -9.81], atol=0.3)


@pytest.mark.slow
def test_what_is_hidden_is_in_the_motion_and_not_in_the_file():
    fine, heavy = (simulate_tosses("box", hidden=hidden, drops=8, seed=1) for hidden in ("nothing", "wrong_gravity"))
    assert heavy.header == fine.header
    falls = [motion_facts(made.trajectories, made.in_space).fall[2] for made in (fine, heavy)]
    assert falls[0] == pytest.approx(-9.81, abs=0.1) and falls[1] == pytest.approx(-9.51, abs=0.1)


def test_a_camera_scales_turns_from_the_first_frame_on():
    trial, angle = np.repeat([0, 1], 40), np.tile(0.05 * np.arange(40), 2)
    attitude = of_rotation_vector(np.outer([0.0, 0.0, 1.0], angle))
    state = State(np.concatenate([np.zeros((3, 80)), attitude]), np.zeros((6, 80)), trial, angle, space=SPACE)
    seen = filmed(state, simulate_tosses("box", drops=1).header, {"rotation_scale.s_R": 0.1})
    np.testing.assert_allclose(rotation_vector(seen.attitude)[2], 1.1 * angle, atol=1e-12)


def test_a_mirrored_axis_turns_the_others_back():
    turn = np.array([[0.3], [-0.5], [0.9]])
    state = State(
        np.concatenate([np.zeros((3, 1)), of_rotation_vector(turn)]),
        np.zeros((6, 1)),
        np.zeros(1),
        np.zeros(1),
        space=SPACE,
    )
    header = simulate_tosses("box", drops=1).header
    mirrored, conjugate = (
        filmed(state, header, {name: 1.0}) for name in ("mirrored_rotation.mirrored_axis", "misread_rotation.reading")
    )
    np.testing.assert_allclose(rotation_vector(mirrored.attitude), [[0.3], [0.5], [-0.9]], atol=1e-12)
    np.testing.assert_allclose(rotation_vector(conjugate.attitude), -turn, atol=1e-12)


def test_a_body_comes_to_rest_on_a_face():
    made = simulate_tosses("box", drops=3, seed=0)
    states = body_states(tracked_states(made.trajectories), made.in_space)
    last = np.flatnonzero(np.r_[states.trial[1:] != states.trial[:-1], True])
    heights = states.height[last]
    assert np.all(np.min(np.abs(heights[:, None] - [0.05, 0.04, 0.03]), axis=1) < 2e-3)


def bounced(engine, height, contact_time, **hidden):
    """Restitution at the first two hits (2, n) of balls that fall from `height` (n,) in m without spin."""
    body = {"shape": {"kind": "sphere", "radius": 0.03}, "mass": 0.25, "homogeneous": True}
    frame = {"position": (0.0, 0.0, 0.0), "quaternion": (1.0, 0.0, 0.0, 0.0)}
    header = SpaceHeader.model_validate({"schema": 2, "body": body, "tracked": frame, "gravity": (0.0, 0.0, -9.81)})
    n = len(height)
    pose = np.zeros((7, n))
    pose[2], pose[3] = 0.03 + height, 1.0
    release = State(pose, np.zeros((6, n)), np.arange(n), np.zeros(n), None, SPACE)
    world = TossedWorld(header, contact_time=contact_time, hidden=hidden)
    at, speed, found = np.sqrt(2.0 * height / 9.81), np.sqrt(2.0 * height * 9.81), []
    for _ in range(2):
        z = engine.moves(world, release, at[:, None] + np.array([0.02, 0.04])).height.reshape(n, 2)
        off = np.diff(z, axis=1)[:, 0] / 0.02 + 9.81 * 0.03
        found.append(off / speed)
        at, speed = at + 2.0 * off / 9.81, off
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("engine", [MujocoTosses(), OwnTosses()], ids=["mujoco", "own"])
def test_what_a_hit_returns_does_not_hang_on_where_in_a_step_it_begins(engine):
    height = 0.1 + 0.1 * np.random.default_rng(0).random(16)
    returned, fall = bounced(engine, height, 3e-3)[0], np.sqrt(height)
    assert np.std(returned - np.polyval(np.polyfit(fall, returned, 1), fall)) < 1e-3  # 4e-3 with 40 steps in a contact


@pytest.mark.slow
def test_only_later_hits_have_a_later_restitution_in_each_toss_and_after_a_short_contact():
    first, later = bounced(MujocoTosses(), np.linspace(0.1, 0.2, 5), 3e-4, **{"later_restitution.d": -0.3})
    np.testing.assert_allclose(first, first[0], rtol=5e-3)
    np.testing.assert_allclose(later / first, 0.7, rtol=0.02)


def test_what_cannot_be_tossed_is_said(tmp_path, capsys):
    with pytest.raises(UserError, match="--hidden tilt: with --space it is nothing, com_offset"):
        simulate_tosses("box", hidden="tilt")
    for wrong in ({"drops": 0}, {"seed": -1}):
        with pytest.raises(UserError, match=f"got {next(iter(wrong.values()))}"):
            simulate_tosses("box", **wrong)
    tossed = ["example", "-o", str(tmp_path / "a"), "--space", "--drops", "2", "--engine", "drake", "--hidden"]
    assert main([*tossed, "torsional_friction"]) == 2 and main([*tossed, "sliding_friction"]) == 2
    assert "--hidden sliding_friction: with --space it is" in capsys.readouterr().err
    assert main([*tossed, "curved_surface"]) == 2
    assert "Drake has no element for contact_torque" in capsys.readouterr().err
    assert main([*tossed, "com_offset"]) == 0 and (tmp_path / "a" / "trajectories.csv").is_file()
    assert main(["example", "-o", str(tmp_path / "b"), "--shape", "box"]) == 2
    assert "bodies in space need --space" in capsys.readouterr().err
    assert main(["example", "-o", str(tmp_path / "c"), "--space", "--filter", "butterworth"]) == 2
