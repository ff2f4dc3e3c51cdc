"""Uncertain contacts: feasibility, limits, counts, and recovery of a planted residual."""

from dataclasses import replace

import numpy as np
import pytest
from throws_for_tests import BELIEVED, BODY, METRIC, RIG, TRUTH, made_contacts, throws, touching

from thesis_lib.contact import LAWS
from thesis_lib.contact.space import velocity_error
from thesis_lib.learners.gaussian_process import GaussianProcessSettings
from thesis_lib.thesis.residual.dice.data import LongFlights, flight_drag
from thesis_lib.thesis.residual.dice.fit import choose_mechanisms, cma_es, contact_path, fit_dice, touch_down
from thesis_lib.thesis.residual.dice.models import contact_map, train_missed
from thesis_lib.thesis.residual.dice.settings import DiceFitSettings, DiceStudySettings
from thesis_lib.thesis.residual.throwing.compliant_contact import CornerContact
from thesis_lib.thesis.residual.throwing.flight import fly
from thesis_lib.thesis.residual.throwing.propagation import PENETRATION, Sampled, ScatteredLaw
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings
from thesis_lib.thesis.residual.throwing.throw import LawImpact, simulate_throws

LAW = LawImpact(LAWS["mirtich"], 0.15, 0.5, RIG.k_g)
WIDE = np.diag([0.2, 0.2, 0.005]) ** 2
SOFT = replace(TRUTH, contact=CornerContact(omega=900.0, damping=0.2, dashpot=0.2, mu=0.18, tau=0.2))


def test_samples_neither_penetrate_nor_gain_energy():
    contact = ScatteredLaw(BODY, LAW, relative=WIDE)
    q, v, r = touching(2000)
    _, after, _ = contact(q, v, r, np.zeros(2000, bool), np.random.default_rng(0))
    assert (np.linalg.norm(after * METRIC, axis=1) <= np.linalg.norm(v * METRIC, axis=1) + 1e-12).all()
    assert (after[:, 1] + r[:, 0] * after[:, 2] >= 0.0).all()


def test_a_contact_without_feasible_samples_takes_the_law():
    contact = ScatteredLaw(BODY, LAW, relative=np.diag([0.0, 0.0, 100.0]) ** 2)
    at = *touching(500), np.zeros(500, bool), np.random.default_rng(0)
    (_, after, _), (_, expected, _) = contact(*at), LAW(*at)
    assert np.isclose(after, expected).all(1).sum() > 400


def test_no_scatter_is_the_law():
    q, v = throws(200)
    certain = simulate_throws(BODY, q, v, LAW, 0.15, ThrowSettings(), np.random.default_rng(0))
    for contact in (Sampled(BODY, LAW), ScatteredLaw(BODY, LAW, relative=np.zeros((3, 3)))):
        out = simulate_throws(BODY, q, v, contact, 0.15, ThrowSettings(), np.random.default_rng(1))
        assert out.q == pytest.approx(certain.q)


class Dented(Sampled):
    """A contact that takes time, and ends somewhere near the surface."""

    def distribution(self, q, v, r, slow):
        mean, cov, took = super().distribution(q, v, r, slow)
        cov[:, 1, 1] = PENETRATION**2
        mean[:, 4] *= 0.9  # some energy is left for poses that are higher
        return mean, cov, took + 0.01


def test_a_sample_that_ends_below_the_surface_is_lifted_onto_it():
    after, _, _ = Dented(BODY, LAW)(*touching(1000), np.zeros(1000, bool), np.random.default_rng(0))
    gap = BODY.gap(after)
    on_it, above = np.abs(gap) < 1e-12, gap > 1e-12
    assert (on_it | above).all()
    assert min(on_it.mean(), above.mean()) > 0.3  # a dent of a millimetre does not ask for another draw


