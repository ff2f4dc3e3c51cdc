"""Pushes obey Coulomb and the finger's spring; the gripper holds by friction and knows when it does not."""

import numpy as np
import pytest
from tower_for_tests import FREE_BLOCK, SEED, STUCK_BLOCK, Settled

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.robot.primitives import Gripper, free_places
from thesis_lib.jenga.robot.robot import Robot, reading, standard_deviations
from thesis_lib.jenga.robot.samples import ADVANCE, F_N, F_T, STATE, TOWER, YAW, PushSamples, X
from thesis_lib.jenga.tower.settings import HiddenEffects, RobotSettings, SensingSettings, TowerSettings
from thesis_lib.jenga.tower.tower import BLOCKS, Tower


def _pushed(robot: Robot, block: int, steps: int, offset: float = 0.0, heading: float = 0.0) -> np.ndarray:
    robot.start(block)
    return np.array([robot.push_step(offset, heading)[1] for _ in range(steps)])


def test_a_free_block_follows_with_the_friction_of_its_weight():
    tower = Settled.get()
    states = _pushed(Robot(tower), FREE_BLOCK, 6)
    weight = 9.81 * tower.settings.density * np.prod(tower.sizes[FREE_BLOCK])
    assert np.allclose(states[:, X], states[:, ADVANCE], atol=0.2)
    assert states[1:, F_N].mean() == pytest.approx(tower.settings.friction * weight, rel=0.2)
    assert states[:, TOWER].max() < 0.4


def test_the_force_on_a_stuck_block_climbs_with_the_spring():
    tower = Settled.get()
    states = _pushed(Robot(tower), STUCK_BLOCK, 3)
    assert states[-1, X] < 0.3
    deflection = 1e-3 * (states[:, ADVANCE] - states[:, X])
    assert np.allclose(np.diff(states[:, F_N]), tower.robot_settings.stiffness * np.diff(deflection), rtol=0.05)


def test_the_arm_never_exceeds_its_limit():
    settings = RobotSettings(force_limit=1.0)
    tower = Tower(SEED, robot=settings).settle()
    states = _pushed(Robot(tower), STUCK_BLOCK, 5)
    assert states[:, F_N].max() == pytest.approx(settings.force_limit, rel=0.05)
    assert states[-1, X] < 0.5


def test_forces_stay_in_the_friction_cone():
    tower = Settled.get()
    states = _pushed(Robot(tower), STUCK_BLOCK, 8, heading=0.9)
    mu = tower.robot_settings.tip_friction
    ratio = np.abs(states[:, F_T]) / states[:, F_N]
    assert ratio.max() <= mu * 1.05
    assert ratio.max() > 0.5 * mu  # else the push would not have tried the cone


def test_a_mirrored_offset_turns_the_block_the_other_way():
    tower = Settled.get()
    start, turned = tower.save(), []
    for offset in (-8e-3, 8e-3):
        tower.load(start)
        turned.append(_pushed(Robot(tower), FREE_BLOCK, 8, offset)[-1, YAW])
    # the force acts at r = (-L/2, offset), so its moment about z is -offset f
    assert turned[0] > 0.1 and turned[1] < -0.1


def test_contact_is_made_again_as_pressed_before_the_state_is_read():
    tower = Settled.get()
    robot = Robot(tower)
    before, time = _pushed(robot, STUCK_BLOCK, 2)[-1], tower.data.time
    np.testing.assert_array_equal(robot.touch(0.5e-3), before)  # near enough: nothing moves
    assert tower.data.time == time
    after = robot.touch(6e-3)
    # the tower gives way a little while the finger is off
    assert 0.75 * before[F_N] < after[F_N] < 1.1 * before[F_N]
    assert after[ADVANCE] == pytest.approx(before[ADVANCE], abs=0.2)
    tip = tower.data.geom("tip").xpos - tower.position(STUCK_BLOCK)
    assert (tower.matrix(STUCK_BLOCK).T @ tip)[1] == pytest.approx(6e-3, abs=0.5e-3)


def test_a_robot_that_senses_starts_off_the_block_and_feels_nothing_until_it_is_there():
    tower = Settled.get()
    robot = Robot(tower, SensingSettings(exact=True), np.random.default_rng(1))
    robot.start(FREE_BLOCK, 4e-3, off=2.5e-3)
    steps = [robot.push_step(offset, 0.0) for offset in (4e-3, -4e-3, -4e-3, -4e-3, -4e-3)]
    states = np.array([after for _, after in steps])
    assert (states[:2, [F_N, X]] < 0.01).all()  # it moved aside after the first, without coming nearer
    assert np.allclose(states[:, ADVANCE], np.arange(1, 6))
    assert states[-1, X] == pytest.approx(2.5, abs=0.3) and states[-1, F_N] > 0.02
    low, high = 1e-3, 3e-3
    robot.settings, gaps = robot.settings.model_copy(update={"start_off": (low, high)}), []
    for _ in range(20):
        robot.start(FREE_BLOCK)
        gaps.append((robot._tip_place(0.0) - robot.arm) @ robot.u)
    assert low <= min(gaps) < max(gaps) <= high and np.std(gaps) > 0.2 * (high - low)


def test_noise_is_as_declared_and_falls_with_the_advance():
    settings = SensingSettings()
    rng = np.random.default_rng(1)
    for advance in (0.0, 30.0):
        state = np.zeros(len(STATE))
        state[ADVANCE] = advance
        read = np.array([reading(state, settings, rng) for _ in range(4000)])
        sigma = standard_deviations(advance, settings)
        assert np.allclose(read.std(axis=0), sigma, rtol=0.05)
        assert read[:, ADVANCE].std() == 0.0
    assert standard_deviations(0.0, settings)[X] > 2.0 * standard_deviations(30.0, settings)[X]


