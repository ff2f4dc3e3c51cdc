"""Restitution read from contacts is the restitution that made them."""

import numpy as np
import pytest
from throws_for_tests import made_contacts

from thesis_lib.thesis.residual.dice.fit import DiceModel
from thesis_lib.thesis.residual.dice.results import restitution
from thesis_lib.thesis.residual.throwing.compliant_contact import CornerContact
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings

LAW = DiceModel(0.03, 0.0, 0.0, 0.0245, "anitescu_potra_newton", 0.1, 0.45, 9.81, d_theta=-0.02)


def test_newtons_restitution_is_read():
    contacts = made_contacts(LAW, 200, span=0.01)
    table = restitution(LAW, contacts, ThrowSettings())
    assert 60 < len(table) < 200
    assert table["measured"].to_numpy() == pytest.approx(0.45, abs=0.02)
    assert table["model"].to_numpy() == pytest.approx(table["measured"].to_numpy(), abs=1e-9)
    assert set(table["trial"]) <= set(contacts.trial)


def test_a_place_that_gives_back_more_shows():
    soft = CornerContact(place=-0.03, width=0.03, far=1.0, far_dashpot=1.0)
    model = DiceModel(0.03, 0.0, 0.0, 0.0245, "mirtich", 0.1, 0.5, 9.81, contact=soft)
    table = restitution(model, made_contacts(model, 200, span=0.01), ThrowSettings())
    near = np.abs(table["x"] + 0.03) < 0.015
    assert 20 < near.sum() < len(table) - 10
    assert table.loc[near, "measured"].mean() > table.loc[~near, "measured"].mean() + 0.03
