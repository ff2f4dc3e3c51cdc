"""The puck on its table slides, bounces and loses what it is told to lose."""

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.table import puck
from thesis_lib.simulate.table.mujoco_puck import slide_in_mujoco
from thesis_lib.simulate.table.puck import CONTACT, FRICTION, RADIUS, hidden_table, simulate_puck

EAST_EDGE = puck.LENGTH / 2 - RADIUS
# contacts are integrated in steps of 2 µs, 500 in a contact
STEPPED = 5e-3


def path(speed: tuple[float, float], hidden: str = "nothing", spin: float = 0.0, **size: float):
    """Times (T,), positions (T, 2) and velocities (T − 1, 2) of one puck from the middle of the table."""
    times = np.arange(0.0, 0.6, 1e-4)
    q = puck.slide(np.zeros((1, 2)), np.array([speed]), np.array([spin]), hidden_table(hidden, **size), times)[0]
    return times, q, np.diff(q, axis=0) / 1e-4


def before_and_after(v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocities just before and just after the only impact on the east cushion."""
    last = np.flatnonzero(v[:, 0] > 0.0)
    turn = last[np.flatnonzero(np.diff(last) > 1)[0]] if (np.diff(last) > 1).any() else last[-1]
    margin = int(1.5 * CONTACT / 1e-4)
    return v[turn - margin], v[turn + margin]


def test_the_table_slows_it_along_its_way() -> None:
    _, q, v = path((0.6, 0.3))
    speed = np.hypot(*v[:3000].T)
    assert np.polyfit(np.arange(3000) * 1e-4, speed, 1)[0] == pytest.approx(-FRICTION, rel=1e-3)
    np.testing.assert_allclose(q[:3000, 1], 0.5 * q[:3000, 0], atol=1e-12)


@pytest.mark.parametrize("speed", [1.3, 2.5])
def test_a_cushion_gives_back_its_share(speed: float) -> None:
    v, w = before_and_after(path((speed, 0.0))[2])
    assert -w[0] / v[0] == pytest.approx(puck.EPSILON, abs=STEPPED)
    v, w = before_and_after(path((speed, 0.0), "quick_cushion", size=0.1)[2])
    expected = puck.EPSILON * (1.0 + 0.1 * (abs(v[0]) - 1.0))
    assert -w[0] / v[0] == pytest.approx(expected, abs=STEPPED)


def test_a_rim_that_slides_throughout_feels_all_of_the_friction() -> None:
    v, w = before_and_after(path((2.5, 1.2), spin=20.0)[2])
    assert v[1] - w[1] == pytest.approx(puck.MU * (v[0] - w[0]), abs=STEPPED)


def test_a_rim_that_rolls_feels_none() -> None:
    v, w = before_and_after(path((1.3, 0.5), spin=-0.5 / RADIUS)[2])
    assert abs(v[1] - w[1]) < 0.02 * abs(v[0])  # friction with the table has slowed it down a little until there


def test_it_stays_on_the_table_and_never_gets_faster() -> None:
    _, q, v = path((1.9, 1.1), spin=15.0)
    assert np.abs(q[:, 0]).max() < EAST_EDGE + 2e-3
    free = np.hypot(*v.T)
    assert free.max() < np.hypot(1.9, 1.1) + 1e-9


@pytest.mark.parametrize(("hidden", "size"), [("dead_cushion", 0.5), ("quick_cushion", 2.0), ("shifted_cushion", 1.0)])
def test_impossible_sizes_are_refused(hidden: str, size: float) -> None:
    with pytest.raises(UserError, match="is not possible"):
        simulate_puck("puck", hidden, size=size)


def test_unknown_causes_are_refused_with_the_known_ones() -> None:
    with pytest.raises(UserError, match="quick_cushion, dead_cushion"):
        simulate_puck("puck", "loose_cushion")


class TestMujoco:
    def test_it_does_as_our_own_simulator_does(self) -> None:
        """Straight hits; where the rim slides MuJoCo's friction lifts the puck, which ours does not."""
        times, table = np.arange(0.0, 0.5, 1e-3), hidden_table("dead_cushion")
        q, v, spin = np.zeros((2, 2)), np.array([[2.0, 0.0], [0.0, -1.8]]), np.zeros(2)
        ours, theirs = (move(q, v, spin, table, times) for move in (puck.slide, slide_in_mujoco))
        np.testing.assert_allclose(theirs, ours, atol=4e-3)  # their contacts last a millisecond, ours 0.9
        east, _ = before_and_after_straight(theirs[0, :, 0], times)
        assert east == pytest.approx(puck.EPSILON - 0.08, abs=0.01)

    def test_what_no_contact_of_mujocos_does_is_refused(self) -> None:
        with pytest.raises(UserError, match="quick_cushion"):
            simulate_puck("puck", "quick_cushion", trials=1, move=slide_in_mujoco)

    def test_the_same_seed_has_the_same_releases(self) -> None:
        tables = [
            simulate_puck("puck", "nothing", trials=2, move=move).trajectories for move in (None, slide_in_mujoco)
        ]
        first = [table.iloc[:3][["x", "y"]].to_numpy() for table in tables]
        np.testing.assert_allclose(*first, atol=2e-4)


def before_and_after_straight(x: np.ndarray, times: np.ndarray) -> tuple[float, float]:
    """Restitution of the only straight hit of a path x (T,), and its instant in s."""
    at = int(np.argmax(x))
    before, after = (np.polyfit(times[rows], x[rows], 2) for rows in (slice(at - 60, at - 3), slice(at + 3, at + 60)))
    speeds = [np.polyval(np.polyder(line), times[at]) for line in (before, after)]
    return -speeds[1] / speeds[0], float(times[at])
