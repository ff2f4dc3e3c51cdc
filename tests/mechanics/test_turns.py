"""Quaternions and turns against SciPy, and the inverse of each operation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from thesis_lib.mechanics.inertia import in_world, mobility
from thesis_lib.mechanics.space import (
    PLANE,
    SPACE,
    Space,
    cross,
    multiplied,
    of_rotation_vector,
    rotated,
    rotation_matrix,
    rotation_vector,
)
from thesis_lib.mechanics.state import State

N = 200
EXACT = 1e-13  # rounding of numbers of order 1
G = np.array([[4.0, 0.3, -0.2], [0.3, 5.0, 0.1], [-0.2, 0.1, 6.0]])


def turns(space: Space, rng: np.random.Generator, size: float = 1.0) -> np.ndarray:
    return size * rng.standard_normal((space.turns, N))


def poses(space: Space, rng: np.random.Generator) -> np.ndarray:
    position = rng.standard_normal((space.dimension, N))
    return np.concatenate([position, turns(space, rng) if space.is_plane else of_rotation_vector(turns(space, rng))])


def scipy_of(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1, axis=0).T)


def test_quaternions_agree_with_scipy(rng):
    first, second = poses(SPACE, rng)[3:], poses(SPACE, rng)[3:]
    u = rng.standard_normal((3, N))
    np.testing.assert_allclose(rotated(first, u).T, scipy_of(first).apply(u.T), atol=EXACT)
    np.testing.assert_allclose(np.moveaxis(rotation_matrix(first), -1, 0), scipy_of(first).as_matrix(), atol=EXACT)
    product = scipy_of(multiplied(first, second)) * (scipy_of(first) * scipy_of(second)).inv()
    assert product.magnitude().max() < 1e-7  # the angle of a product that is 1 up to rounding
    np.testing.assert_allclose(rotation_vector(first).T, scipy_of(first).as_rotvec(), atol=1e-12)


@pytest.mark.parametrize("space", [PLANE, SPACE])
def test_a_state_turns_vectors_with_its_own_pose_whatever_it_was_made_from(space, rng):
    u, no = rng.standard_normal((space.dimension, 1)), np.zeros(N)
    state = State(poses(space, rng), rng.standard_normal((space.motions, N)), no, no, space=space)
    turned = state.turned(u)
    np.testing.assert_array_equal(turned, space.turned(state.attitude, u))
    other = poses(space, rng)[space.dimension :]
    for made in (state.changed(velocity=2.0 * state.velocity), state.changed(attitude=other), state.tiled(3)):
        for last in (made, made.with_motion(2.0 * made.motion), made.select(slice(None, 7))):
            np.testing.assert_array_equal(last.turned(u), space.turned(last.attitude, u))


@pytest.mark.parametrize("size", [1e-9, 1e-4, 2e-4, 1.0])
def test_rotation_vectors_come_back(size, rng):
    turn = turns(SPACE, rng, size)
    turn /= np.maximum(np.linalg.norm(turn, axis=0) / 3.0, 1.0)  # within half a turn
    np.testing.assert_allclose(rotation_vector(of_rotation_vector(turn)), turn, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("space", [PLANE, SPACE], ids=["plane", "space"])
def test_shift_undoes_difference(space, rng):
    first, second = poses(space, rng), poses(space, rng)
    again = space.shift(first, space.difference(second, first))
    assert np.abs(space.difference(again, second)).max() < 1e-12


def test_mobility_is_the_inverse_inertia_in_the_world(rng):
    attitude = poses(SPACE, rng)[3:]
    product = np.einsum("ijn,jkn->nik", mobility(SPACE, G, attitude), in_world(G, attitude))
    np.testing.assert_allclose(product, np.tile(np.eye(3), (N, 1, 1)), atol=EXACT)
    each = np.repeat(G[:, :, None], N, axis=2)
    np.testing.assert_allclose(mobility(SPACE, each, attitude), mobility(SPACE, G, attitude), atol=EXACT)


def test_of_no_bodies_there_are_no_turns():
    none, one = np.zeros((4, 0)), np.ones((3, 1))
    assert rotated(none, one).shape == cross(np.zeros((3, 0)), one).shape == (3, 0)
    assert multiplied(none, np.ones((4, 1))).shape == multiplied(np.ones((4, 1)), none).shape == (4, 0)
