"""Arm and wheel in MuJoCo and Drake: hidden forces, contacts that give and slide, and what sensors write."""

from dataclasses import replace

import numpy as np
import pytest
from motions import limit_cycle

from thesis_lib.critique.mechanisms.effects import CANDIDATES, MotionSteps
from thesis_lib.critique.mechanisms.study import believed, true_sizes
from thesis_lib.datasets.recordings.recording import read_recording, write_recording
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.engines.drake_motion import drake_motions
from thesis_lib.simulate.engines.mujoco_motion import mujoco_motions
from thesis_lib.simulate.engines.recording import simulate_recording
from thesis_lib.simulate.engines.sensors import DrawnSensors, Sensors, low_passed
from thesis_lib.simulate.engines.settings import EngineMotion, drawn_stiffness
from thesis_lib.simulate.mechanisms import motions as chapter2
from thesis_lib.simulate.mechanisms.hidden_forces import TRUTHS, HiddenSizes, planned
from thesis_lib.simulate.rig.release import Spread

ENGINES = {"mujoco": mujoco_motions, "drake": drake_motions}
BODIES, SIZES = chapter2.DEFAULT, HiddenSizes()
FREE = 20  # steps of 5 ms; the arm and its disk are released above the ground and apart
INSIDE = [truth for truth in TRUTHS["arm"] if truth not in ("nothing", "rolling_resistance", "cogging")]


@pytest.fixture(scope="module")
def plans():
    return {kind: planned(kind, 1, np.random.default_rng(5), BODIES, SIZES) for kind in TRUTHS}


def run(engine, kind, truth, plan):
    return ENGINES[engine](kind, truth, [plan], SIZES, drawn_stiffness(np.random.default_rng(1)))[0]


def short(plan, steps):
    return replace(plan, f_ext=plan.f_ext[:steps])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("truth", INSIDE)
def test_an_engines_arm_moves_as_the_critiques_equations_with_the_hidden_force(engine, truth, plans):
    """In the air, where no contact acts; the two share no line of code."""
    model = believed("arm", BODIES, SIZES)
    # fast joints, so that friction shows
    plan = plans["arm"][0]
    start = np.array(plan.v)
    start[0, :2] = 2.0, -3.0
    above = np.array(plan.q)
    above[0, 3] += 1.0
    m = run(engine, "arm", truth, short(replace(plan, q=above, v=start), FREE))
    h = m.t[1] - m.t[0]
    q, v, a = 0.5 * (m.q[1:] + m.q[:-1]), 0.5 * (m.v[1:] + m.v[:-1]), np.diff(m.v, axis=0) / h
    known = np.repeat(plan.f_ext[:FREE], round(plan.h / h), axis=0)
    force = model.inverse_dynamics(q, v, a) - known
    effect = next(e for e in CANDIDATES["arm"] if e.name == truth)
    true = np.array(list(true_sizes("arm", truth, SIZES).values()))
    expected = effect.force(model, MotionSteps(q, v, a, np.zeros((len(q), 2))), true)
    assert np.abs(model.mechanism.contacts_of(q).phi).min() > 1e-3 and np.abs(expected).max() > 0.05
    # N, N m; forces that are updated every 0.5 ms lag by a quarter of one
    assert np.abs(force - expected).max() < 0.01


