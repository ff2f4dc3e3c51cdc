"""Planar drops lifted into space: the same motion, in axes of its own."""

import numpy as np
import pytest

from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE
from thesis_lib.simulate.table.puck import simulate_puck
from thesis_lib.simulate.tosses.lifted import lifted
from thesis_lib.studies.proof.cases import Case, make


@pytest.mark.parametrize("shape", ["ellipse", "square"])
def test_a_lifted_drop_moves_as_it_did_in_its_plane(shape):
    planar, _ = make(Case("mechanism", "nothing", 5, drops=3, shape=shape))
    made = lifted(planar, np.random.default_rng(1))
    assert abs(made.in_space.gravity[2]) < 9.7
    (frame,) = surface_frames(made.in_space)
    seen = frame.seen(body_states(tracked_states(made.trajectories), made.in_space))
    x, y, theta = planar.trajectories[["x", "y", "theta"]].to_numpy().T
    np.testing.assert_allclose(seen.position[[0, 2]], [x, y], atol=1e-9)
    noise = planar.header.noise
    assert np.std(seen.position[1]) == pytest.approx(noise.position, rel=0.3)
    # the body's axis x, in the plane of the motion but for the noise across it
    axis = SPACE.turned(seen.attitude, np.array([[1.0], [0.0], [0.0]]))
    np.testing.assert_allclose(axis[[0, 2]], [np.cos(theta), np.sin(theta)], atol=3e-4)
    solid = made.in_space.body.solid
    flat = planar.header.body.shape.contact_point(theta)[:, 1]
    np.testing.assert_allclose(solid.lowest(seen.attitude)[2], flat, atol=1e-3)


def test_what_cannot_be_lifted_is_said():
    with pytest.raises(UserError, match="cannot be lifted"):
        lifted(simulate_puck("puck", "nothing", trials=2), np.random.default_rng(0))
