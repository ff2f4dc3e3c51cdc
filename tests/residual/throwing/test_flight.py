"""Flights in closed form and the first touch, against brute force and known answers."""

import numpy as np
import pytest
from throws_for_tests import HALF, starts, thrown_square

from thesis_lib.thesis.residual.throwing.flight import TOUCH, ThrownBody, first_touch, fly


@pytest.mark.parametrize("drag", [(0.0, 0.0), (0.5, 0.7)])
def test_a_flight_solves_its_equation_of_motion(drag):
    body = thrown_square(c_v=drag[0], c_w=drag[1])
    q, v = starts(20, np.random.default_rng(0))
    t = np.full(20, 0.13)
    h = 1e-5
    late, early, now = (fly(body, q, v, t + s)[1] for s in (h, -h, 0.0))
    acceleration = (late - early) / (2 * h)
    expected = -now * [drag[0], drag[0], drag[1]] + [0.0, -9.81, 0.0]
    assert acceleration == pytest.approx(expected, abs=1e-7)
    position = (fly(body, q, v, t + h)[0] - fly(body, q, v, t - h)[0]) / (2 * h)
    assert position == pytest.approx(now, abs=1e-7)


@pytest.mark.parametrize("drag", [(0.0, 0.0), (0.5, 0.7)])
@pytest.mark.parametrize("rho", [0.0, 0.004])
def test_no_corner_is_in_the_surface_before_the_first_touch(drag, rho):
    body = thrown_square(rho=rho, c_v=drag[0], c_w=drag[1])
    q, v = starts(200, np.random.default_rng(1))
    t, corner = first_touch(body, q, v)
    at, _ = fly(body, q, v, t)
    assert np.abs(body.gap(at)).max() < 2 * TOUCH
    lowest, _ = body.lowest(at[:, 2])
    assert body.contact_point(at[:, 2], corner)[:, 1] == pytest.approx(lowest[:, 1], abs=2 * TOUCH)
    for share in np.linspace(0.0, 0.999, 400):  # brute force: every touch is seen at 0.1 ms
        assert body.gap(fly(body, q, v, share * t)[0]).min() > 0.0


def test_a_corner_that_separates_is_no_touch():
    body = thrown_square()
    q = np.array([[0.0, HALF * np.sqrt(2), np.pi / 4]])
    t, _ = first_touch(body, q, np.array([[0.0, 0.5, 0.0]]))
    assert t[0] == pytest.approx(2 * 0.5 / 9.81, rel=1e-4)  # up and down again
    assert first_touch(body, q, np.array([[0.0, -0.5, 0.0]]))[0][0] == 0.0


def test_sides_and_heights_of_a_square_and_of_a_shifted_centre():
    body = thrown_square(rho=0.003)
    assert np.sort(body.faces) == pytest.approx([-np.pi / 2, 0.0, np.pi / 2, np.pi])
    assert body.rest_height == pytest.approx(HALF)
    sharp = thrown_square()
    assert sharp.barrier == pytest.approx(HALF * (np.sqrt(2) - 1))
    shifted = ThrownBody(sharp.u - [0.0, 0.005], 0.0, 0.0245, 9.81)
    down = shifted.face(np.array([0.0, np.pi]))
    assert shifted.rest_height[down] == pytest.approx([HALF + 0.005, HALF - 0.005])
    lying = np.column_stack([np.zeros(4), shifted.rest_height, shifted.faces])
    assert shifted.gap(lying) == pytest.approx(0.0)


def test_whole_turns_do_not_change_the_side():
    body = thrown_square()
    theta = np.random.default_rng(2).uniform(-4, 4, 50)
    assert (body.face(theta) == body.face(theta + 4 * np.pi)).all()
