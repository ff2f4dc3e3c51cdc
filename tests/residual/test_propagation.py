"""Uncertain contacts and propagated beliefs: feasibility, limits, moments, and recovery of a planted residual."""

from dataclasses import replace

import numpy as np
import pytest
from throws_for_tests import BODY, HALF, RIG, throws

from thesis_lib.contact import LAWS
from thesis_lib.residual.belief import GaussianMixture
from thesis_lib.residual.dice_data import Contacts, Flights, flight_drag
from thesis_lib.residual.dice_fit import DiceModel, cma_es, fit_dice
from thesis_lib.residual.dice_models import contact_map, train_contact_map
from thesis_lib.residual.dice_settings import DiceFitSettings, DiceStudySettings, ThrowSettings
from thesis_lib.residual.flight import first_touch, fly
from thesis_lib.residual.gaussian_process import GaussianProcessSettings
from thesis_lib.residual.propagation import Sampled, ScatteredLaw, propagate, wrench_map
from thesis_lib.residual.throw import LawImpact, push, simulate_throws, state_at

LAW = LawImpact(LAWS["mirtich"], 0.15, 0.5, RIG.k_g)
WIDE = np.diag([0.2, 0.2, 0.005]) ** 2
TRUTH = DiceModel(0.026, 0.002, 0.001, 0.0215, "mirtich", 0.11, 0.47, 9.81, d_theta=-0.03)
BELIEVED = DiceModel(HALF, 0.0, 0.0, RIG.k_g, "mirtich", 0.1, 0.5, 9.81)