def test_a_robot_that_is_told_states_hears_them_without_noise_and_shifts_no_stream():
    state, (noisy, told) = np.arange(7.0), (np.random.default_rng(1) for _ in range(2))
    exact = reading(state, SensingSettings(exact=True), told)
    assert exact.tolist() == state.tolist() != reading(state, SensingSettings(), noisy).tolist()
    assert told.random() == noisy.random()


@pytest.mark.slow
def test_a_goal_of_three_quarters_is_pushed_to_and_needs_longer_pushes():
    with pytest.raises(ValueError, match="beyond longest_push"):
        RobotSettings(goal=56.25e-3)
    tower = Tower(SEED, robot=RobotSettings(goal=56.25e-3, longest_push=68e-3)).settle()
    robot = Robot(tower)
    robot.start(FREE_BLOCK)
    while not (robot.reached_goal() or robot.at_end()):
        robot.push_step(0.0, 0.0)
    state = robot.state()
    assert robot.reached_goal() and 56.25 <= state[X] < 58.0 and robot.steps > 45
    zeros, row = np.zeros((1, 2)), np.zeros(1)
    PushSamples(row, row, state[None], zeros, state[None], zeros, row, row, row)  # within `RANGE`


def _out(tower: Tower, block: int = FREE_BLOCK) -> None:
    robot = Robot(tower)
    robot.start(block)
    while not robot.reached_goal():
        robot.push_step(0.0, 0.0)
    robot.retract()


@pytest.mark.slow
def test_a_free_block_is_extracted_and_placed_on_top():
    tower = Settled.get()
    _out(tower)
    gripper, height = Gripper(tower), tower.height
    before = tower.poses()
    extracted = gripper.extract(FREE_BLOCK)
    assert extracted.success, extracted.reason
    assert not extracted.ends_run and tower.perturbation(FREE_BLOCK, before)[0] < 1e-3
    assert tower.position(FREE_BLOCK) @ (1, 1, 0) > 0.075
    placed = gripper.place(np.random.default_rng(0))
    assert placed.success, placed.reason
    assert tower.layer[FREE_BLOCK] == 18
    assert tower.height == pytest.approx(height + tower.sizes[FREE_BLOCK, 2], abs=1e-3)
    assert tower.fallen().size == 0
    layer, places = free_places(tower, held=1)
    assert layer == 18 and len(places) == 2 and tower.place[FREE_BLOCK] not in places
    tower.layer[[0, 1]], tower.place[[0, 1]] = 18, places
    assert free_places(tower, held=3)[0] == 19  # a full layer opens the next


@pytest.mark.slow
def test_jaws_miss_a_block_whose_end_is_too_far_aside_and_leave_the_tower_as_it_is(monkeypatch):
    tower = Settled.get()
    robot = Robot(tower)
    robot.start(FREE_BLOCK)
    while not robot.reached_goal():
        robot.push_step(8e-3, 0.0)
    robot.retract()
    turned, gripper = tower.poses(), Gripper(tower)
    aside = abs((gripper._grasped(FREE_BLOCK) - tower.reference[FREE_BLOCK, :3]) @ robot.v)
    monkeypatch.setattr(tower, "robot_settings", RobotSettings(grasp_aside=0.9 * aside))
    missed = Gripper(tower).extract(FREE_BLOCK)
    assert missed == ("jaws miss it", False) and not missed.success
    assert np.array_equal(tower.poses(), turned)
    monkeypatch.setattr(tower, "robot_settings", RobotSettings(grasp_aside=1.1 * aside))
    assert gripper.held is None and Gripper(tower).extract(FREE_BLOCK).success


@pytest.mark.slow
def test_weak_jaws_lose_the_block():
    tower = Tower(SEED, robot=RobotSettings(jaw_force=0.02, jaw_friction=0.05)).settle()
    _out(tower)
    result = Gripper(tower).extract(FREE_BLOCK)
    assert not result.success and "lost" in result.reason


def test_what_cannot_be_done_is_said():
    tower = Settled.get()
    with pytest.raises(UserError, match="0 to 44"):
        Robot(tower).start(BLOCKS - 1)
    with pytest.raises(UserError, match="push it further"):
        Gripper(tower).extract(FREE_BLOCK)
    with pytest.raises(UserError, match="no block is held"):
        Gripper(tower).place(np.random.default_rng(0))


@pytest.mark.slow
def test_a_slippery_layer_and_a_heavy_tool_change_what_is_felt():
    plain = _pushed(Robot(Settled.get()), STUCK_BLOCK, 5)[:, F_N].max()
    slippery = Tower(SEED, TowerSettings(hidden=HiddenEffects(slippery_layer=STUCK_BLOCK // 3))).settle()
    assert _pushed(Robot(slippery), STUCK_BLOCK, 5)[:, F_N].max() < 0.7 * plain
    heavy = Tower(SEED, TowerSettings(hidden=HiddenEffects(pusher_mass=0.15))).settle()
    sag = []
    for tower in (heavy, Settled.get()):
        robot = Robot(tower)
        _pushed(robot, FREE_BLOCK, 2)
        sag.append(robot.arm[2] - tower.data.geom("tip").xpos[2])
    assert sag[0] > 0.3e-3 > abs(sag[1])
