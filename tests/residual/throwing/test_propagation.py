"""Uncertain contacts: feasibility, limits, counts, and recovery of a planted residual."""

from dataclasses import replace

import numpy as np
import pytest
from throws_for_tests import BODY, HALF, RIG, throws

from thesis_lib.contact import LAWS
from thesis_lib.learners.gaussian_process import GaussianProcessSettings
from thesis_lib.thesis.residual.dice.data import LongFlights, MeasuredContacts, flight_drag
from thesis_lib.thesis.residual.dice.fit import DiceModel, choose_mechanisms, cma_es, contact_path, fit_dice
from thesis_lib.thesis.residual.dice.models import contact_map, train_missed
from thesis_lib.thesis.residual.dice.settings import DiceFitSettings, DiceStudySettings
from thesis_lib.thesis.residual.throwing.compliant_contact import CornerContact
from thesis_lib.thesis.residual.throwing.flight import first_touch, fly
from thesis_lib.thesis.residual.throwing.propagation import PENETRATION, Sampled, ScatteredLaw, wrench_map
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings
from thesis_lib.thesis.residual.throwing.throw import LawImpact, push, simulate_throws

LAW = LawImpact(LAWS["mirtich"], 0.15, 0.5, RIG.k_g)
WIDE = np.diag([0.2, 0.2, 0.005]) ** 2
TRUTH = DiceModel(0.026, 0.002, 0.001, 0.0215, "mirtich", 0.11, 0.47, 9.81, d_theta=-0.03)
SOFT = replace(TRUTH, contact=CornerContact(omega=900.0, damping=0.2, dashpot=0.2, mu=0.18, tau=0.2))
BELIEVED = DiceModel(HALF, 0.0, 0.0, RIG.k_g, "mirtich", 0.1, 0.5, 9.81)


def touching(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    q, v = throws(n)
    t, corner = first_touch(BODY, q, v)
    q, v = fly(BODY, q, v, t)
    return q, v, BODY.contact_point(q[:, 2], corner), np.zeros(n, bool)


def made_contacts(model: DiceModel, n: int, twist: float = 0.0) -> MeasuredContacts:
    """Contacts that a model makes, measured without noise; `twist` adds v_x and spin in proportion to the speed."""
    q, v = throws(n, seed=7)
    body = model.body
    t, _ = first_touch(body, q, v)
    before_q, before_v = fly(body, q, v, t - 0.003)
    span = np.full(n, 0.02)
    after_q, after_v = contact_path(model, before_q, before_v, span, ThrowSettings())
    speed = np.linalg.norm(v * [1, 1, model.k_g], axis=1)
    extra = twist * speed * np.sin(4 * before_q[:, 2])
    after_v = after_v + extra[:, None] * [1.0, 0.0, 1.0 / model.k_g]
    turn = np.array([0.0, 0.0, model.d_theta])
    states = before_q + turn, before_v, after_q + turn, after_v
    return MeasuredContacts(np.arange(n), np.ones(n, bool), *states, span, last_hit=np.full(n, 0.003))


def test_samples_neither_penetrate_nor_gain_energy():
    contact = ScatteredLaw(BODY, LAW, relative=WIDE)
    q, v, r, slow = touching(2000)
    _, after, _ = contact(q, v, r, slow, np.random.default_rng(0))
    energy = [np.sum((x * [1, 1, RIG.k_g]) ** 2, axis=1) for x in (v, after)]
    assert (energy[1] <= energy[0] + 1e-12).all()
    assert (after[:, 1] + r[:, 0] * after[:, 2] >= 0.0).all()


def test_a_contact_without_feasible_samples_takes_the_law():
    contact = ScatteredLaw(BODY, LAW, relative=np.diag([0.0, 0.0, 100.0]) ** 2)
    q, v, r, slow = touching(500)
    _, after, _ = contact(q, v, r, slow, np.random.default_rng(0))
    _, expected, _ = LAW(q, v, r, slow, np.random.default_rng(0))
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
    q, v, r, slow = touching(1000)
    after, _, _ = Dented(BODY, LAW)(q, v, r, slow, np.random.default_rng(0))
    gap = BODY.gap(after)
    on_it, above = np.abs(gap) < 1e-12, gap > 1e-12
    assert (on_it | above).all()
    assert min(on_it.mean(), above.mean()) > 0.3  # a dent of a millimetre does not ask for another draw


def test_the_wrench_map_is_what_an_impulse_does():
    rng = np.random.default_rng(0)
    r, c = rng.normal(size=(20, 2)) * 0.03, rng.normal(size=(20, 3))
    expected = push(np.zeros((20, 3)), r, c, 0.02)
    assert np.einsum("nij,nj->ni", wrench_map(r, 0.02), c) == pytest.approx(expected)


@pytest.mark.slow
def test_the_fit_finds_a_planted_body_and_contact():
    contacts = made_contacts(SOFT, 120)
    fitted, misfit = fit_dice(BELIEVED, contacts, np.random.default_rng(0), DiceFitSettings(evaluations=1500))
    even = replace(SOFT, contact=CornerContact())
    _, v = contact_path(even, even.seen(contacts.q), contacts.v, contacts.span, ThrowSettings())
    without = np.linalg.norm((contacts.v_after - v) * [1.0, 1.0, SOFT.k_g], axis=1).mean()
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
    missed, _ = train_missed(TRUTH, known, settings, np.random.default_rng(0))
    contact = contact_map("", TRUTH, missed, settings).contact
    body = TRUTH.body
    q = TRUTH.seen(new.q)
    t, corner = first_touch(body, q, new.v)
    q, v = fly(body, q, new.v, t)
    r = body.contact_point(q[:, 2], corner)
    mean, _, took = contact.distribution(q, v, r, np.zeros(len(q), bool))
    _, reached = fly(body, mean[:, :3], mean[:, 3:], new.span - t - took)
    metric = np.array([1.0, 1.0, TRUTH.k_g])
    left = (new.v_after - reached) * metric
    scatter, _ = train_missed(TRUTH, known, settings, np.random.default_rng(0), False)
    plain = contact_map("", TRUTH, scatter, settings).contact
    bare, _, _ = plain.distribution(q, v, r, np.zeros(len(q), bool))
    _, without = fly(body, bare[:, :3], bare[:, 3:], new.span - t - took)
    before = (new.v_after - without) * metric
    assert np.median(np.linalg.norm(left, axis=1)) < 0.2 * np.median(np.linalg.norm(before, axis=1))


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