def touching(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    q, v = throws(n)
    t, corner = first_touch(BODY, q, v)
    q, v = fly(BODY, q, v, t)
    return q, v, BODY.contact_point(q[:, 2], corner), np.zeros(n, bool)


def made_contacts(model: DiceModel, n: int, twist: float = 0.0) -> Contacts:
    """Contacts that a model makes, measured without noise; `twist` adds v_x and spin in proportion to the speed."""
    q, v = throws(n, seed=7)
    body = model.body
    t, _ = first_touch(body, q, v)
    before_q, before_v = fly(body, q, v, t - 0.003)
    span = np.full(n, 0.02)
    after_q, after_v, _ = state_at(
        body, before_q, before_v, span, model.impact, ThrowSettings(), np.random.default_rng(0)
    )
    speed = np.linalg.norm(v * [1, 1, model.k_g], axis=1)
    extra = twist * speed * np.sin(4 * before_q[:, 2])
    after_v = after_v + extra[:, None] * [1.0, 0.0, 1.0 / model.k_g]
    turn = np.array([0.0, 0.0, model.d_theta])
    return Contacts(np.arange(n), np.ones(n, bool), before_q + turn, before_v, after_q + turn, after_v, span)


def test_samples_neither_penetrate_nor_gain_energy_and_rejections_are_counted():
    contact = ScatteredLaw(BODY, LAW, relative=WIDE)
    q, v, r, slow = touching(2000)
    _, after, _ = contact(q, v, r, slow, np.random.default_rng(0))
    energy = [np.sum((x * [1, 1, RIG.k_g]) ** 2, axis=1) for x in (v, after)]
    assert (energy[1] <= energy[0] + 1e-12).all()
    assert (after[:, 1] + r[:, 0] * after[:, 2] >= 0.0).all()
    tally = contact.tally
    assert 0.0 < tally.rejection_rate < 0.5
    assert tally.drawn == tally.rejected + tally.contacts - tally.given_up


def test_a_contact_without_feasible_samples_takes_the_law():
    contact = ScatteredLaw(BODY, LAW, relative=np.diag([0.0, 0.0, 100.0]) ** 2, draws=1)
    q, v, r, slow = touching(500)
    _, after, _ = contact(q, v, r, slow, np.random.default_rng(0))
    _, expected, _ = LAW(q, v, r, slow, np.random.default_rng(0))
    assert contact.tally.given_up > 400
    assert np.isclose(after, expected).all(1).sum() == contact.tally.given_up


def test_no_scatter_is_the_law():
    q, v = throws(200)
    certain = simulate_throws(BODY, q, v, LAW, 0.15, ThrowSettings(), np.random.default_rng(0))
    for contact in (Sampled(BODY, LAW), ScatteredLaw(BODY, LAW, relative=np.zeros((3, 3)))):
        out = simulate_throws(BODY, q, v, contact, 0.15, ThrowSettings(), np.random.default_rng(1))
        assert out.q == pytest.approx(certain.q)


def test_the_wrench_map_is_what_an_impulse_does():
    rng = np.random.default_rng(0)
    r, c = rng.normal(size=(20, 2)) * 0.03, rng.normal(size=(20, 3))
    expected = push(np.zeros((20, 3)), r, c, 0.02)
    assert np.einsum("nij,nj->ni", wrench_map(r, 0.02), c) == pytest.approx(expected)


def test_a_propagated_belief_has_the_moments_of_particles():
    q, v = throws(1)
    q[0, 2], v[0, 2] = 0.6, 1.0  # lands on one corner
    start = GaussianMixture.single(np.r_[q[0], v[0]], np.diag([1e-4, 1e-4, 1e-3, 3e-3, 3e-3, 3e-2]) ** 2)
    contact = ScatteredLaw(BODY, LAW, relative=0.01 * WIDE)
    out = propagate(BODY, start, contact, 1, 2000, np.random.default_rng(0))
    mean, cov = out.beliefs[1].moments
    s = start.sample(20_000, np.random.default_rng(1))
    t, corner = first_touch(BODY, s[:, :3], s[:, 3:])
    at, u = fly(BODY, s[:, :3], s[:, 3:], t)
    r = BODY.contact_point(at[:, 2], corner)
    _, after, _ = contact(at, u, r, np.zeros(len(at), bool), np.random.default_rng(2))
    assert mean[3:] == pytest.approx(after.mean(0), abs=0.05)
    assert np.sqrt(np.diag(cov))[3:] == pytest.approx(after.std(0), rel=0.1)


def test_each_contact_widens_the_belief_of_a_throw():
    q, v = throws(1)
    start = GaussianMixture.single(np.r_[q[0], v[0]], np.diag([1e-4, 1e-4, 1e-3, 3e-3, 3e-3, 3e-2]) ** 2)
    contact = ScatteredLaw(BODY, LAW, relative=0.05 * WIDE)
    beliefs = propagate(BODY, start, contact, 3, 500, np.random.default_rng(0)).beliefs
    spin = [np.sqrt(b.moments[1][5, 5]) for b in beliefs]
    assert spin[1] > spin[0] and spin[3] > spin[1]


@pytest.mark.slow
def test_the_fit_finds_a_planted_body_and_law():
    contacts = made_contacts(TRUTH, 250)
    settings = DiceFitSettings(evaluations=600)
    fitted, misfit = fit_dice(BELIEVED, contacts, np.random.default_rng(0), settings)
    assert misfit < 0.03
    assert fitted.half == pytest.approx(TRUTH.half, abs=1.0e-3)
    assert fitted.k_g == pytest.approx(TRUTH.k_g, abs=1.0e-3)
    assert fitted.mu == pytest.approx(TRUTH.mu, abs=0.02)
    assert fitted.epsilon == pytest.approx(TRUTH.epsilon, abs=0.03)
    assert fitted.d_theta == pytest.approx(TRUTH.d_theta, abs=0.015)


@pytest.mark.slow
def test_the_contact_map_learns_a_planted_residual_and_knows_how_well():
    settings = DiceStudySettings(
        training_contacts=250, process=GaussianProcessSettings(restarts=1, device="cpu")
    )
    contacts = made_contacts(TRUTH, 500, twist=0.1)
    known, new = contacts.select(np.arange(250)), contacts.select(np.arange(250, 500))
    process, spread, _ = train_contact_map(TRUTH, known, settings, np.random.default_rng(0))
    contact = contact_map("", TRUTH, process, spread, settings).contact
    body = TRUTH.body
    q = TRUTH.seen(new.q)
    t, corner = first_touch(body, q, new.v)
    q, v = fly(body, q, new.v, t)
    r = body.contact_point(q[:, 2], corner)
    mean, _, took = contact.distribution(q, v, r, np.zeros(len(q), bool))
    _, reached = fly(body, mean[:, :3], mean[:, 3:], new.span - t - took)
    metric = np.array([1.0, 1.0, TRUTH.k_g])
    left = (new.v_after - reached) * metric
    plain = replace(contact, process=replace(process, y=0.0 * process.y))
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
    assert flight_drag(Flights(np.arange(50), at - q, u - v)) == pytest.approx((0.4, 0.6))
