"""Chapter 2's bodies have the thesis's numbers, their releases are free, and draws do not hang on their number."""

import numpy as np
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.motions import (
    BODIES,
    DEFAULT,
    ArmSettings,
    Chapter2Bodies,
    Releases,
    arm_trajectories,
    releases,
)
from thesis_lib.simulate.rig.release import Spread


def test_ratios_of_mass_and_inertia_are_those_of_the_thesis():
    assert DEFAULT.ratios["block"] == pytest.approx(6.0)
    assert DEFAULT.ratios["ellipse"] == pytest.approx(0.8)
    assert (DEFAULT.mass, DEFAULT.epsilon, DEFAULT.mu) == (1.0, 0.6, 0.7)


def test_inertias_are_those_of_uniform_bodies():
    for name in ("block", "ellipse", "disk"):
        body = BODIES[name](DEFAULT)
        assert body.inertia == pytest.approx(body.mass * body.shape.radius_of_gyration**2)


@pytest.mark.parametrize("kind", BODIES)
def test_releases_are_free_of_the_surface_and_repeat(kind):
    q, v = releases(kind, 200, np.random.default_rng(1))
    assert q.shape == v.shape == (200, 3)
    assert BODIES[kind](DEFAULT).contacts_of(q).phi.min() > -1e-12
    q_few, v_few = releases(kind, 5, np.random.default_rng(1))
    assert np.array_equal(q_few, q[:5]) and np.array_equal(v_few, v[:5])


def test_what_is_refused():
    with pytest.raises(UserError, match="cone"):
        releases("cone", 1, np.random.default_rng(0))
    low = Chapter2Bodies(block_release=Releases(height=Spread(low=0.5, high=0.6)))
    with pytest.raises(UserError, match="block_release"):
        releases("block", 100, np.random.default_rng(0), low)
    idle = Chapter2Bodies(arm=ArmSettings(steps=20, min_contact=21))
    with pytest.raises(UserError, match="min_contact"):
        arm_trajectories(1, np.random.default_rng(0), idle)
    with pytest.raises(ValueError, match="less than or equal to"):
        ArmSettings(mu=0.7)
