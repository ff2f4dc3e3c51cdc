"""Slides that end while they are watched, against parabolas fitted to their paths."""

import numpy as np
import pytest

from thesis_lib.contact.compliant.watched_slide import share_of_slide


@pytest.mark.parametrize("stops", [0.05, 0.2, 0.5, 0.9, 1.0, 1.4])  # of the time watched
def test_a_parabola_sees_as_much_of_a_slide_as_is_predicted(stops):
    slowing, span = 2.2, 0.4
    t = np.linspace(0.0, span, 4001)
    speed = slowing * np.maximum(stops * span - t, 0.0)
    path = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    half_a, v, _ = np.polyfit(t - 0.5 * span, path, 2)
    share = share_of_slide(np.array([v]), np.array([slowing]), span)
    assert share[0] == pytest.approx(-2.0 * half_a / slowing, abs=2e-3)


def test_bodies_at_rest_on_the_surface_are_carried_and_unwatched_ones_slide():
    assert share_of_slide(np.zeros(1), np.ones(1), 0.4) == 0.0
    assert share_of_slide(np.array([0.1]), np.ones(1), 0.0) == 1.0
