"""The ground as hits show it: the right corner is seen to touch, although gaps are read with a wrong geometry."""

import numpy as np
import pytest

from thesis_lib.bodies.solids import Box
from thesis_lib.critique.likelihood.in_space import ground
from thesis_lib.critique.likelihood.in_space.ground import Ground, SeenRig
from thesis_lib.critique.likelihood.in_space.hits import observe_in_space
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.tosses.example import simulate_tosses
from thesis_lib.statistics.spread import robust_std

BOX = Box(half_extents=(0.06, 0.045, 0.03))
NOISE = 2e-4  # m
RIG = Rig(BOX, 0.03, 9.81, 0.0, tensor=BOX.moments.inertia_per_mass)


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
    z = -above.min(axis=0) + NOISE * rng.standard_normal(n)
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
    rig = SeenRig(**vars(RIG), ground=Ground.seen(RIG, states))
    assert robust_std(RIG.gap(states)) > 6.0 * NOISE
    gap = np.delete(rig.gap(states), np.s_[::20])
    assert abs(np.median(gap)) < 0.5 * NOISE and robust_std(gap) < 1.8 * NOISE
    assert robust_std(rig.gap(states)[::20] - 0.02) < 1e-3


def test_the_corner_that_touches_is_the_lowest_one_above_a_bent_ground():
    states, corner = _hits(bowl, turn=0.1)
    rig = SeenRig(**vars(RIG), ground=Ground.seen(RIG, states))

    def right(heights: np.ndarray) -> float:
        return float((heights.argmin(axis=0) == corner).mean())

    np.testing.assert_allclose(rig.heights(states).min(axis=0), rig.gap(states), atol=1e-12)
    assert right(SeenRig(**vars(RIG)).heights(states)) < 0.95 < 0.985 < right(rig.heights(states))


def test_what_is_believed_stays_where_it_serves_or_too_few_hits_show_more():
    assert Ground.seen(RIG, _hits(flat)[0]) is None
    assert Ground.seen(RIG, _hits(bowl, n=ground.FEWEST - 1)[0]) is None


def test_a_camera_that_is_not_square_to_the_table_hides_no_flight(monkeypatch):
    dataset = simulate_tosses("tosses", "box", {"camera_pose.b_x": 0.02, "camera_pose.b_y": -0.025}, drops=45, seed=2)
    found = observe_in_space(dataset)
    monkeypatch.setattr(ground, "FEWEST", 10**9)
    believed = observe_in_space(dataset)
    assert len(found.flights) > 1.2 * len(believed.flights)
    assert found.hits.sum() > believed.hits.sum()
