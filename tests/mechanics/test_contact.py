"""One contact in the plane and in space: the plane is a case of space, and momentum and energy hold in both."""

import numpy as np

from thesis_lib.mechanics.contact import Contact, contact, contact_at, velocity_change
from thesis_lib.mechanics.inertia import in_world, mobility
from thesis_lib.mechanics.space import PLANE, SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State

N = 100
EXACT = 1e-12  # rounding of numbers of order 1 to 10
K2 = 0.4  # m²
G = np.diag([0.3, 0.5, K2])


def planar(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return rng.standard_normal((2, N)), rng.standard_normal((1, N)), rng.standard_normal((2, N))


def in_xz(v: np.ndarray) -> np.ndarray:
    """A vector of the plane in the plane x, z of space."""
    return np.stack([v[0], 0.0 * v[0], v[1]])


def test_the_plane_is_a_case_of_space(rng):
    velocity, spin, r = planar(rng)
    flat = contact_at(PLANE, velocity, spin, r, 1.0 / K2)
    # counter-clockwise in x, z is about −y
    about_y = np.stack([0.0 * spin[0], -spin[0], 0.0 * spin[0]])
    still = np.tile(np.array([1.0, 0.0, 0.0, 0.0])[:, None], N)
    turning = mobility(SPACE, np.diag([0.3, K2, 0.5]), still)
    solid = contact_at(SPACE, in_xz(velocity), about_y, in_xz(r), turning)
    np.testing.assert_allclose(np.array(solid.v)[[0, 2]], np.array(flat.v), atol=EXACT)
    np.testing.assert_allclose(np.array(solid.K)[np.ix_([0, 2], [0, 2])], np.array(flat.K), atol=EXACT)
    np.testing.assert_allclose(np.array(solid.K)[1, [0, 2]], 0.0, atol=EXACT)
    c = rng.standard_normal((2, N))
    change, flat_change = velocity_change(in_xz(c), in_xz(r), turning), velocity_change(c, r, 1.0 / K2)
    np.testing.assert_allclose(change[[0, 2]], flat_change[:2], atol=EXACT)
    np.testing.assert_allclose(-change[4], flat_change[2], atol=EXACT)


def tumbling(rng: np.random.Generator) -> tuple[Contact, State, np.ndarray, np.ndarray]:
    attitude = of_rotation_vector(rng.standard_normal((3, N)))
    state = State(np.concatenate([np.zeros((3, N)), attitude]), rng.standard_normal((6, N)), None, None, space=SPACE)
    r, turning = rng.standard_normal((3, N)), mobility(SPACE, G, attitude)
    return contact(state, r, turning), state, r, turning


def test_an_impulse_in_space_changes_the_contact_velocity_by_its_compliance(rng):
    c = rng.standard_normal((3, N))
    space, state, r, turning = tumbling(rng)
    after = state.with_motion(state.motion + velocity_change(c, r, turning))
    np.testing.assert_allclose(contact(after, r, turning).v, space.velocity_after(*c), atol=EXACT)
    np.testing.assert_allclose(space.impulse_to(*space.velocity_after(*c)), c, atol=1e-11)
    np.testing.assert_allclose(
        np.einsum("ijn,jkn->nik", space.inverse, space.K), np.tile(np.eye(3), (N, 1, 1)), atol=1e-11
    )
    assert (space.det > 0.0).all()


def test_the_energy_lost_in_space_is_that_of_the_contact(rng):
    c = rng.standard_normal((3, N))
    space, state, r, turning = tumbling(rng)
    inertia = in_world(G, state.attitude)

    def twice_kinetic(motion: np.ndarray) -> np.ndarray:
        return (motion[:3] ** 2).sum(axis=0) + np.einsum("in,ijn,jn->n", motion[3:], inertia, motion[3:])

    lost = twice_kinetic(state.motion) - twice_kinetic(state.motion + velocity_change(c, r, turning))
    np.testing.assert_allclose(space.energy(*space.v) - space.energy(*space.velocity_after(*c)), lost, atol=1e-10)
