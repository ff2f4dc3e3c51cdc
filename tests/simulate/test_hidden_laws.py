"""Laws hidden in compliant drops do what they say, to single contacts, and nothing at size 0."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.compliant.hidden_laws import HIDDEN_LAWS, hiding
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, CompliantContact

CONTACT = CompliantContact(contact_time=1e-3, steps=100)
K = ELLIPSE_BODY.radius_of_gyration
BALANCE = 1e-9  # N s and N m s, of impulses added up in single steps


def impacts_of(name: str, size: float | None = None, n: int = 40) -> pd.DataFrame:
    return run(n, engine=hiding(name, size))


def run(n: int = 40, **options) -> pd.DataFrame:
    drops = simulate_compliant_drops(
        ELLIPSE_BODY, PROOF_RELEASE, n, contact=CONTACT, rng=np.random.default_rng(5), **options
    )
    impacts = drops.impacts
    return impacts[(impacts["impact"] == 0) & impacts["separated"]].reset_index(drop=True)


@pytest.fixture(scope="module")
def plain() -> pd.DataFrame:
    return run()


@pytest.mark.slow
@pytest.mark.parametrize("name", HIDDEN_LAWS)
def test_the_hidden_law_moves_the_body_and_one_of_size_0_does_not(name: str, plain: pd.DataFrame) -> None:
    pd.testing.assert_frame_equal(impacts_of(name, 0.0), plain, rtol=1e-9, atol=1e-12)
    change = impacts_of(name)[["vx_post", "vy_post", "omega_post"]] - plain[["vx_post", "vy_post", "omega_post"]]
    error = np.linalg.norm(change.to_numpy() * [1.0, 1.0, K], axis=1)
    assert error.mean() > 0.02  # m/s, several times what the rig resolves


def couple_of(one: pd.DataFrame) -> np.ndarray:
    """Couple (n,) in N m s about the contact point before, that the change of ω asks for beside the impulse."""
    m = ELLIPSE_BODY.mass
    return m * K**2 * (one["omega_post"] - one["omega_pre"]) - (one["r_x"] * one["c_n"] - one["r_y"] * one["c_t"])


def test_a_couple_by_spin_acts_against_the_turning(plain: pd.DataFrame) -> None:
    one = impacts_of("couple_by_spin")
    extra = couple_of(one) - couple_of(plain)  # the contact point wanders in both
    turning = 0.5 * (one["omega_pre"] + one["omega_post"])
    clear = np.abs(turning) > 5.0
    assert np.mean(np.sign(extra[clear]) == -np.sign(turning[clear])) > 0.9


def test_friction_by_release_grows_with_the_releases() -> None:
    """Where a contact slides to its end, c_t = μ (1 + a i/100) c_n."""
    one = impacts_of("friction_by_release", n=120)
    ratio = np.abs(one["c_t"] / one["c_n"])
    expected = CONTACT.mu * (1.0 + HIDDEN_LAWS["friction_by_release"].size * one["trial"] / 100.0)
    assert (ratio <= expected * (1.0 + 1e-6)).all()
    assert np.mean(ratio > 0.99 * expected) > 0.2


def test_restitution_by_obliquity_rebounds_less_where_it_slides(plain: pd.DataFrame) -> None:
    lower = impacts_of("restitution_by_obliquity")["c_n"] / plain["c_n"]
    slip = np.abs(plain["vx_pre"] - plain["r_y"] * plain["omega_pre"])
    speed = np.hypot(slip, plain["vy_pre"] + plain["r_x"] * plain["omega_pre"])
    assert np.corrcoef(lower, slip / speed)[0, 1] < -0.8
    assert (lower < 1.0 + 1e-3).all()
