"""What a body in space does beside hits: a force of the surface is found with the motion."""

import numpy as np
import pytest

from thesis_lib.bodies.solids import Box
from thesis_lib.critique.likelihood.in_space.clear_flights import BetweenHits, Poses
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State

HALF, G = 0.05, 9.81
K2 = 2.0 / 3.0 * HALF**2  # of a cube: no axis turns another one
RIG = Rig(Box(half_extents=(HALF,) * 3), np.sqrt(K2), G, 0.0, tensor=K2 * np.eye(3))  # pyright: ignore[reportArgumentType]
NOISE, RATE, COUNT = (2e-4, 3e-3), 240.0, 6


def supported(rng, trials, push, noise=NOISE):
    """Cubes that rock on a corner, a trial each: a force `push` (3,) in m/s² acts on it; and the states at last."""
    tau = (np.arange(COUNT) - COUNT + 1) / RATE
    lean = of_rotation_vector(np.array([[0.5], [0.3], [0.0]]))
    r = RIG.shape.lowest(lean)[:, 0]  # pyright: ignore[reportAttributeAccessIssue]
    alpha = np.cross(r, push) / K2
    axis = np.cross(r, [0.1, 0.0, 1.0])
    axis /= np.linalg.norm(axis)  # that of the couple: the turn keeps to it
    a = np.array([*push[:2], push[2] - G])
    v, spin = np.array([0.1, 0.0, -0.2]), 3.0 * axis
    place = v * tau[:, None] + 0.5 * a * tau[:, None] ** 2 + [0.0, 0.0, -r[2]]
    turn = spin * tau[:, None] + 0.5 * alpha * tau[:, None] ** 2
    n = trials * COUNT
    place = np.tile(place, (trials, 1)) + noise[0] * rng.standard_normal((n, 3))
    attitude = SPACE.attitude_after(np.repeat(lean, n, axis=1), np.tile(turn, (trials, 1)).T)
    attitude = SPACE.attitude_after(attitude, noise[1] * rng.standard_normal((3, n)))
    t, trial = np.tile(tau - tau[0], trials), np.repeat(np.arange(trials), COUNT)
    states = State.of(np.c_[place, attitude.T], np.zeros((n, 6)), trial, t, None, SPACE)
    return Poses(Samples(trial, t, place, trial), states, RIG, NOISE), v, spin


@pytest.mark.parametrize("part", [0.0, 1.0])
def test_a_force_of_the_surface_is_found_with_the_motion(rng, part):
    trials = 400
    poses, v, spin = supported(rng, trials, np.array([0.1, 0.0, 1.0]) * part * G)
    row = np.arange(1, trials + 1) * COUNT - 1
    found = {}
    for clear in (True, False):
        fitted, good = poses.side(row, np.full(trials, COUNT), -1, poses.samples.t[row], np.full(trials, clear))
        motion = fitted.slope[:, 0] - fitted.bow[:, 0, 1:] * [0.0, 0.0, -G, 0.0, 0.0, 0.0]
        off = motion - np.r_[v, spin]
        cov = fitted.cov[:, 0, 1::2, 1::2]
        found[clear] = np.einsum("ni,nij,nj->n", off, np.linalg.inv(cov), off).mean(), np.abs(off.mean(axis=0))
        if not (part and clear):
            assert good.all()
    assert found[False][0] < 6.5  # six components; a force of the weight is nearer than one sigma
    assert found[True][0] > 5.0 * found[False][0] if part else found[True][0] == pytest.approx(6.0, abs=0.6)
    if part:
        assert found[True][1][2] > 5.0 * found[False][1][2] / 2.0 and found[True][1][2] > 0.05


def test_a_body_is_clear_between_two_touches_and_nowhere_else():
    t = np.arange(60) / RATE
    low = np.abs(np.sin(np.pi * 4.0 * t)) * 0.02  # touches at 0, 1/4 s
    states = np.c_[np.zeros((60, 2)), low + HALF, np.ones(60), np.zeros((60, 3))]
    states, one = State.of(states, np.zeros((60, 6)), np.zeros(60, int), t, None, SPACE), np.zeros(60, int)
    poses = Poses(Samples(one, t, states.position.T, one), states, RIG, NOISE)
    none = Hits(np.zeros(0, int), np.zeros(0), np.zeros(0, bool))
    seen = BetweenHits.of(poses, none, 0.0, ArcSettings())
    np.testing.assert_array_equal(seen.stretch, [[0, 59]])
    hit = Hits(np.zeros(1, int), t[30:31] + 0.5 / RATE, np.ones(1, bool))
    seen = BetweenHits.of(poses, hit, 0.0, ArcSettings())
    np.testing.assert_array_equal(seen.stretch, [[0, 30], [31, 59]])
    clear = low > 3.0 * np.hypot(NOISE[0], np.hypot(HALF, HALF) * NOISE[1])
    used = seen.flight[seen.count > 0]
    assert clear[used].all()
