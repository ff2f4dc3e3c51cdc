"""Couples, sideways forces and friction along the path of an impact, against effects of the library and mechanics."""

import numpy as np
import pytest

from thesis_lib.contact import LAWS
from thesis_lib.contact.space import contact_space
from thesis_lib.effects.driven_path import driven
from thesis_lib.effects.effect import Impulse, Rig
from thesis_lib.effects.velocity_dependent_friction import EFFECT as STRIBECK
from thesis_lib.extensions.effect_probe import EPSILON, MU, RIGS, random_states
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.state import State

N = 400
ROUNDING = 1e-12  # m/s, the same steps taken in another order
STEP_ERROR = 0.02  # m/s, of 12 steps where a slip reverses within one


@pytest.fixture(scope="module")
def struck() -> tuple[Rig, State, Contact, Impulse]:
    """An ellipse in random states: its contact and the impulse of the energetic law."""
    rig = RIGS["ellipse"]
    state = random_states(rig, N, np.random.default_rng(3))
    r = rig.shape.contact_point(state.theta)
    space = contact_space(state.v, r, mass=1.0, k_g=rig.k_g).with_coefficients(np.full(N, MU), np.full(N, EPSILON))
    with np.errstate(all="ignore"):
        law = Impulse(LAWS["mirtich"].impulse(space, space.mu, space.epsilon), np.zeros(N))
    return rig, state, space, law


def ends(struck, made: Impulse) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """ω, v_t and v_n after an impulse with a couple."""
    rig, state, space, _ = struck
    (r_x, r_y), turn = space.r, made.couple / rig.k_g**2
    omega = state.omega + (r_x * made.c_n - r_y * made.c_t) / rig.k_g**2 + turn
    v_t, v_n = space.velocity_after(made.c_t, made.c_n)
    return omega, v_t - r_y * turn, v_n + r_x * turn


def on(struck, **acting) -> Impulse:
    _, state, space, law = struck
    return driven(law, space, state.omega, **acting)


def test_nothing_that_acts_changes_nothing(struck) -> None:
    law, same = struck[-1], on(struck, couple=lambda v_t, omega: 0.0 * omega, factor=lambda v_t, omega: 1.0 + 0.0 * v_t)
    for name in ("c_t", "c_n", "couple"):
        np.testing.assert_array_equal(getattr(same, name), getattr(law, name))


def test_friction_of_the_slip_is_that_of_the_librarys_effect(struck) -> None:
    rig, state, space, law = struck
    p = {"s": 0.8, "v_s": 0.5}
    theirs = STRIBECK.impulse(law, space, state, p, rig)
    ours = on(struck, factor=lambda v_t, omega: 1.0 + p["s"] * np.exp(-((v_t / p["v_s"]) ** 2)))
    np.testing.assert_allclose(ours.c_t, theirs.c_t, atol=ROUNDING)
    np.testing.assert_allclose(ours.c_n, theirs.c_n, atol=ROUNDING)


def test_a_couple_against_the_turning_takes_energy(struck) -> None:
    rig, state, _, law = struck

    def energy(made: Impulse) -> np.ndarray:
        omega, *_ = ends(struck, made)
        return (state.vx + made.c_t) ** 2 + (state.vy + made.c_n) ** 2 + (rig.k_g * omega) ** 2

    braked = on(struck, couple=lambda v_t, omega: -2e-5 * omega)
    driving = on(struck, couple=lambda v_t, omega: 2e-5 * omega)
    # not each: with another slip friction takes another share
    assert np.mean(energy(braked) < energy(law)) > 0.9
    assert np.mean(energy(driving) > energy(law)) > 0.9
    assert np.abs(braked.couple).max() > 1e-5


def test_a_contact_that_sticks_resists_what_pushes_it_sideways(struck) -> None:
    """Where friction bears the push, the slip ends as it did; beyond it the contact is driven along."""
    law = struck[-1]
    _, v_t, _ = ends(struck, law)
    sticks = np.abs(v_t) < 1e-9
    assert sticks.sum() > 20
    _, pushed, _ = ends(struck, on(struck, sideways=lambda v_t, omega: np.full_like(v_t, 0.02)))
    assert np.median(np.abs(pushed[sticks])) < STEP_ERROR
    assert pushed[~sticks].mean() > v_t[~sticks].mean() + STEP_ERROR


def test_restitution_goes_by_the_energy_that_is_left(struck) -> None:
    """A couple that lifts the contact point does not leave it inside the surface."""
    _, _, v_n = ends(struck, on(struck, couple=lambda v_t, omega: np.full_like(v_t, 2e-3)))
    assert v_n.min() > -STEP_ERROR


def test_what_feeds_itself_stays_bounded(struck) -> None:
    wild = on(struck, sideways=lambda v_t, omega: 50.0 * v_t, couple=lambda v_t, omega: omega)
    assert all(np.isfinite(getattr(wild, name)).all() for name in ("c_t", "c_n", "couple"))
    assert (np.abs(wild.couple) <= RIGS["ellipse"].k_g * wild.c_n * (1.0 + 1e-9)).all()