@pytest.mark.parametrize("engine", ENGINES)
def test_contacts_give_slide_and_do_not_pull(engine, plans):
    """Impulses of the ground on the disk: upwards and within the cone; the gap falls below zero by less than 3 mm."""
    plan = plans["arm"][0]
    m = run(engine, "arm", "nothing", plan)
    phi = chapter2.arm_disk(BODIES).contacts_of(m.q).phi
    assert -3e-3 < phi.min() < -1e-6
    alone = phi[:, 0] > 2e-3  # only the ground touches the disk
    steps = np.flatnonzero(alone[1:] & alone[:-1])
    h = m.t[1] - m.t[0]
    impulse = BODIES.arm.disk_mass * (np.diff(m.v[:, 2:4], axis=0) + [0.0, BODIES.gravity * h])[steps]
    assert impulse[:, 1].min() > -1e-3 and impulse[:, 1].max() > 0.1
    assert (np.abs(impulse[:, 0]) <= BODIES.arm.mu * impulse[:, 1] + 2e-3).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_wheel_in_an_engine_rolls_as_the_rigid_one(engine, plans):
    """The energy that is lost at each spoke is that of a dead impact, whatever the engine's contact."""
    w = BODIES.wheel
    q, v = chapter2.wheel(BODIES).standing(0.0, -2.0)
    start = replace(plans["wheel"][0], q=q[None], v=v[None], f_ext=np.zeros((600, 3)))
    omega = run(engine, "wheel", "nothing", start).v[:, 2]
    before, after = limit_cycle(chapter2.wheel(BODIES))
    late = omega[len(omega) // 2 :]
    assert late.min() == pytest.approx(before, rel=0.15) and w.slope > 0
    assert after < late.max() + 0.15 * abs(after)


def test_sensors_count_lag_and_write_what_is_stated():
    """A joint that turns steadily, and a torque of 1 N m: counts, delays, ripple and offset are as drawn."""
    t = np.linspace(0.0, 3.0, 6001)
    steady = np.column_stack([2.0 * t, -t, 0.3 * t, 0.1 * t, t])
    motion = EngineMotion(t, steady, np.broadcast_to([2.0, -1.0, 0.3, 0.1, 1.0], steady.shape))
    sensors = Sensors(jitter=0.0, camera_position=1e-9, camera_angle=1e-9)
    rng = np.random.default_rng(2)
    rig = replace(DrawnSensors.draw(sensors, 2, rng), delays=(2e-3, 4.5e-3))
    at, q, v, u = rig.record(motion, np.ones((600, 2)), 5e-3, rng)
    assert at[0] == pytest.approx(5e-3) and at[-1] == pytest.approx(3.0)
    count = 2.0 * np.pi / 4096
    assert np.abs(q[:, :2] / count - 0.5 - np.round(q[:, :2] / count - 0.5)).max() < 1e-6
    assert np.abs(q[:, 0] - 2.0 * (at - 2e-3)).max() <= 0.5 * count + 1e-9
    assert np.abs(q[:, 2] - 0.3 * (at - 4.5e-3)).max() < 1e-7
    assert v[100:, 0].mean() == pytest.approx(2.0, rel=1e-3) and v[100:, 0].std() > 0.0
    # ripple over many turns: its root mean square and nothing else
    share = np.sqrt(0.5 * (rig.ripple[0] ** 2).sum())
    assert sensors.ripple.low <= share <= sensors.ripple.high
    turns = np.linspace(0.0, 2.0 * np.pi * 10, 4001)
    waves = np.concatenate([f(np.outer(turns, rig.harmonics[0])) for f in (np.cos, np.sin)], axis=1)
    assert (waves @ rig.ripple[0]).std() == pytest.approx(share, rel=0.01)
    expected = (
        1.0 + np.concatenate([f(np.outer(2.0 * at, rig.harmonics[0])) for f in (np.cos, np.sin)], 1) @ rig.ripple[0]
    )
    assert np.abs(u[:, 0] - expected - rig.offset[0]).max() < 1e-9


def test_a_low_pass_reaches_a_step_after_its_time_constant():
    x = low_passed(np.append(0.0, np.ones(200)), 20.0)
    assert x[20] == pytest.approx(1.0 - np.exp(-1.0), abs=0.03) and x[-1] > 0.999


@pytest.mark.slow
def test_a_recording_of_an_engine_reads_back_and_equal_seeds_are_equal(tmp_path):
    quiet = Sensors(velocity=1e-3)
    made = [simulate_recording("w", "wheel", "payload", "mujoco", seed=3, trials=4, sensors=quiet) for _ in range(2)]
    assert made[0].digest() == made[1].digest()
    back = read_recording(write_recording(made[0], tmp_path / "w"))
    assert back.header == made[0].header and back.header.sampling.velocities == "measured"
    assert np.abs(back.states.to_numpy() - made[0].states.to_numpy()).max() < 1e-6
    derived = simulate_recording("w", "wheel", "payload", "mujoco", seed=4, trials=4)
    assert derived.header.sampling.velocities == "derived"


def test_unknown_causes_and_engines_are_refused():
    with pytest.raises(UserError, match="hides one of"):
        simulate_recording("w", "wheel", "cogging", "mujoco")
    with pytest.raises(UserError, match="engines are"):
        simulate_recording("w", "wheel", "payload", "bullet")  # pyright: ignore[reportArgumentType]
    none = Sensors(delay=Spread(low=0.0, high=0.0))
    assert none.sampling().delay == 0.0