@pytest.mark.slow
def test_the_fit_finds_a_planted_body_and_contact():
    contacts = made_contacts(SOFT, 120)
    fitted, misfit = fit_dice(BELIEVED, contacts, np.random.default_rng(0), DiceFitSettings(evaluations=1500))
    even = replace(SOFT, contact=CornerContact())
    _, v = contact_path(even, even.seen(contacts.q), contacts.v, contacts.span, ThrowSettings())
    without = velocity_error(contacts.v_after - v, SOFT.k_g).mean()
    assert misfit < 0.03 and misfit < 0.15 * without
    assert fitted.k_g == pytest.approx(SOFT.k_g, abs=1.0e-3)
    assert fitted.contact.omega == pytest.approx(SOFT.contact.omega, rel=0.15)
    assert fitted.contact.mu == pytest.approx(SOFT.contact.mu, abs=0.03)


def test_a_fit_that_begins_at_a_model_does_not_end_behind_it():
    contacts, few = made_contacts(SOFT, 60), DiceFitSettings(evaluations=50)
    _, blind = fit_dice(BELIEVED, contacts, np.random.default_rng(0), few, ())
    _, misfit = fit_dice(BELIEVED, contacts, np.random.default_rng(0), few, (), begin=SOFT)
    assert misfit < 1e-6 < blind


@pytest.mark.slow
def test_a_mechanism_is_chosen_where_contacts_have_it():
    few = DiceFitSettings(choice_evaluations=500, contacts=200)
    contact = replace(SOFT.contact, flat=0.9, flat_dashpot=0.9)
    for chosen, flat in ((True, replace(SOFT, contact=contact)), (False, SOFT)):
        contacts = made_contacts(flat, 200)
        noise = 0.1 * np.random.default_rng(1).standard_normal(contacts.v.shape) / [1.0, 1.0, flat.k_g]
        contacts = replace(contacts, v_after=contacts.v_after + noise)
        found = choose_mechanisms(BELIEVED, contacts, np.random.default_rng(0), few)
        assert found == (("flat",) if chosen else ()), found


def test_samples_with_tails_have_the_covariance_that_is_said():
    contact = ScatteredLaw(BODY, LAW, relative=WIDE, freedom=5.0)
    noise = contact.noise(200_000, np.random.default_rng(0))
    assert np.cov(noise.T) == pytest.approx(np.eye(6), abs=0.05)
    assert (np.abs(noise) > 4.0).mean() > 10 * 6.3e-5  # a Gaussian's


def test_the_contact_map_learns_a_planted_residual_and_knows_how_well():
    settings = DiceStudySettings(training_contacts=250, process=GaussianProcessSettings(restarts=1, device="cpu"))
    contacts = made_contacts(TRUTH, 500, twist=0.1)
    known, new = contacts.select(np.arange(250)), contacts.select(np.arange(250, 500))
    missed = (train_missed(TRUTH, known, settings, np.random.default_rng(0), learned)[0] for learned in (True, False))
    contact, plain = (contact_map("", TRUTH, one, settings).contact for one in missed)
    t, q, v, r, _ = touch_down(TRUTH, new)

    def left(contact):
        mean, _, took = contact.distribution(q, v, r, np.zeros(len(q), bool))
        _, reached = fly(TRUTH.body, mean[:, :3], mean[:, 3:], new.span - t - took)
        return np.median(velocity_error(new.v_after - reached, TRUTH.k_g))

    assert left(contact) < 0.2 * left(plain)


def test_cma_es_finds_the_minimum_of_a_tilted_valley():
    def valley(x):
        return abs(x[0] + x[1] - 1.0) + 10.0 * abs(x[0] - x[1]) + 0.1 * x[2] ** 2

    best, value = cma_es(valley, np.array([3.0, -2.0, 5.0]), np.ones(3), 3000, np.random.default_rng(0))
    assert value < 1e-2
    assert best[:2] == pytest.approx([0.5, 0.5], abs=1e-2)


def test_drag_of_flights_is_recovered_whatever_their_length():
    body = replace(BODY, c_v=0.4, c_w=0.6)
    rng = np.random.default_rng(0)
    q, v = throws(50)
    at, u = fly(body, q, v, rng.uniform(0.05, 0.3, 50))
    assert flight_drag(LongFlights(np.arange(50), at - q, u - v)) == pytest.approx((0.4, 0.6))
