"""How beliefs widen, the law thrown with other parameters, and the restitution of contacts, on simulated throws."""

from dataclasses import replace

import numpy as np
import pytest
from throws_for_tests import HALF, RIG, made_contacts, throws

from thesis_lib.foundation.columns import explain
from thesis_lib.thesis.records.chapter4 import PUBLISHED as SHOWN
from thesis_lib.thesis.residual.dice.data import ThrowReleases
from thesis_lib.thesis.residual.dice.fit import DiceModel
from thesis_lib.thesis.residual.dice.models import Thrower
from thesis_lib.thesis.residual.dice.readings import LAW, PUBLISHED, _chi2, readings
from thesis_lib.thesis.residual.dice.results import STATES, belief_widths, restitution
from thesis_lib.thesis.residual.dice.settings import DiceStudySettings
from thesis_lib.thesis.residual.throwing.compliant_contact import CornerContact
from thesis_lib.thesis.residual.throwing.propagation import Sampled, ScatteredLaw
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings
from thesis_lib.thesis.residual.throwing.throw import simulate_throws

MODEL = DiceModel(HALF, 0.0, 0.0, RIG.k_g, LAW, 0.3, 0.6, 9.81)
N = 30
SETTINGS = DiceStudySettings(particles=20, bootstrap=50)


@pytest.fixture(scope="module")
def thrown() -> ThrowReleases:
    """Throws by the model, with the uncertainty of start that measured ones have."""
    q, v = throws(N)
    out = simulate_throws(MODEL.body, q, v, MODEL.impact, MODEL.mu, ThrowSettings(), np.random.default_rng(0))
    sigma = np.array([1e-4, 1e-4, 2e-3, 0.005, 0.005, 0.1])
    cov = np.tile(np.diag(sigma**2), (N, 1, 1))
    return ThrowReleases(np.arange(N), q, v, cov, out.q, {}, sigma[:3])


def widths(releases, contact):
    thrower = Thrower("law", MODEL, contact)
    table = belief_widths(thrower, releases, 2 * HALF, SETTINGS, np.random.default_rng(0))
    explain("dice_widths", table.columns)
    return table.set_index("state").loc[list(STATES)]


def test_uncertain_contacts_widen_a_belief_beyond_what_its_start_does(thrown):
    relative = np.diag([0.1, 0.1, 0.1 * RIG.k_g]) ** 2
    impact = ScatteredLaw(MODEL.body, MODEL.impact, relative=relative)
    table = widths(thrown, impact)
    assert table.loc["start", "ratio"] == 1.0
    # an impulse leaves the pose; the next contact is where the velocity has taken it
    assert table.loc["first contact", "ratio"] == pytest.approx(1.0, abs=0.05)
    late = table.loc[["second contact", "rest"]]
    assert (late["ratio"] - 2.0 * late["ratio_error"] > np.sqrt(2.0)).all()
    assert (np.diff(table["std"]) > 0.0).all()


def test_contacts_without_uncertainty_widen_nothing_though_the_belief_broadens(thrown):
    table = widths(thrown, Sampled(MODEL.body, MODEL.impact))
    assert (table["ratio"] == 1.0).all() and table["std"].equals(table["certain"])
    assert (np.diff(table["std"]) > 0.0).all()  # a thrown die is chaotic


def read(releases):
    table = readings(MODEL, releases, 2 * HALF, ThrowSettings(), (0.15, 0.3), (0.45, 0.6))
    explain("dice_readings", table.columns)
    return table.set_index(["rotation", "mu", "epsilon"])


def test_the_parameters_that_made_throws_are_told_from_others(thrown):
    table = read(thrown)
    assert table.loc[("given", 0.3, 0.6), ["mean", "std", "face_right"]].tolist() == pytest.approx([0.0, 0.0, 1.0])
    others = table.drop(("given", 0.3, 0.6))
    assert (others["std"] > 0.5).all() and (others["face_right"] < 0.8).all()


def test_a_mirrored_rotation_is_told_from_the_true_one(thrown):
    flip = np.array([1.0, 1.0, -1.0])
    table = read(replace(thrown, q=thrown.q * flip, v=thrown.v * flip, end=thrown.end * flip))
    assert table.loc[("mirrored", 0.3, 0.6), "std"] == pytest.approx(0.0)
    assert table.loc[("given", 0.3, 0.6), "std"] > 0.5


def test_a_throw_that_goes_farther_than_expected_is_a_positive_error(thrown):
    way = np.sign((thrown.end - thrown.q)[:, 0].mean())
    farther = replace(thrown, end=thrown.end + way * np.array([2.0 * HALF, 0.0, 0.0]))
    assert read(farther).loc[("given", 0.3, 0.6), "mean"] == pytest.approx(1.0)


def test_the_distance_from_the_thesis_counts_standard_errors():
    assert SHOWN["law"] == PUBLISHED
    assert _chi2(PUBLISHED, 485) == 0.0
    mean, std, face = PUBLISHED
    error = np.sqrt(1.0 / 485 + 1.0 / 750)
    assert _chi2((mean + 3.0 * std * error, std, face), 485) == pytest.approx(9.0)
    assert _chi2((mean, std, face - 2.0 * np.sqrt(face * (1.0 - face)) * error), 485) == pytest.approx(4.0)


def test_newtons_restitution_is_read():
    model = replace(MODEL, mu=0.1, epsilon=0.45, d_theta=-0.02)
    contacts = made_contacts(model, 200, span=0.01)
    table = restitution(model, contacts, ThrowSettings())
    assert 60 < len(table) < 200
    assert table["measured"].to_numpy() == pytest.approx(0.45, abs=0.02)
    assert table["model"].to_numpy() == pytest.approx(table["measured"].to_numpy(), abs=1e-9)
    assert set(table["trial"]) <= set(contacts.trial)


def test_a_place_that_gives_back_more_shows():
    soft = CornerContact(place=-0.03, width=0.03, far=1.0, far_dashpot=1.0)
    model = replace(MODEL, contact=soft)
    table = restitution(model, made_contacts(model, 200, span=0.01), ThrowSettings())
    near = np.abs(table["x"] + 0.03) < 0.015
    assert 20 < near.sum() < len(table) - 10
    assert table.loc[near, "measured"].mean() > table.loc[~near, "measured"].mean() + 0.03
