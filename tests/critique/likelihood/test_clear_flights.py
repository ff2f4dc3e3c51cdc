"""What a body in space does beside hits: a force of the surface is found with the motion.

The ground as hits show it: the right corner is seen to touch, although gaps are read with a wrong geometry.
"""

import numpy as np
import pytest

from thesis_lib.bodies.solids import Box
from thesis_lib.critique.likelihood.in_space import ground
from thesis_lib.critique.likelihood.in_space.clear_flights import BetweenHits, Poses
from thesis_lib.critique.likelihood.in_space.ground import Ground, SeenRig
from thesis_lib.critique.likelihood.in_space.hits import observe_in_space
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.tosses.example import simulate_tosses
from thesis_lib.statistics.spread import robust_std

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


BOX = Box(half_extents=(0.06, 0.045, 0.03))
OF_BOX = Rig(BOX, 0.03, 9.81, 0.0, tensor=BOX.moments.inertia_per_mass)


def _hits(height, n: int = 240, turn: float = 2.0, scale: float = 1.0, off=(0.0, 0.0, 0.0)) -> tuple[State, np.ndarray]:
    """Bodies as they are believed to lie when they touch a surface of `height` (x, y), and the corner that does.

    Truly they are larger by `scale`, and their centre is `off` in m, along their axes.
    """
    rng = np.random.default_rng(5)
    place = rng.uniform(-0.3, 0.3, (2, n))
    pose = np.concatenate([place, np.zeros((1, n)), of_rotation_vector(turn * rng.standard_normal((3, n)))])
    states = State(pose, np.zeros((6, n)), np.arange(n), np.zeros(n), None, SPACE)
    corners = scale * BOX.minkowski.centres + np.asarray(off)[:, None]
    r = np.stack([states.turned(corner[:, None]) for corner in corners.T])  # (p, 3, n)
    above = r[:, 2] - height(place[0] + r[:, 0], place[1] + r[:, 1])
    z = -above.min(axis=0) + NOISE[0] * rng.standard_normal(n)
    return states.changed(position=np.concatenate([place, z[None]])), above.argmin(axis=0)


def bowl(x, y):
    return 0.1 * (x * x + y * y) + 0.02 * x


def flat(x, y):
    return 0.0 * x


OTHER = {"scale": 1.06, "off": (0.003, -0.002, 0.002)}


@pytest.mark.parametrize(("height", "wrong"), [(bowl, {}), (flat, OTHER)], ids=["bent", "other body"])
def test_the_ground_of_hits_holds_what_is_believed_wrongly(height, wrong):
    states, _ = _hits(height, **wrong)
    states.pose[2, ::20] += 0.02  # hits on something else
    rig = SeenRig(**vars(OF_BOX), ground=Ground.seen(OF_BOX, states))
    assert robust_std(OF_BOX.gap(states)) > 6.0 * NOISE[0]
    gap = np.delete(rig.gap(states), np.s_[::20])
    assert abs(np.median(gap)) < 0.5 * NOISE[0] and robust_std(gap) < 1.8 * NOISE[0]
    assert robust_std(rig.gap(states)[::20] - 0.02) < 1e-3


def test_the_corner_that_touches_is_the_lowest_one_above_a_bent_ground():
    states, corner = _hits(bowl, turn=0.1)
    rig = SeenRig(**vars(OF_BOX), ground=Ground.seen(OF_BOX, states))

    def right(heights: np.ndarray) -> float:
        return float((heights.argmin(axis=0) == corner).mean())

    np.testing.assert_allclose(rig.heights(states).min(axis=0), rig.gap(states), atol=1e-12)
    assert right(SeenRig(**vars(OF_BOX)).heights(states)) < 0.95 < 0.985 < right(rig.heights(states))


def test_what_is_believed_stays_where_it_serves_or_too_few_hits_show_more():
    assert Ground.seen(OF_BOX, _hits(flat)[0]) is None
    assert Ground.seen(OF_BOX, _hits(bowl, n=ground.FEWEST - 1)[0]) is None


def test_a_camera_that_is_not_square_to_the_table_hides_no_flight(monkeypatch):
    dataset = simulate_tosses("tosses", "box", {"camera_pose.b_x": 0.02, "camera_pose.b_y": -0.025}, drops=45, seed=2)
    found = observe_in_space(dataset)
    monkeypatch.setattr(ground, "FEWEST", 10**9)
    believed = observe_in_space(dataset)
    assert len(found.flights) > 1.2 * len(believed.flights)
    assert found.hits.sum() > believed.hits.sum()
